"""Broken files: each is written beside a good one, read, and must be refused with one sentence that names it."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import ocp
import ocp.solution.storage
import ocp.solution.structure
from hard_cases import input_examples as example
from hard_cases.input_call import Fault, fault
from models import Motion
from ocp.checks import Array

Parts = dict[str, Any]  # arrays of a solution file by name, `about` as plain data


@cache
def _good() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "good.npz"
        ocp.save(example.solution(), path)
        return path.read_bytes()


def _changed(change: Callable[[Parts], object]) -> bytes:
    with np.load(io.BytesIO(_good()), allow_pickle=False) as file:
        parts: Parts = {name: np.array(file[name]) for name in file.files}
    parts["about"] = json.loads(str(parts["about"]))
    change(parts)
    if isinstance(parts.get("about"), dict):
        parts["about"] = np.array(json.dumps(parts["about"]))
    stream = io.BytesIO()
    np.savez(stream, **parts)
    return stream.getvalue()


def _about(**changes: object) -> Callable[[Parts], object]:
    return lambda parts: parts["about"].update(changes)


def _array(name: str, change: Callable[[Array], object]) -> Callable[[Parts], object]:
    return lambda parts: parts.update({name: change(parts[name])})


def _without(name: str) -> Callable[[Parts], object]:
    return lambda parts: parts.pop(name)


def _with(values: Array, value: float) -> Array:
    broken = values.copy()
    broken.flat[broken.size // 2] = value
    return broken


def _cut(tenths: int) -> bytes:
    return _good()[: len(_good()) * tenths // 10]


def _flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes(byte ^ 0xFF for byte in content[middle : middle + 64]) + content[middle + 64 :]


def _bomb() -> bytes:
    """Return a small archive whose only array unpacks to two gigabytes, as its directory says."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("states.npy", bytes(2**20))
        archive.filelist[0].file_size = 2**31 - 1
    return stream.getvalue()


