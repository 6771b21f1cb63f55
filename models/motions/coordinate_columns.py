"""Columns of a table that hold the time and the coordinates of a motion, and their units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.motions.plausibility import ANGLE
from models.motions.recording import Recording
from ocp import checks
from ocp.checks import Array
from ocp.system import Label

TIME = ("t", "time", "timestamp")
# Unit of a header -> factor to SI, and unit of the coordinates that it fits.
UNITS = {"rad": (1.0, "rad"), "deg": (np.pi / 180.0, "rad"), "m": (1.0, "m"), "mm": (1e-3, "m"), "cm": (1e-2, "m")}
TIMES = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Spellings of a coordinate and its derivatives; {0} is its name.
SPELLINGS = (
    ("{0}", "q_{0}", "q{0}"),
    ("v_{0}", "v{0}", "d{0}/dt", "dq{0}/dt"),
    ("a_{0}", "a{0}", "d2{0}/dt2", "d2q{0}/dt2"),
)

Header = Sequence[tuple[str, str]]  # name and unit of every column


@dataclass(frozen=True)
class Columns:
    """Indices of the columns of q, v and a; empty for a derivative that is not there."""

    orders: tuple[tuple[int, ...], ...]

    @property
    def used(self) -> list[int]:
        """Indices of the time and of all these columns, in order of q, v, a."""
        return [0, *(k for columns in self.orders for k in columns)]


def is_time(name: str) -> bool:
    """Whether a column is the time by its name."""
    return name.lower() in TIME


def check_joints(joints: object) -> Mapping[str, str] | None:
    """Return a map from names in a file to names of coordinates, or None.

    Raises:
        TypeError: no mapping.
        ValueError: a name that is no string.
    """
    wanted = "a dict name in the file -> name of the coordinate, or None"
    checks.instance("joints", joints, Mapping | None, wanted)
    if isinstance(joints, Mapping) and not all(isinstance(one, str) for pair in joints.items() for one in pair):
        raise checks.refused("joints", joints, wanted)
    return joints  # type: ignore[return-value]


def renamed(header: Header, joints: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return a header with the names of a file replaced by those of the machine.

    Args:
        header: of the table.
        joints: name in the file -> name of the coordinate.

    Raises:
        ValueError: a name that the file does not have.
    """
    names = [name for name, _ in header]
    for name in joints:
        if name not in names:
            raise ValueError(f"no column {name!r} to be taken for {joints[name]}; the header has {', '.join(names)}")
    return [(joints.get(name, name), unit) for name, unit in header]


def find_columns(header: Header, coordinates: Sequence[Label]) -> Columns:
    """Return the columns of a header.

    Args:
        header: of the table; the first column is the time.
        coordinates: names and units of the machine; empty: as many as q1, q2 ... there are.

    Raises:
        ValueError: no time in the first column, or a coordinate without a column.
    """
    names = [name for name, _ in header]
    if not is_time(names[0]):
        raise ValueError(f"the first column is {names[0]!r}, expected t or time")
    known = [label.name for label in coordinates]
    if not coordinates:
        while any(spelling in names for spelling in (f"q{len(known) + 1}", f"q_{len(known) + 1}")):
            known.append(str(len(known) + 1))
        if not known:
            raise ValueError(f"no column q1; the header has {', '.join(names)}")
    results: list[tuple[int, ...]] = []
    for spellings in SPELLINGS:
        columns: list[int] = []
        for i, name in enumerate(known, 1):
            tried = [spelling.format(key) for spelling in spellings for key in (name, str(i), f"_{i}")]
            index = next((names.index(word) for word in tried if word in names[1:]), None)
            if index is not None:
                columns.append(index)
            elif not results or columns:
                words = " or ".join(dict.fromkeys(spelling.format(name) for spelling in spellings[:3]))
                raise ValueError(f"no column {words}; the header has {', '.join(names)}")
        results.append(tuple(columns))
    return Columns(tuple(results))


def as_recording(
    header: Header, columns: Columns, table: Array, coordinates: Sequence[Label], notes: tuple[str, ...]
) -> Recording:
    """Return the recording of a table in SI and radians.

    Args:
        header: of the table.
        columns: of the coordinates.
        table: (K, len(columns.used)) numbers of these columns.
        coordinates: names and units of the machine, or none.
        notes: about the file.

    Raises:
        ValueError: a unit that does not fit its column, or angles that look like degrees without a unit.
    """
    name, unit = header[0]
    if unit not in TIMES:
        raise ValueError(f"the column {name!r} is in {unit!r}, expected s, ms, us or ns")
    labels: list[Label] = []
    parts: list[Array | None] = []
    stated, at = True, 1
    for order, indices in enumerate(columns.orders):
        values = table[:, at : at + len(indices)]
        at += len(indices)
        if not indices:
            parts.append(None)
            continue
        expected = [coordinates[i].unit if coordinates else "" for i in range(len(indices))]
        units = [
            _base(header[k], order, fits or (labels[i].unit if order else ""))
            for i, (k, fits) in enumerate(zip(indices, expected, strict=True))
        ]
        if order == 0:
            stated = all(units)
            for i, (k, base) in enumerate(zip(indices, units, strict=True)):
                if not base and expected[i] == "rad":
                    _check_degrees(header[k][0], values[:, i])
                label = coordinates[i].name if coordinates else f"q{i + 1}"
                labels.append(Label(label, UNITS[base][1] if base else expected[i]))
        parts.append(values * [UNITS[base][0] if base else 1.0 for base in units])
    unused = [name for k, (name, _) in enumerate(header) if k not in columns.used and "tau_" not in name]
    # Columns after the torques are parts of them, in a table of this project.
    note = f"columns left out: {', '.join(unused[:8])}{' ...' if len(unused) > 8 else ''}"
    q, v, a = parts
    assert q is not None
    result = (*notes, note) if unused else notes
    return Recording(table[:, 0] * TIMES[unit], q, v, a if v is not None else None, tuple(labels), result, stated)


def _base(heading: tuple[str, str], order: int, expected: str) -> str:
    """Return the unit of a column without its "per second", empty if none is stated."""
    name, given = heading
    base = given.split("/")[0]
    if order and given and given not in (f"{base}/s", f"{base}/s^2")[order - 1 : order]:
        per = "s" if order == 1 else "s^2"
        raise ValueError(f"the column {name!r} is in {given!r}, expected a unit per {per}")
    if base and (base not in UNITS or (expected and UNITS[base][1] != expected)):
        fitting = ", ".join(unit for unit, (_, kind) in UNITS.items() if not expected or kind == expected)
        raise ValueError(f"the column {name!r} is in {given!r}, expected one of {fitting}")
    return base


def _check_degrees(name: str, values: Array) -> None:
    largest = float(np.nanmax(np.abs(values)))
    if np.isfinite(largest) and largest > ANGLE:
        raise ValueError(f"the column {name!r} reaches {largest:g}: degrees? Write {name} [deg] or [rad] in the header")
