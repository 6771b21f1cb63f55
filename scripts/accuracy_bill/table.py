"""Tables of the accuracy bill in CSV and Markdown; a file appears when it is complete."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path

from accuracy_bill.measurement import Row
from accuracy_bill.pareto_front import Curve, seconds_to
from ocp.numerics.files import written_whole

SECONDS = ("setup", "derivatives", "solver", "total")
SHARES = ("drift", "violation")


def write(path: Path, text: str) -> None:
    """Write a text file; what was there before is replaced only when the new one is complete."""
    with written_whole(path) as part:
        part.write_text(text, encoding="utf-8", newline="")


def as_csv(rows: Sequence[Row], unit: str) -> str:
    """Return all rows with every digit; the header has names and units."""
    text = io.StringIO()
    names = [field.name for field in fields(Row) if field.name != "continuous"]
    units = dict.fromkeys(SECONDS, "s") | dict.fromkeys(SHARES, "share")
    units |= dict.fromkeys(("cost", "error", "estimate"), unit or "1")
    writer = csv.writer(text)
    writer.writerow([f"{name} [{units[name]}]" if name in units else name for name in names])
    for row in rows:
        values = [getattr(row, name) for name in names]
        writer.writerow([repr(value) if isinstance(value, float) else value for value in values])
    return text.getvalue()


def as_markdown(rows: Sequence[Row], quantity: str, unit: str, optimal: Sequence[tuple[str, str]], floor: float) -> str:
    """Return the table for reading; runs on the Pareto front are set in bold.

    Args:
        rows: to show.
        quantity: name of the cost.
        unit: of the cost.
        optimal: (contender, label) of the runs on the front.
        floor: error of the reference; smaller errors cannot be distinguished.
    """
    of = f" [{unit}]" if unit else ""
    head = (
        "contender", "setting", f"{quantity}{of}", f"true error{of}", f"estimated{of}", "re-simulated end", "limits",
        "set-up [s]", "derivatives [s]", "solver [s]", "total [s]", "runs",
    )  # fmt: skip
    lines = [_line(head), "|---|---|" + "---:|" * (len(head) - 2)]
    for row in rows:
        bold = "**" if (row.contender, row.label) in optimal else ""
        figures = [_short(getattr(row, name)) for name in ("error", "estimate", *SHARES)]
        figures[0] = f"< {_short(floor)}" if row.error < floor else figures[0]
        seconds = [_seconds(getattr(row, name)) for name in SECONDS]
        cells = [row.contender, row.label, f"{row.cost:.10g}", *figures, *seconds, str(row.runs)]
        if row.note:
            cells[2:] = [row.note[:60], *[""] * (len(head) - 4), str(row.runs)]
        lines.append(_line([f"{bold}{cell}{bold}" if k in (0, 1, 3, 10) else cell for k, cell in enumerate(cells)]))
    return "\n".join(lines) + "\n"


def to_accuracy(curves: Sequence[Curve], tolerances: Sequence[float], unit: str, absent: Mapping[str, str]) -> str:
    """Return the table of the seconds that every contender needs for each error, or the best error that it reached.

    Args:
        curves: of the contenders.
        tolerances: errors to reach, in `unit`.
        unit: of the error.
        absent: contenders without a run, and why.
    """
    lines = [_line(["contender", *(f"{t:.0e} {unit}".rstrip() for t in tolerances), "most accurate"])]
    lines.append("|---|" + "---:|" * (len(tolerances) + 1))
    for curve in curves:
        if not curve.lasting:
            lines.append(_line([curve.name, *["-"] * len(tolerances), "breaks limits between nodes"]))
            continue
        best = min(curve.lasting, key=lambda p: (p.error, p.seconds))
        cells = [_seconds(seconds_to(curve, t)) for t in tolerances]
        cells = [
            cell if math.isfinite(seconds_to(curve, t)) else "-" for cell, t in zip(cells, tolerances, strict=True)
        ]
        lines.append(_line([curve.name, *cells, f"{best.error:.1e} in {_seconds(best.seconds)} s, {best.label}"]))
    lines += [_line([name, *["-"] * len(tolerances), why]) for name, why in absent.items()]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _short(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else "-"


def _seconds(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.3f}" if value < 1.0 else f"{value:.3g}"
