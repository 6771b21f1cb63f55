"""Work-precision diagrams: error against seconds, both logarithmic, the Pareto front marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from accuracy_bill.pareto_front import Curve, Point, front
from models.plots.style import saved

MARKERS = "osD^v<>pPX*hd"
Half = tuple[Sequence[Curve], float, str, str, str]  # the arguments of `diagram` after the axes
FRONT, FAINT, BAND = "#9aa5b1", "#e5e8eb", "#f1f3f5"


def diagram(axes: Axes, curves: Sequence[Curve], floor: float, heading: str, error: str, spent: str) -> None:
    """Draw one work-precision diagram; points that break limits are hollow and not on the front.

    Args:
        axes: to draw on.
        curves: of the contenders; points with an error or seconds of 0 or not finite are left out.
        floor: error of the reference, below which nothing can be distinguished; drawn as a band.
        heading: above the diagram.
        error: label of the error axis, with its unit.
        spent: label of the axis of seconds.
    """
    shown = [(curve, [p for p in curve.points if _drawable(p)]) for curve in curves]
    colours = plt.get_cmap("tab10")
    best = front([point for _, points in shown for point in points])
    if best:
        axes.plot(
            [p.error for p in best], [p.seconds for p in best], "-", color=FRONT, linewidth=6.0, alpha=0.55,
            solid_capstyle="round", zorder=1, label="Pareto front",
        )  # fmt: skip
    for k, (curve, points) in enumerate(shown):
        colour, marker = colours(k % 10), MARKERS[k % len(MARKERS)]
        errors, seconds = [p.error for p in points], [p.seconds for p in points]
        axes.plot(errors, seconds, "-", color=colour, linewidth=1.1, zorder=3)
        for valid in (True, False):
            some = [(p.error, p.seconds) for p in points if p.valid is valid]
            if some:
                axes.plot(
                    *zip(*some, strict=True), marker, color=colour, markersize=4.5, zorder=4,
                    markerfacecolor=colour if valid else "white",
                    label=curve.name if valid else f"{curve.name}: breaks limits",
                )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel=error, ylabel=spent)
    axes.set_title(heading, fontsize=10)
    axes.grid(visible=True, which="major", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    low, high = axes.get_xlim()
    if low < floor < high:
        axes.axvspan(low, floor, color=BAND, zorder=0, label="error of the reference")
    axes.set_xlim(high, low)  # more accurate to the right
    axes.legend(fontsize=7, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2)


def write(path: Path, halves: Sequence[Half], title: str) -> None:
    """Draw one diagram for each half beside each other; the file appears when it is complete."""
    figure, panels = plt.subplots(1, len(halves), figsize=(6.2 * len(halves), 6.6), squeeze=False, layout="constrained")
    for axes, half in zip(panels[0], halves, strict=True):
        diagram(axes, *half)
    figure.suptitle(title, fontsize=11)
    saved(figure, path)


def _drawable(point: Point) -> bool:
    return bool(np.isfinite(point.error) and np.isfinite(point.seconds) and point.error > 0.0 and point.seconds > 0.0)
