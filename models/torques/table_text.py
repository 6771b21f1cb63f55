"""Torque tables as text files: columns with names and units, for programs and for spreadsheets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.torques.torque_table import TorqueTable
from ocp.checks import Array

ROWS = 50_000  # written at once
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class TextFormat:
    """Separator and decimal mark of a text table."""

    separator: str = ","
    decimal: str = "."


PROGRAMS = TextFormat()
# What spreadsheets of a country expect.
SPREADSHEETS = {"en": TextFormat(), **dict.fromkeys(("de", "fr", "it", "es", "pl", "cz"), TextFormat(";", ","))}


def columns_of(table: TorqueTable, tool: bool = False) -> tuple[list[str], list[Array]]:
    """Return headings with units and columns (K, m): t, q, v, a, tau, the parts of tau, then what else there is.

    That is: uncertainties of a motion from noisy samples, and quantities of drives and motor shafts.

    Args:
        table: of a motion.
        tool: whether the position of the tool is among the columns.
    """
    coordinates = table.machine.coordinates
    header, columns = list(table.header), [table.rows]

    def add(words: list[str], values: Array) -> None:
        header.extend(words)
        columns.append(values)

    for name, part in table.split.items():
        add([f"{name} of tau_{c.name} [{c.force_unit}]" for c in coordinates], part)
    if table.uncertainty is not None:
        add([f"uncertainty of tau_{c.name} [{c.force_unit}]" for c in coordinates], table.uncertainty)
    if tool:
        add([f"tool_{axis} [m]" for axis in "xyz"], table.tool)
    try:
        drives, shaft = table.drives, table.shaft
    except ValueError:
        return header, columns
    for name, part in drives.items():
        if name in ("motor_q", "motor_v") or (name == "motor_tau" and np.array_equal(part, table.tau)):
            continue
        unit = {"current": "A", "voltage": "V", "copper_loss": "W"}.get(name)
        add([f"{name}_{c.name} [{unit or c.force_unit}]" for c in coordinates], part)
    if shaft is not None:
        add([f"shaft_torque_{c.name} [N m]" for c in coordinates], shaft.torque)
        add([f"shaft_speed_{c.name} [1/min]" for c in coordinates], shaft.rpm)
        add([f"shaft_power_{c.name} [W]" for c in coordinates], shaft.power)
    return header, columns


def write_table(
    path: Path, header: list[str], columns: list[Array], style: TextFormat = PROGRAMS, shown: Progress | None = None
) -> None:
    """Write columns under a header.

    Args:
        path: of the file.
        header: one heading for each column.
        columns: arrays (K, m).
        style: separator and decimal mark.
        shown: called with the rows written and their total number, or None.
    """
    count, line = len(columns[0]), style.separator.join(["%.15g"] * len(header)) + "\n"
    with path.open("w", encoding="utf-8-sig" if style.decimal == "," else "utf-8", newline="") as file:
        file.write(style.separator.join(header) + "\n")
        for start in range(0, count, ROWS):
            rows = np.hstack([column[start : start + ROWS] for column in columns])
            text = (line * len(rows)) % tuple(rows.ravel().tolist())
            file.write(text.replace(".", style.decimal) if style.decimal != "." else text)
            if shown is not None:
                shown(min(start + ROWS, count), count)
