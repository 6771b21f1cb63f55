"""CSV tables of a motion: a header of names and units, then one row of numbers for each time."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from models.motions.coordinate_columns import as_recording, find_columns, is_time, renamed
from models.motions.recording import Recording
from models.motions.table_text import layout_of, read_columns
from ocp import checks
from ocp.system import Label


def read_csv(
    path: str | os.PathLike[str], coordinates: Sequence[Label] = (), joints: Mapping[str, str] | None = None
) -> Recording:
    """Read a table with the header t, q..., and maybe v... and a...

    The first column is t, time or timestamp. Coordinates are called q1 .. qn, or by the names of the machine; their
    derivatives v1 or v_theta or dtheta/dt, and a1 or a_theta or d2theta/dt2. A unit may follow: theta [deg],
    theta (deg), theta_deg, r [mm], t [ms]; without one SI and radians are meant. Other columns are not read, whatever
    they hold. Columns are separated by commas, semicolons, tabs or spaces; with semicolons, tabs or spaces numbers may
    have decimal commas. The notes tell what was recognised and what was left out.

    Args:
        path: of the file, UTF-8.
        coordinates: names and units of the machine, in its order; empty: as many as q1, q2 ... there are.
        joints: name in the file -> name of the coordinate, for other names.

    Raises:
        OSError: no such file.
        ValueError: no table; the sentence names the column or the line that is wrong.
    """

    def read(file: Path, stream: BinaryIO) -> Recording:
        layout = layout_of(stream)
        header = renamed(layout.header, joints or {})
        columns = find_columns(header, coordinates)
        table = read_columns(file, stream, layout, columns.used)
        return as_recording(header, columns, table, coordinates, layout.notes)

    return _opened(path, read)  # type: ignore[no-any-return]


def read_waypoints(
    path: str | os.PathLike[str], coordinates: Sequence[Label] = (), joints: Mapping[str, str] | None = None
) -> Recording:
    """Read waypoints without times: a table with the header q...; the times are 1 .. K. See `read_csv`.

    Raises:
        OSError: no such file.
        ValueError: no table; the sentence names the column or the line that is wrong.
    """

    def read(file: Path, stream: BinaryIO) -> Recording:
        layout = layout_of(stream)
        # A column of the numbers 1 .. K takes the place of the times.
        header = [("t", ""), *renamed(layout.header, joints or {})]
        columns = find_columns(header, coordinates)
        table = read_columns(file, stream, layout, [k - 1 for k in columns.used[1:]])
        count = np.arange(1.0, len(table) + 1.0)
        return as_recording(header, columns, np.column_stack([count, table]), coordinates, layout.notes)

    return _opened(path, read)  # type: ignore[no-any-return]


def column_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of the columns of a table, without units; a time in the first column is called t.

    Raises:
        OSError: no such file.
        ValueError: no header.
    """

    def read(file: Path, stream: BinaryIO) -> list[str]:
        names = layout_of(stream).names
        return ["t", *names[1:]] if is_time(names[0]) else names

    return list(_opened(path, read))


def _opened(path: str | os.PathLike[str], read: Callable[[Path, BinaryIO], Any]) -> Any:
    """Return what a function reads from a file; errors begin with the path."""
    file = checks.path("path", path)
    try:
        with file.open("rb") as stream:
            return read(file, stream)
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: no UTF-8 text (byte {error.start} of a line); save it as UTF-8") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
