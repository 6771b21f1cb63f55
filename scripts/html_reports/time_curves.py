"""Curves over time as a Plotly figure: limits dashed, active limits shaded, one cursor of time for all panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from html_reports.page import plotly
from ocp.checks import Array

ACTIVE = 1e-3  # share of the range within which a limit counts as active
HIGH, LOW, TOUCH = "#e69f00", "#56b4e9", "#b03a2e"
LINES = ("#1f4e79", "#d55e00", "#009e73", "#cc79a7", "#0072b2", "#e69f00", "#56b4e9", "#8c6d1f", "#6b6bb0", "#7d6b5d")
HEIGHT = 150  # of a panel with its label [pixels]
TALL = 0.76  # share of it that is the panel


@dataclass(frozen=True, eq=False)
class Panel:
    """What is drawn in one panel."""

    label: str  # name and unit
    t: Array  # (K,)
    lines: dict[str, Array]  # name -> values (K,)
    lower: Array | None = None  # (K,) limits; -inf, inf for none
    upper: Array | None = None
    heading: str = ""
    spans: Sequence[tuple[float, float, str]] = field(default=())  # start, end, colour of shaded times


def colour_of(number: int) -> str:
    """Return the colour of a line of a panel; the first one is that of the motion."""
    return LINES[number if number < len(LINES) else 1 + (number - 1) % (len(LINES) - 1)]


def time_curves(columns: Sequence[Sequence[Panel]]) -> Any:
    """Return a figure with a column of panels for each sequence; panels of one column share their axis of time.

    Args:
        columns: panels from top to bottom.
    """
    go = plotly()
    drawing = go.Figure()
    rows, gap, shapes = max(map(len, columns)), 0.07, []
    width = (1.0 - gap * (len(columns) - 1)) / len(columns)
    number = 0
    for c, panels in enumerate(columns):
        x = f"x{c + 1 if c else ''}"
        left = c * (width + gap)
        first = number + 1
        for r, panel in enumerate(panels):
            number += 1
            y = f"y{number if number > 1 else ''}"
            top = 1.0 - r / rows
            drawing.update_layout({f"yaxis{y[1:]}": {
                "domain": [top - TALL / rows, top], "anchor": x, "nticks": 5, "zeroline": False, "exponentformat": "e",
            }})  # fmt: skip
            drawing.add_annotation(
                text=panel.label, x=left, y=top, xref="paper", yref="paper", showarrow=False, xanchor="left",
                yanchor="bottom", font={"size": 12},
            )  # fmt: skip
            _traces(drawing, panel, x, y, number)
            shapes += [_rectangle(x, y, *span) for span in [*panel.spans, *_active(panel)]]
            if panel.heading:
                drawing.add_annotation(
                    text=panel.heading, x=left + width / 2, y=top, xref="paper", yref="paper",
                    showarrow=False, yanchor="bottom", yshift=16, font={"size": 13, "weight": 600},
                )  # fmt: skip
        bottom = f"y{number if number > 1 else ''}"
        drawing.update_layout({f"xaxis{x[1:]}": {
            "domain": [left, left + width], "anchor": bottom, "title": "t [s]", "showspikes": True,
            "spikemode": "across", "spikethickness": 1, "matches": "x" if c else None,
        }})  # fmt: skip
        start = float(panels[0].t[0])
        low = 1.0 - (number - first + TALL) / rows
        shapes.append({"type": "line", "name": "cursor", "xref": x, "yref": "paper", "x0": start, "x1": start,
                       "y0": low, "y1": 1.0, "line": {"color": "black", "width": 1.2}})  # fmt: skip
    drawing.update_layout(
        height=HEIGHT * rows + 140, margin={"l": 60, "r": 10, "t": 80, "b": 40}, showlegend=False,
        hovermode="x unified", hoversubplots="axis", shapes=shapes, plot_bgcolor="white",
    )  # fmt: skip
    drawing.update_xaxes(gridcolor="#e5e8eb")
    drawing.update_yaxes(gridcolor="#e5e8eb")
    return drawing


def _traces(drawing: Any, panel: Panel, x: str, y: str, number: int) -> None:
    go = plotly()
    name, _, unit = panel.label.partition(" [")
    shown = f"%{{y:.5g}} {unit.rstrip(']')}".rstrip()
    for k, (line, values) in enumerate(panel.lines.items()):
        drawing.add_trace(go.Scatter(
            x=np.round(panel.t, 7).tolist(), y=_digits(values), xaxis=x, yaxis=y, mode="lines", name=line or name,
            hovertemplate=f"{line or name} {shown}<extra></extra>",
            line={"width": 2 if k == 0 else 1.2, "color": colour_of(k)},
        ))  # fmt: skip
    low, high = (float(f(np.concatenate(list(panel.lines.values())))) for f in (np.nanmin, np.nanmax))
    near = 1.5 * max(high - low, 1e-12)
    for side in (panel.lower, panel.upper):
        if side is None:
            continue
        inside = np.where((side > low - near) & (side < high + near), side, np.nan)
        if np.isfinite(inside).any():
            drawing.add_trace(go.Scatter(
                x=np.round(panel.t, 7).tolist(), y=_digits(inside), xaxis=x, yaxis=y, mode="lines", hoverinfo="skip",
                name="limit", line={"dash": "dash", "width": 1.2, "color": TOUCH},
            ))  # fmt: skip


def _active(panel: Panel) -> list[tuple[float, float, str]]:
    """Return the times at which the first line is at one of its limits."""
    if panel.lower is None or panel.upper is None or panel.spans:
        return []
    values = next(iter(panel.lines.values()))
    gap = panel.upper - panel.lower
    near = ACTIVE * np.where(np.isfinite(gap), gap, np.maximum(np.abs(values), 1e-300))
    sides = ((values <= panel.lower + near, LOW), (values >= panel.upper - near, HIGH))
    return [(a, b, colour) for active, colour in sides for a, b in intervals(panel.t, active)]


def intervals(t: Array, active: Array) -> list[tuple[float, float]]:
    """Return the times (start, end) of the runs in which a truth value holds.

    Args:
        t: (K,) times.
        active: (K,) truth values.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    return [(float(t[a]), float(t[b - 1])) for a, b in edges.reshape(-1, 2) if t[b - 1] > t[a]]


def _rectangle(x: str, y: str, start: float, end: float, colour: str) -> dict[str, Any]:
    return {"type": "rect", "xref": x, "yref": f"{y} domain", "x0": start, "x1": end, "y0": 0, "y1": 1,
            "fillcolor": colour, "opacity": 0.25, "line": {"width": 0}, "layer": "below"}  # fmt: skip


def _digits(values: Array) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]
