"""The store of studies: transactions, several processes, foreign and damaged files, a full disk."""

import multiprocessing
import os
import resource
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ocp.studies.case_result import CaseResult
from ocp.studies.store import APPLICATION, SCHEMA, Store, StoreError

ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(__file__).parent)])}


def result(name, **changes):
    given = dict(parameters={"a": 1.0}, status="solved", way="cold", message="", results={"cost": 1.5},
                 timings={"total": 0.1}, solutions={"solution": b"content"})  # fmt: skip
    return CaseResult(name, **{**given, **changes})


def test_what_is_stored_is_read_back(tmp_path):
    with Store(tmp_path / "s.db") as store:
        store.begin("study", {"grid": "uniform(50)"})
        store.begin("study", {"grid": "another"})
        store.finish("study", result("one", results={"cost": 1.5, "gap": float("nan")}, origin="zero", structure="s"))
        store.finish("study", result("two", status="failed", message="no \n luck"))
    with Store(tmp_path / "s.db", write=False) as store:
        assert store.studies() == {"study": {"grid": "uniform(50)"}}
        found = store.records(["one", "two", "three"])
        assert set(found) == {"one", "two"}
        assert found["one"].results["cost"] == 1.5
        assert found["one"].results["gap"] != found["one"].results["gap"]
        assert (found["one"].origin, found["one"].structure) == ("zero", "s")
        assert found["one"].ok
        assert not found["two"].ok
        assert found["two"].message == "no \n luck"
        assert store.solution("one") == b"content"
        assert store.solution("one", "other") is None
        assert store.of_study("study") == ["one", "two"]


def test_tuples_of_a_case_stay_tuples(tmp_path):
    case = {"goal": (1.0, (2.0, 3.0)), "form": "x", "count": 3, "held": True}
    with Store(tmp_path / "s.db") as store:
        store.finish("study", result("one", parameters=case))
        assert store.records(["one"])["one"].parameters == case


def test_a_row_that_no_study_wrote_is_damage_that_names_the_file(tmp_path):
    path = tmp_path / "s.db"
    with Store(path) as store:
        store.finish("study", result("one"))
        for change, words in (("results = '[1]'", "results"), ("attempts = 'many'", "attempts")):
            store._connection.execute(f"update cases set {change}")
            with pytest.raises(StoreError, match=f"s.db: is damaged: {words}"):
                store.records(["one"])
            store.finish("study", result("one"))


def test_a_later_record_replaces_the_earlier_one_with_its_solutions(tmp_path):
    with Store(tmp_path / "s.db") as store:
        store.finish("study", result("one", solutions={"phase 1": b"a", "phase 2": b"b"}))
        store.finish("study", result("one", attempts=2))
        assert store.records(["one"])["one"].attempts == 2
        assert store.solution("one", "phase 1") is None
        assert store.solution("one") == b"content"


def test_a_store_in_memory_works_alike():
    with Store(None) as store:
        store.finish("study", result("one"))
        assert store.records(["one"])["one"].ok


def test_more_names_than_one_question_takes(tmp_path):
    with Store(tmp_path / "s.db") as store:
        for k in range(1203):
            store.finish("study", result(str(k), solutions={}))
        assert len(store.records(map(str, range(1300)))) == 1203


def test_the_file_says_what_it_is_even_before_the_log_is_merged(tmp_path):
    """A process that is killed leaves the write-ahead log beside the file."""
    path = tmp_path / "s.db"
    code = (
        "import os, signal, sys; from ocp.studies.store import Store; from test_store import result\n"
        f"store = Store({str(path)!r}); store.finish('study', result('one')); os.kill(os.getpid(), signal.SIGKILL)"
    )
    killed = subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=False)
    assert killed.returncode == -signal.SIGKILL
    head = path.read_bytes()[:100]
    assert int.from_bytes(head[68:72], "big") == APPLICATION
    with Store(path) as store:
        assert store.records(["one"])["one"].ok


def _hold(path, ready, done):
    with Store(path) as store:
        ready.put(store.claim("one"))
        done.get()


