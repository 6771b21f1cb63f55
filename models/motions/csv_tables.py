"""CSV tables of a motion: a header of names and units, then one row of numbers for each time."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from models.motions.recording import SUSPICIOUS, Recording
from ocp import checks
from ocp.checks import Array
from ocp.system import Label

TIME = ("t", "time")
LONGEST = 65_536  # bytes of one line
# What a unit in the header means in SI; the second entry says which coordinates it fits.
UNITS = {"rad": (1.0, "rad"), "deg": (np.pi / 180.0, "rad"), "m": (1.0, "m"), "mm": (1e-3, "m"), "cm": (1e-2, "m")}
TIMES = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
HEADING = re.compile(r"^\s*(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\]\s*)?$")
# Prefixes and patterns of the derivatives of a coordinate called {}.
SPELLINGS = (
    ("{0}", "q_{0}", "q{0}"),
    ("v_{0}", "v{0}", "d{0}/dt", "dq{0}/dt"),
    ("a_{0}", "a{0}", "d2{0}/dt2", "d2q{0}/dt2"),
)


def read_csv(path: str | os.PathLike[str], coordinates: Sequence[Label] = ()) -> Recording:
    """Read a CSV table with the header t, q..., and maybe v... and a...

    The first column is t or time. Coordinates are called q1 .. qn, or by the names of the machine; their derivatives
    v1 or v_theta or dtheta/dt, and a1 or a_theta or d2theta/dt2. A unit may follow in brackets: theta [deg], r [mm],
    t [ms]; without one SI and radians are meant. Other columns are left out, and the notes say so
    (but for torques, which a table of Hamel has).

    Args:
        path: of the file, UTF-8, columns separated by commas.
        coordinates: names and units of the machine, in its order; empty: as many as q1, q2 ... there are.

    Raises:
        OSError: no such file.
        ValueError: no table; the sentence names the column or the line that is wrong.
    """
    file = checks.path("path", path)
    try:
        with file.open("rb") as stream:
            header = _header(stream)
            columns = _columns(header, coordinates)
            table = _numbers(file, stream, len(header))
        return _recording(header, columns, table, coordinates)
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: no UTF-8 text (byte {error.start} of a line); save it as UTF-8") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def read_waypoints(path: str | os.PathLike[str], coordinates: Sequence[Label] = ()) -> Array:
    """Read waypoints without times (K, n) [rad or m]: a CSV table with the header q...; see `read_csv`.

    Raises:
        OSError: no such file.
        ValueError: no table; the sentence names the column or the line that is wrong.
    """
    file = checks.path("path", path)
    try:
        with file.open("rb") as stream:
            header = [("t", ""), *_header(stream)]  # a column of numbers 1 .. K in the place of the times
            columns = _columns(header, coordinates)
            table = _numbers(file, stream, len(header) - 1)
        count = np.arange(1.0, len(table) + 1.0)
        return _recording(header, columns, np.column_stack([count, table]), coordinates).q
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: no UTF-8 text (byte {error.start} of a line); save it as UTF-8") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def column_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of the columns of a CSV table, without units; a time in the first column is called t.

    Raises:
        OSError: no such file.
        ValueError: no header.
    """
    file = checks.path("path", path)
    try:
        with file.open("rb") as stream:
            names = [name for name, _ in _header(stream)]
        return ["t", *names[1:]] if names[0].lower() in TIME else names
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: no UTF-8 text (byte {error.start} of a line); save it as UTF-8") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _header(stream: BinaryIO) -> list[tuple[str, str]]:
    """Return name and unit of every column."""
    line = stream.readline(LONGEST + 1)
    if not line.strip():
        raise ValueError("the file is empty" if not line else "the first line is empty, expected the header t,q1,...")
    if len(line) > LONGEST:
        raise ValueError(f"the header line is longer than {LONGEST} bytes; this is no table of a motion")
    if line[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in line:
        raise ValueError("no UTF-8 text (UTF-16 or binary); save it as UTF-8")
    text = line.decode("utf-8-sig").strip()
    if "," not in text:
        other = next((name for mark, name in ((";", "';'"), ("\t", "tabs")) if mark in text), "")
        raise ValueError(f"the header has one column{f', separated by {other}' if other else ''}; expected commas")
    header = []
    for cell in text.split(","):
        match = HEADING.match(cell.strip().strip('"'))
        if match is None:
            raise ValueError(f"the heading {cell!r} cannot be read, expected a name and maybe a unit in brackets")
        header.append((match["name"], (match["unit"] or "").strip()))
    if all(_is_number(name) for name, _ in header):
        raise ValueError("the first line holds numbers, expected the header t,q1,...")
    names = [name for name, _ in header]
    double = next((name for name in names if name and names.count(name) > 1), None)
    if double is not None:
        raise ValueError(f"the column {double!r} stands twice in the header")
    return header


def _columns(header: list[tuple[str, str]], coordinates: Sequence[Label]) -> list[list[int]]:
    """Return the columns of q, v and a; an empty list for a derivative that is not there."""
    names = [name for name, _ in header]
    if names[0].lower() not in TIME:
        raise ValueError(f"the first column is {names[0]!r}, expected t or time")
    if coordinates:
        known = [label.name for label in coordinates]
    else:
        known = []
        while any(spelling in names for spelling in (f"q{len(known) + 1}", f"q_{len(known) + 1}")):
            known.append(str(len(known) + 1))
        if not known:
            raise ValueError(f"no column q1; the header has {', '.join(names)}")
    results: list[list[int]] = []
    for spellings in SPELLINGS:
        columns = []
        for i, name in enumerate(known, 1):
            tried = [spelling.format(key) for spelling in spellings for key in (name, str(i), f"_{i}")]
            place = next((names.index(word) for word in tried if word in names[1:]), None)
            if place is not None:
                columns.append(place)
            elif not results or columns:
                words = " or ".join(dict.fromkeys(spelling.format(name) for spelling in spellings[:3]))
                raise ValueError(f"no column {words}; the header has {', '.join(names)}")
        results.append(columns)
    return results


def _numbers(file: Path, stream: BinaryIO, width: int) -> Array:
    """Return the rows as numbers (K, width)."""
    start = stream.tell()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a table without rows, which is an error below
            table = np.loadtxt(_lines(stream), delimiter=",", ndmin=2, dtype=float, comments=None)
    except UnicodeDecodeError:
        raise
    except ValueError as error:
        if "longer than" in str(error):
            raise
        table = np.empty((0, 0))
        stream.seek(start)
        for number, line in enumerate(_lines(stream), 2):
            cells = line.split(",")
            if line.strip() and len(cells) != width:
                raise ValueError(f"line {number} has {len(cells)} columns, the header has {width}") from None
            bad = next((cell.strip() for cell in cells if line.strip() and not _is_number(cell)), None)
            if bad is not None:
                what = "an empty cell" if not bad else repr(bad[:40])
                raise ValueError(f"line {number}: {what} is no number") from None
        raise ValueError(str(error)) from None
    if table.size == 0:
        raise ValueError("there is no row of numbers after the header")
    if table.shape[1] != width:
        raise ValueError(f"line 2 has {table.shape[1]} columns, the header has {width}")
    return table


def _lines(stream: BinaryIO) -> Iterator[str]:
    for number, line in enumerate(iter(lambda: stream.readline(LONGEST + 1), b""), 2):
        if len(line) > LONGEST:
            raise ValueError(f"line {number} is longer than {LONGEST} bytes")
        yield line.decode("utf-8")


def _recording(
    header: list[tuple[str, str]], columns: list[list[int]], table: Array, coordinates: Sequence[Label]
) -> Recording:
    name, unit = header[0]
    if unit not in TIMES:
        raise ValueError(f"the column {name!r} is in {unit!r}, expected s, ms, us or ns")
    labels, parts = [], []
    for order, places in enumerate(columns):
        factors = []
        for i, place in enumerate(places):
            given = header[place][1]
            base = given.split("/")[0]
            expected = coordinates[i].unit if coordinates else ""
            if order and given and given not in (f"{base}/s", f"{base}/s^2")[order - 1 : order]:
                per = "s" if order == 1 else "s^2"
                raise ValueError(f"the column {header[place][0]!r} is in {given!r}, expected a unit per {per}")
            if base and (base not in UNITS or (expected and UNITS[base][1] != expected)):
                fitting = ", ".join(unit for unit, (_, kind) in UNITS.items() if not expected or kind == expected)
                raise ValueError(f"the column {header[place][0]!r} is in {given!r}, expected one of {fitting}")
            factors.append(UNITS[base][0] if base else 1.0)
            if order == 0:
                largest = float(np.nanmax(np.abs(table[:, place])))
                if not base and expected == "rad" and np.isfinite(largest) and largest > SUSPICIOUS:
                    raise ValueError(
                        f"the column {header[place][0]!r} reaches {largest:g}: degrees? Write {header[place][0]} [deg] "
                        "or [rad] in the header"
                    )
                labels.append(
                    Label(coordinates[i].name if coordinates else f"q{i + 1}", UNITS[base][1] if base else expected)
                )
        parts.append(table[:, places] * factors if places else None)
    used = {0, *(place for places in columns for place in places)}
    unused = [name for k, (name, _) in enumerate(header) if k not in used and "tau_" not in name]
    notes = (f"columns left out: {', '.join(unused)}",) if unused else ()
    q, v, a = parts
    assert q is not None
    return Recording(table[:, 0] * TIMES[unit], q, v, a if v is not None else None, tuple(labels), notes)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
