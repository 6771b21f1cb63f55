"""OpenSim storage files (.sto, .mot): a header that ends with "endheader", then a table separated by tabs or spaces."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence

from models.motions.coordinate_columns import as_recording, find_columns, renamed
from models.motions.recording import Recording
from models.motions.table_text import layout_of, read_columns
from ocp import checks
from ocp.system import Label

LONGEST = 1000  # lines of the header


def read_opensim(
    path: str | os.PathLike[str], coordinates: Sequence[Label] = (), joints: Mapping[str, str] | None = None
) -> Recording:
    """Read an OpenSim storage file with the columns time, q...; names and derivatives as in `read_csv`.

    With inDegrees=yes in its header, coordinates whose unit is rad (or unknown) are in degrees.

    Args:
        path: of the file, UTF-8.
        coordinates: names and units of the machine, in its order; empty: as many as q1, q2 ... there are.
        joints: name in the file -> name of the coordinate, for other names.

    Raises:
        OSError: no such file.
        ValueError: no storage file; the sentence says what is wrong.

    Source: OpenSim user's guide, Storage (.sto) and Motion (.mot) files.
    """
    file = checks.path("path", path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{file}: no UTF-8 text") from None
    lines = text.splitlines()
    end = next((k for k, line in enumerate(lines[:LONGEST]) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise ValueError(f"{file}: no line 'endheader', which ends the header of an OpenSim file")
    facts = dict(line.lower().replace(" ", "").split("=", 1) for line in lines[:end] if "=" in line)
    degrees = facts.get("indegrees") == "yes"
    body = "\n".join(line.strip() for line in lines[end + 1 :] if line.strip()) + "\n"
    stream = io.BytesIO(body.encode())
    try:
        layout = layout_of(stream)
        header = [(name.rsplit("/", 2)[-2] if name.endswith("/value") else name, unit) for name, unit in layout.header]
        header = renamed(header, joints or {})
        columns = find_columns(header, coordinates)
        for order, indices in enumerate(columns.orders):
            for i, k in enumerate(indices):
                if degrees and not header[k][1] and (not coordinates or coordinates[i].unit == "rad"):
                    header[k] = (header[k][0], ("deg", "deg/s", "deg/s^2")[order])
        table = read_columns(file, stream, layout, columns.used)
        note = f"an OpenSim file, angles in {'degrees' if degrees else 'radians'}"
        return as_recording(header, columns, table, coordinates, (note,))
    except ValueError as error:
        raise ValueError(f"{file}: after the header: {error}") from None