def test_a_case_belongs_to_one_living_process(tmp_path):
    context = multiprocessing.get_context("spawn")
    ready, done = context.Queue(), context.Queue()
    path = tmp_path / "s.db"
    with Store(path) as store:
        process = context.Process(target=_hold, args=(path, ready, done))
        process.start()
        assert ready.get(timeout=60)
        assert not store.claim("one")
        assert store.claim("two")
        process.kill()
        process.join()
        deadline = time.monotonic() + 10.0
        while not store.claim("one"):  # the dead process is collected by then
            assert time.monotonic() < deadline
        store.release()
    done.close()


def _write_many(path, first):
    with Store(path) as store:
        for k in range(first, first + 50):
            store.finish("study", result(str(k)))


def test_two_processes_write_at_once(tmp_path):
    context = multiprocessing.get_context("spawn")
    path = tmp_path / "s.db"
    processes = [context.Process(target=_write_many, args=(path, first)) for first in (0, 50)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0, 0]
    with Store(path, write=False) as store:
        assert len(store.of_study("study")) == 100


def _foreign(path):
    connection = sqlite3.connect(path)
    connection.execute("create table t (a)")
    connection.commit()
    connection.close()


def _newer(path):
    Store(path).close()
    connection = sqlite3.connect(path)
    connection.execute(f"pragma user_version = {SCHEMA + 1}")
    connection.commit()
    connection.close()


def _damaged(path):
    with Store(path) as store:
        for k in range(200):
            store.finish("study", result(str(k), solutions={"solution": os.urandom(2000)}))
        store._connection.execute("pragma wal_checkpoint(truncate)")
    content = bytearray(path.read_bytes())
    for place in range(4096 * 3, len(content), 4096):
        content[place : place + 64] = b"\xff" * 64
    path.write_bytes(content)


def _truncated(path):
    _damaged(path)
    path.write_bytes(path.read_bytes()[:5000])


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.write_text("a,b\n1,2\n"), "no SQLite file"),
        (lambda path: path.write_bytes(b"SQLite format 3\0"), "no SQLite file"),
        (_foreign, "another program"),
        (_newer, "schema version"),
        (_damaged, "damaged|malformed"),
        (_truncated, "damaged|malformed"),
    ],
)
def test_a_foreign_or_damaged_file_is_refused_and_left_alone(tmp_path, spoil, words):
    path = tmp_path / "s.db"
    spoil(path)
    before = path.read_bytes()
    with pytest.raises(StoreError, match=words) as caught:
        Store(path)
    assert str(path) in str(caught.value)
    assert path.read_bytes() == before


def test_no_store_and_no_file(tmp_path):
    with pytest.raises(StoreError, match="no such store"):
        Store(tmp_path / "none.db", write=False)
    assert not (tmp_path / "none.db").exists()
    with pytest.raises(ValueError, match="expected the path of a file"):
        Store(tmp_path)
    with pytest.raises(StoreError, match="cannot be opened"):
        Store(tmp_path / "no" / "folder" / "s.db")


FULL = """
import resource, signal, sys
from ocp.studies.store import Store, StoreError
from test_store import result
path, count = sys.argv[1], 0
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
with Store(path) as store:
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
    try:
        while True:
            store.finish("study", result(str(count), solutions={"solution": bytes(20_000)}))
            count += 1
    except StoreError as error:
        print(count, error)
"""


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="no limit on the size of files here")
def test_a_full_disk_loses_nothing_that_was_stored(tmp_path):
    path = tmp_path / "s.db"
    found = subprocess.run(
        [sys.executable, "-c", FULL, str(path)], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    count, _, message = found.stdout.partition(" ")
    assert "cannot be written" in message
    assert "what was stored before is kept" in message
    assert int(count) > 3
    with Store(path) as store:
        assert len(store.of_study("study")) == int(count)
        store.finish("study", result("after"))


def test_a_store_that_is_read_only_says_so(tmp_path):
    path = tmp_path / "s.db"
    with Store(path) as store:
        store.finish("study", result("one"))
    with Store(path, write=False) as store:
        assert store.records(["one"])["one"].ok
        with pytest.raises(StoreError, match=r"readonly|read-only"):
            store.finish("study", result("two"))
    before = path.read_bytes()
    with Store(path) as store:
        assert store.of_study("study") == ["one"]
    assert path.read_bytes() == before
