"""Report of an accuracy bill: error against seconds for every contender, the recommendation, all runs."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from accuracy_bill.pareto_front import Curve, front

from html_reports import page

Half = tuple[Sequence[Curve], float, str, str, str]  # curves, error of the reference, heading, labels of the axes
HEADING = re.compile(r"^#+ ")


def write_accuracy_report(path: Path, title: str, halves: Sequence[Half], text: str) -> None:
    """Write the report of a bill.

    Args:
        path: of the page (.html).
        title: of the scene.
        halves: of the picture: simulation, optimal control.
        text: of the bill in Markdown: headings, sentences and tables.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    figures = [
        page.section(half[2], page.figure(_diagram(*half), f"bill-{k}", "Ringed: the Pareto front. Shaded: below the "
                                          "error of the reference.")) for k, half in enumerate(halves)
    ]  # fmt: skip
    advice = next((line for line in text.split("\n\n") if "cheapest" in line or "ecommend" in line), "")
    page.write(
        path, f"What accuracy costs: {title}", [page.verdict(advice, True) if advice else "", *figures, _prose(text)]
    )


def _diagram(curves: Sequence[Curve], floor: float, heading: str, error: str, spent: str) -> Any:
    go = page.plotly()
    drawing = go.Figure()
    best = front([point for curve in curves for point in curve.points])
    for curve in curves:
        points = [p for p in curve.points if p.error > 0.0 and p.seconds > 0.0 and np.isfinite(p.error * p.seconds)]
        rings = [2 if point in best else 0 for point in points]
        drawing.add_trace(go.Scatter(
            x=[p.seconds for p in points], y=[p.error for p in points], text=[p.label for p in points], name=curve.name,
            mode="lines+markers", marker={"size": 9, "line": {"width": rings, "color": "black"}},
            hovertemplate=f"{html.escape(curve.name)}, %{{text}}<br>error %{{y:.2e}}, %{{x:.3g}} s<extra></extra>",
        ))  # fmt: skip
    if floor > 0.0:
        drawing.add_hrect(y0=floor * 1e-3, y1=floor, fillcolor="#9aa5b1", opacity=0.25, line_width=0)
    drawing.update_xaxes(type="log", title_text=spent)
    drawing.update_yaxes(type="log", title_text=error, exponentformat="power")
    return drawing.update_layout(height=520, margin={"l": 70, "r": 10, "t": 10, "b": 50})


def _prose(text: str) -> str:
    """Return Markdown of headings, paragraphs and tables, as the bill writes it, in HTML."""
    parts = []
    for block in text.split("\n\n"):
        lines = block.strip().splitlines()
        if not lines:
            continue
        if lines[0].startswith("#"):
            parts.append(f"<h2>{html.escape(HEADING.sub('', lines[0]))}</h2>" if lines[0].startswith("##") else "")
        elif lines[0].startswith("|"):
            cells = [[c.strip().replace("**", "") for c in line.strip("|").split("|")] for line in lines]
            parts.append(page.table(cells[0], cells[2:]))
        else:
            parts.append(page.paragraph(" ".join(lines)))
    return "\n".join(parts)