def _claim() -> bytes:
    """Return an archive whose header claims more numbers than there are."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        header = io.BytesIO()
        shape = {"descr": "<f8", "fortran_order": False, "shape": (10**13, 3, 6)}
        np.lib.format.write_array_header_1_0(header, shape)
        for name in ("states", "about"):
            archive.writestr(f"{name}.npy", header.getvalue())
    return stream.getvalue()


def _text(value: str) -> Callable[[], bytes]:
    return lambda: value.encode()


def solution_files() -> Mapping[str, Callable[[], bytes]]:
    """Return the contents of broken solution files."""
    changes: dict[str, Callable[[Parts], object]] = {
        "foreign format": _about(format="other"), "version 99": _about(version=99), "version 0": _about(version=0),
        "version as text": _about(version="2"), "version true": _about(version=True),
        "no version": _about(version=None),
        "status unknown": _about(status="FINE"), "status a list": _about(status=[1]),
        "no duration": _about(duration=None),
        "duration a text": _about(duration="long"), "duration negative": _about(duration=-1.0),
        "values a list": _about(values=[1.0]), "value a text": _about(values={"gravity.g": "heavy"}),
        "timings wrong": _about(timings={"whole": 1.0}), "iterations wrong": _about(iterations="many"),
        "iterations infinite": _about(iterations=1e999), "scheme unknown": _about(scheme={"name": "euler"}),
        "scheme a number": _about(scheme=3), "degree huge": _about(scheme={"name": "radau",
        "degree": 10**9, "control": "constant"}),
        "log a number": _about(log=3), "structure a text": _about(structure="bang"),
        "structure hollow": _about(structure={"rows": [], "arcs": []}),
        "rows crooked": _about(structure={"rows": [[1]], "arcs": [1]}),
        "about a list": lambda parts: parts.update(about=np.array("[]")),
        "about no JSON": lambda parts: parts.update(about=np.array("{format")),
        "about deep": lambda parts: parts.update(about=np.array("[" * 100_000)),
        "about numbers": lambda parts: parts.update(about=np.arange(3.0)),
        "states flat": _array("states", np.ravel), "states short": _array("states", lambda a: a[1:]),
        "states wide": _array("states", lambda a: np.concatenate([a, a], axis=2)),
        "states empty": _array("states", lambda a: a[:0]), "states NaN": _array("states", lambda a: _with(a, np.nan)),
        "states infinite": _array("states", lambda a: _with(a, np.inf)),
        "states complex": _array("states", lambda a: a * 1j),
        "states texts": _array("states", lambda a: a.astype("U8")),
        "controls NaN": _array("controls", lambda a: _with(a, np.nan)),
        "costates NaN": _array("costates", lambda a: _with(a, np.nan)),
        "controls flat": _array("controls", np.ravel), "ends falling": _array("ends", lambda a: a[::-1]),
        "ends NaN": _array("ends", lambda a: _with(a, np.nan)), "ends short": _array("ends", lambda a: a[:1]),
        "limits flat": _array("limits_x", np.ravel), "limits pickled": _array("limits_x", lambda a: a.astype(object)),
        "states pickled": _array("states", lambda a: a.astype(object)),
    }  # fmt: skip
    missing = {
        f"no {name}": (lambda parts, name=name: parts.pop(name))
        for name in (*ocp.solution.storage.ARRAYS, "about", "limits_u")
    }
    files: dict[str, Callable[[], bytes]] = {
        name: partial(_changed, change) for name, change in {**changes, **missing}.items()
    }  # fmt: skip
    cut = {f"cut at {k} tenths": partial(_cut, k) for k in range(10)}
    return files | cut | {
        "bytes flipped": lambda: _flipped(_good()), "a text": _text("t,q1\n0,1\n"), "JSON": _text("{}"),
        "pickle": lambda: b"\x80\x04]\x94.", "zip bomb": _bomb, "claims too much": _claim, "zeros": lambda: bytes(4096),
        "one array": lambda: _saved(np.arange(3.0)),
    }  # fmt: skip


def _saved(array: Array) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


TABLES: Mapping[str, bytes] = {
    "empty": b"", "blank": b"\n\n", "binary": bytes(range(256)), "UTF-16": "t,q1\n0,1\n".encode("utf-16"),
    "no header": b"0,1,2,3\n1,2,3,4\n", "header only": b"t,q1,q2,q3\n", "one row": b"t,q1,q2,q3\n0,1,2,3\n",
    "short row": b"t,q1,q2,q3\n0,1,2,3\n1,2\n", "words": b"t,q1,q2,q3\n0,a,b,c\n1,2,3,4\n",
    "NaN": b"t,q1,q2,q3\n0,1,2,3\n1,nan,3,4\n2,3,4,5\n", "infinite": b"t,q1,q2,q3\n0,1,2,3\n1,inf,3,4\n2,3,4,5\n",
    "time repeated": b"t,q1,q2,q3\n0,1,2,3\n0,2,3,4\n1,3,4,5\n", "time falling": b"t,q1,q2,q3\n1,1,2,3\n0,2,3,4\n",
    "unit wrong": b"t [h],q1,q2,q3\n0,1,2,3\n1,2,3,4\n", "bars": b"t|q1|q2|q3\n0|1|2|3\n1|2|3|4\n",
    "long line": b"t," + b"q" * 100_000 + b"\n", "column twice": b"t,q1,q1,q3\n0,1,2,3\n1,2,3,4\n",
    "complex": b"t,q1,q2,q3\n0,1j,2,3\n1,2,3,4\n", "huge": b"t,q1,q2,q3\n0,1e400,2,3\n1,2,3,4\n",
}  # fmt: skip


def _trajectory(positions: str, time: str = "1") -> bytes:
    first = f'{{"positions": {positions}, "time_from_start": 0}}'
    second = f'{{"positions": [1], "time_from_start": {time}}}'
    return f'{{"joint_names": ["a"], "points": [{first}, {second}]}}'.encode()


TRAJECTORIES: Mapping[str, bytes] = {
    "empty": b"", "binary": bytes(range(256)), "no JSON": b"{points", "a list": b"[]", "a number": b"3",
    "null": b"null", "deep": b"[" * 100_000, "no points": b'{"joint_names": ["a"]}',
    "points empty": b'{"joint_names": ["a"], "points": []}',
    "points numbers": b'{"joint_names": ["a"], "points": [1, 2]}',
    "names empty": b'{"joint_names": [], "points": [{}]}', "names numbers": b'{"joint_names": [1], "points": [{}]}',
    "one point": b'{"joint_names": ["a"], "points": [{"positions": [1], "time_from_start": 0}]}',
    "positions words": _trajectory('["x"]'), "positions null": _trajectory("[null]"),
    "positions NaN": _trajectory("[NaN]"), "positions lists": _trajectory("[[1, 2]]"),
    "positions huge": _trajectory("[1" + "0" * 400 + "]"), "positions a text": _trajectory('"x"'),
    "positions true": _trajectory("[true]"), "time a text": _trajectory("[1]", '"0"'),
    "time NaN": _trajectory("[1]", "NaN"), "time huge": _trajectory("[1]", "1" + "0" * 400),
    "time true": _trajectory("[1]", "true"), "time again": _trajectory("[1]", "0"),
}  # fmt: skip


def refusals(folder: Path) -> Iterator[tuple[str, str, Fault | None]]:
    """Yield reader, file and what is wrong with the error for every broken file, None where nothing is.

    Args:
        folder: to write the files in.
    """
    readers: tuple[tuple[str, str, Callable[[Path], object], Mapping[str, bytes | Callable[[], bytes]]], ...] = (
        ("ocp.load", "npz", ocp.load, solution_files()),
        ("ocp.solve(guess=)", "npz", lambda path: ocp.solve(example.problem(), guess=path), {"a text": b"abc"}),
        ("Motion.from_csv", "csv", Motion.from_csv, TABLES),
        ("Motion.from_trajectory", "json", Motion.from_trajectory, TRAJECTORIES),
    )
    for reader, suffix, read, files in readers:
        for name, content in files.items():
            path = folder / f"broken.{suffix}"
            path.write_bytes(content if isinstance(content, bytes) else content())
            what = fault(partial(read, path), (path.name,))
            yield reader, name, Fault(reader, suffix, name, what) if what else None
        path.unlink()
        for name, path in (("missing", folder / "missing.npz"), ("a folder", folder)):
            what = fault(partial(read, path), (path.name, str(path)))
            yield reader, name, Fault(reader, suffix, name, what) if what else None
