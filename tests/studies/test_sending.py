"""Functions on their way to worker processes, and workers whose parent is killed."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from catalogue.studies import plain

from ocp import Study, sweep
from ocp.studies import sending
from ocp.studies.sending import NotSentError

ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
METHODS = [m for m in ("fork", "forkserver", "spawn") if m in multiprocessing.get_all_start_methods()]


def pool(method, jobs=1):
    return partial(ProcessPoolExecutor, jobs, multiprocessing.get_context(method))


def doubled(k):
    return lambda x: k * x


@pytest.mark.parametrize("method", METHODS)
def test_a_closure_is_refused_before_anything_is_stored_where_it_cannot_be_sent(method, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    study = Study(doubled(2.0), over={"x": [1.0, 2.0]}, store=tmp_path / "s.db")
    with pytest.raises(
        NotSentError, match=r"cannot be sent to another process.*move it to a module.*pip install cloudpickle"
    ):
        study.run(pool(method))
    assert study.table().records == (None, None)
    assert np.array_equal(study.run(ThreadPoolExecutor(1))["value"], [2.0, 4.0])
    with pytest.raises(NotSentError, match="move it to a module"), pool(method)() as processes:
        list(sweep(doubled(2.0), [{"x": 1.0}], processes))


@pytest.mark.parametrize("method", METHODS)
def test_a_closure_is_carried_by_cloudpickle(method):
    pytest.importorskip("cloudpickle", reason="cloudpickle is not installed (extra notebook)")
    assert list(Study(doubled(3.0), over={"x": [1.0, 2.0]}).run(pool(method))["value"]) == [3.0, 6.0]


NOTEBOOK = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from ocp import Study
def area(width):
    return 2.0 * width
pool = partial(ProcessPoolExecutor, 1, multiprocessing.get_context("spawn"))
print(Study(area, over={"width": [1.0, 2.0]}).run(pool)["value"].tolist())
"""


@pytest.mark.parametrize("carried", [False, True])
def test_a_function_typed_into_a_shell(carried):
    if carried:
        pytest.importorskip("cloudpickle", reason="cloudpickle is not installed (extra notebook)")
    code = NOTEBOOK if carried else f"import sys\nsys.modules['cloudpickle'] = None\n{NOTEBOOK}"
    done = subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=False)
    if carried:
        assert done.stdout.strip() == "[2.0, 4.0]"
    else:
        last = done.stderr.strip().splitlines()[-1]
        assert "typed into a notebook or a shell" in last
        assert "BrokenProcessPool" not in done.stderr


def leaves(x):
    if x == 2:
        sys.exit("enough")
    return x


@pytest.mark.parametrize("executor", [None, pool("spawn")])
def test_sys_exit_fails_the_case_and_not_the_study(executor):
    table = Study(leaves, over={"x": [1, 2, 3]}).run(executor)
    assert list(table.ok) == [True, False, True]
    assert "SystemExit: enough" in table.failures[1]
    assert [one.ok for one in sweep(leaves, [{"x": 2}, {"x": 3}])] == [False, True]


PARENT = """
import multiprocessing, os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from ocp import Study
from test_sending import busy
if __name__ == "__main__":
    pool = partial(ProcessPoolExecutor, 2, multiprocessing.get_context({method!r}))
    Study(busy, over={{"x": range(8), "folder": [{folder!r}]}}).run(pool)  # one worker is busy, one may be idle
"""


def busy(x, folder):
    (Path(folder) / f"{os.getpid()}.pid").touch()
    begun = time.process_time()
    while time.process_time() - begun < 60.0:  # in Python, without a pause
        pass
    return x


def _lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _group(leader):
    """Return the ids of the processes of a group."""
    pids = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    group = []
    for pid in pids:
        with contextlib.suppress(OSError):
            if os.getpgid(pid) == leader:
                group.append(pid)
    return group


def _until(condition, seconds):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
@pytest.mark.parametrize(
    "method", [pytest.param(method, marks=[] if method == "fork" else pytest.mark.slow) for method in METHODS]
)
def test_workers_end_when_their_parent_is_killed(method, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(PARENT.format(method=method, folder=str(tmp_path)))
    paths = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests"), str(Path(__file__).parent)])}
    process = subprocess.Popen([sys.executable, str(script)], env={**os.environ, **paths}, start_new_session=True)
    try:
        _until(lambda: list(tmp_path.glob("*.pid")), 120.0)
        group = _group(process.pid)
        assert len(group) > 1
        process.send_signal(signal.SIGKILL)
        process.wait()
        _until(lambda: not any(map(_lives, group)), 30.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def test_the_process_of_a_study_does_not_watch_its_own_parent():
    sending.end_with_parent(os.getpid())
    assert not any(thread.name == "end with parent" for thread in threading.enumerate())
    assert list(Study(plain, over={"a": [1.0]}).run()["value"]) == [3.0]
