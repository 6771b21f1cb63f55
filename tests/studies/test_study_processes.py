"""Studies and sweeps in several processes: the same results, nothing lost or doubled when they are killed."""

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from catalogue.studies import carts, dies, plain, squares, wide, with_memory

from ocp import Product, Study, sweep
from ocp.studies.store import Store, StoreError

ROOT = Path(__file__).parents[2]


def results(table):
    """Everything but how long it took."""
    return [(r.id, r.status, r.way, r.origin, dict(r.results)) if r else None for r in table.records]


def test_sweep_yields_outcomes_in_order():
    cases = Product({"a": [1.0, "x", 3.0]}).cases()
    for executor in (None, ThreadPoolExecutor(2)):
        found = list(sweep(plain, cases, executor))
        assert [o.case for o in found] == cases
        assert [o.value for o in found] == [3.0, None, 5.0]
        assert [o.ok for o in found] == [True, False, True]
        assert found[1].error.startswith("TypeError: ")
    with pytest.raises(TypeError, match="expected one that can be called"):
        sweep(3, cases)
    with pytest.raises(TypeError, match="executor is 2"):
        sweep(plain, cases, 2)
    with pytest.raises(TypeError, match="mapping"):
        sweep(plain, [1])


def test_sweep_survives_a_dying_process():
    with ProcessPoolExecutor(1) as pool:
        found = list(sweep(dies, Product({"x": [1, 3]}).cases(), pool))
    assert "BrokenProcessPool" in found[1].error


def test_two_processes_find_exactly_what_one_finds():
    alone = results(carts().run())
    with ProcessPoolExecutor(2) as pool:
        assert results(carts().run(pool)) == alone


def test_a_case_that_kills_its_process_fails_alone():
    table = Study(dies, over={"x": range(8)}).run(lambda: ProcessPoolExecutor(2))
    assert list(table.failures) == [3]
    assert "died" in table.failures[3]
    assert np.array_equal(table["value"][table.ok], [0, 1, 2, 4, 5, 6, 7])


def test_a_broken_executor_of_the_user_is_told_and_the_rest_goes_on_later(tmp_path):
    study = Study(dies, over={"x": range(8)}, store=tmp_path / "s.db")
    with (
        ProcessPoolExecutor(1) as pool,
        pytest.raises(RuntimeError, match=r"the executor broke.*of 8 cases are stored"),
    ):
        study.run(pool)
    assert len(study.run(lambda: ProcessPoolExecutor(1)).failures) == 1


KILLED = "from pathlib import Path; from catalogue.studies import squares; squares(Path({folder!r}), {count}).run()"


@pytest.mark.slow
def test_killed_at_random_moments_nothing_is_lost_or_doubled(tmp_path):
    (tmp_path / "whole").mkdir()
    (tmp_path / "killed").mkdir()
    whole = squares(tmp_path / "whole").run()
    generator, folder = random.Random(5), tmp_path / "killed"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
    command = [sys.executable, "-c", KILLED.format(folder=str(folder), count=40)]
    done = []
    for _ in range(10):
        process = subprocess.Popen(command, env=environment)
        wanted = (done[-1] if done else 0) + generator.randint(1, 3)
        while process.poll() is None and _stored(folder) < wanted:
            time.sleep(0.002)
        time.sleep(generator.uniform(0.0, 0.03))
        process.send_signal(signal.SIGKILL)
        process.wait()
        done.append(_stored(folder))
    assert done == sorted(done)
    assert 10 <= done[-1] < 40
    table = squares(folder).run()
    for name in ("x", "square", "parity", "status", "message"):
        np.testing.assert_array_equal(table[name], whole[name])
    # Only cases in flight were computed twice.
    marks = (folder / "marks").read_text().split()
    assert len(marks) - 40 <= 10


def _stored(folder, identity=None):
    try:
        with Store(folder / "s.db", write=False) as store:
            return len(store.of_study(identity or squares(folder).identity))
    except (StoreError, OSError):
        return 0


POOL = """
from concurrent.futures import ProcessPoolExecutor
from catalogue.studies import wide
if __name__ == "__main__":
    wide({store!r}).run(lambda: ProcessPoolExecutor(2))
"""


@pytest.mark.slow
def test_a_pool_killed_at_random_moments_finds_the_same_motions(tmp_path):
    """Cases that start from neighbours: the tree is the same, whatever was stored when the processes died."""
    whole = results(wide(None).run())
    script = tmp_path / "script.py"
    script.write_text(POOL.format(store=str(tmp_path / "s.db")))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
    generator, done = random.Random(7), [0]
    for _ in range(10):
        process = subprocess.Popen([sys.executable, str(script)], env=environment, start_new_session=True)
        wanted = done[-1] + generator.randint(1, 8)
        while process.poll() is None and _stored(tmp_path, wide(None).identity) < wanted:
            time.sleep(0.002)
        time.sleep(generator.uniform(0.0, 0.05))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        done.append(_stored(tmp_path, wide(None).identity))
    assert 10 <= done[-1] < len(whole)
    assert results(wide(tmp_path / "s.db").run()) == whole


def test_two_processes_share_a_store(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
    command = [sys.executable, "-c", KILLED.format(folder=str(tmp_path), count=60)]
    processes = [subprocess.Popen(command, env=environment) for _ in range(2)]
    assert [process.wait(timeout=120) for process in processes] == [0, 0]
    assert sorted(map(int, (tmp_path / "marks").read_text().split())) == list(range(60))
    assert len(squares(tmp_path, 60).table().failures) == 1


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory of a process is not known here")
@pytest.mark.parametrize("polished", [False, True])
def test_a_worker_needs_no_more_memory_after_a_thousand_cases(polished):
    axes = {"mass": np.linspace(0.5, 4.0, 40), "limit": np.linspace(0.5, 2.0, 25)}
    # A process of its own: one forked from a large parent counts pages that it copies.
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        table = carts(over=axes, polished=polished, measure=with_memory).run(pool)
    assert np.all(table.ok)
    order = np.argsort([result.finished for result in table.records], kind="stable")
    memory = table["memory"][order]
    assert np.max(memory[-500:]) - np.max(memory[:300]) < 3.0, "3 MB are 6 kB for each case"
