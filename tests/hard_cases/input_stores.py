"""Broken stores of studies: each is opened and read, and must be refused with one sentence that names the file."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from functools import cache, partial
from pathlib import Path

import ocp
from hard_cases import input_examples as example
from hard_cases.input_call import Fault, fault
from ocp.studies.store import SCHEMA

PAGE = 4096


def _study(path: Path) -> ocp.Study:
    return ocp.Study(example.cart(), over={"m": [1.0, 2.0]}, grid=ocp.uniform(4), store=path)


@cache
def _good() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "good.db"
        _study(path).run()
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("pragma wal_checkpoint(truncate)")
        return path.read_bytes()


def _changed(*statements: str) -> bytes:
    """Return the good store after statements of SQL."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "changed.db"
        path.write_bytes(_good())
        with closing(sqlite3.connect(path)) as connection:
            for statement in statements:
                connection.execute(statement)
            connection.commit()
            connection.execute("pragma wal_checkpoint(truncate)")
        return path.read_bytes()


def _foreign() -> bytes:
    """Return the database of another program."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "foreign.db"
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("create table cases (id text)")
            connection.commit()
        return path.read_bytes()


def _spoilt() -> bytes:
    """Return the good store with the beginning of every page but the first overwritten."""
    content = bytearray(_good())
    for offset in range(PAGE, len(content), PAGE):
        content[offset : offset + 64] = b"\xff" * 64
    return bytes(content)


def _cut(tenths: int) -> bytes:
    return _good()[: len(_good()) * tenths // 10]


# What is in the rows, and what stands there instead.
ROWS: Mapping[str, tuple[str, str]] = {
    "parameters no JSON": ("cases", "parameters = '{m'"), "parameters a list": ("cases", "parameters = '[1]'"),
    "parameters null": ("cases", "parameters = '{\"m\": null}'"), "parameters bytes": ("cases", "parameters = x'ff00'"),
    "parameters infinite": ("cases", "parameters = '{\"m\": Infinity}'"),
    "results a list": ("cases", "results = '[1]'"), "results texts": ("cases", "results = '{\"cost\": \"low\"}'"),
    "results nested": ("cases", "results = '{\"cost\": [1]}'"),
    "timings texts": ("cases", "timings = '{\"total\": \"x\"}'"),
    "timings no JSON": ("cases", "timings = ''"), "status bytes": ("cases", "status = x'ff'"),
    "attempts a text": ("cases", "attempts = 'many'"), "attempts negative": ("cases", "attempts = -1"),
    "message bytes": ("cases", "message = x'ff'"), "origin bytes": ("cases", "origin = x'ff'"),
    "solution a text": ("solutions", "content = 'abc'"), "solution empty": ("solutions", "content = x''"),
    "solution cut": ("solutions", "content = substr(content, 1, 100)"),
}  # fmt: skip


def contents() -> Mapping[str, Callable[[], bytes]]:
    """Return the contents of broken stores."""
    rows = {
        name: partial(_changed, f"update {table} set {change}")
        for name, (table, change) in ROWS.items()
        if table == "cases"
    }
    tables = {
        f"no table {name}": partial(_changed, f"drop table {name}") for name in ("studies", "cases", "claims")
    }  # fmt: skip
    return {
        "a text": lambda: b"a,b\n1,2\n", "zeros": lambda: bytes(PAGE), "only the magic": lambda: b"SQLite format 3\0",
        "a solution": example.saved, "another program's": _foreign, "pages spoilt": _spoilt,
        "newer schema": lambda: _changed(f"pragma user_version = {SCHEMA + 1}"),
        "far newer schema": lambda: _changed("pragma user_version = 2147483647"),
        "a column missing": lambda: _changed("alter table cases drop column way"),
        "a table of another form": lambda: _changed("drop table cases", "create table cases (id text)"),
        **{f"cut at {k} tenths": partial(_cut, k) for k in range(1, 10)}, **tables, **rows,
    }  # fmt: skip


def _read(path: Path) -> ocp.StudyTable:
    """Return the table of a store, opened to be read."""
    return _study(path).table()


def _run(path: Path) -> ocp.StudyTable:
    """Return the table of a store, opened to be written."""
    return _study(path).run()


def _solution(path: Path) -> ocp.Solution:
    return _read(path).solution(1, example.cart())


def _unusable_paths(folder: Path) -> Mapping[str, Path]:
    """Return paths at which no store can be."""
    locked = folder / "locked.db"
    locked.write_bytes(_good())
    locked.chmod(0)
    rights = {"no rights": locked}
    with suppress(OSError), locked.open("rb"):
        rights = {}  # the superuser has them all
    nowhere = {"no folder": folder / "none" / "study.db", "not for files": Path("/proc/study.db")}
    return {"a folder": folder, **nowhere, **rights}


def refusals(folder: Path) -> Iterator[tuple[str, str, Fault | None]]:
    """Yield reader, file and what is wrong with the error for every broken store, None where nothing is.

    Whoever only reads a store leaves it as it is.

    Args:
        folder: to write the files in.
    """
    solutions = {
        name: partial(_changed, f"update {table} set {change}")
        for name, (table, change) in ROWS.items()
        if table == "solutions"
    }
    readers = (("Study.table", _read, contents()), ("Study.run", _run, contents()),
               ("StudyTable.solution", _solution, solutions))  # fmt: skip
    for reader, read, files in readers:
        for name, content in files.items():
            for old in folder.glob("broken.db*"):
                old.unlink()
            path, before = folder / "broken.db", content()
            path.write_bytes(before)
            if name == "no table claims" and read is _read:
                continue  # claims are of no concern to a reader
            what = fault(partial(read, path), (path.name, "case"))
            if not what and read is not _run and path.read_bytes() != before:
                what = "refused, but changed"
            yield reader, name, Fault(reader, "store", name, what) if what else None
    for name, path in _unusable_paths(folder).items():
        for reader, read in (("Study.table", _read), ("Study.run", _run)):
            what = fault(partial(read, path), (path.name, str(path)))
            yield reader, name, Fault(reader, "store", name, what) if what else None
    for write in (True, False):
        what = fault(partial(ocp.Store, folder, write), ("path",), (folder.name,))
        yield "ocp.Store", "a folder", Fault("ocp.Store", "path", "a folder", what) if what else None
