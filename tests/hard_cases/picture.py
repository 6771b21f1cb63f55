"""Picture of the stability suite: what is at risk against the distance to the degeneracy."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from hard_cases.case import Figure, Finding
from models.plots.style import FAINT, LIMIT, saved
from ocp.checks import Array

LEAST = 1e-18  # where zeros are drawn
COLUMNS = 4


def draw(findings: Sequence[Finding], path: Path) -> None:
    """Draw every case that has distances: cases of one quantity on one way together, the others of a group in a panel.

    Dashed where the tolerance is. Counts of which none may be wrong have no error to draw: they stand in the table.

    Args:
        findings: of the suite.
        path: of the picture.
    """
    curves = [(finding, curve) for finding in findings if len(curve := _curve(finding))]
    common = Counter(_kind(finding) for finding, _ in curves)
    panels: dict[tuple[str, ...], list[tuple[Finding, Array]]] = {}
    for finding, curve in curves:
        whole = _kind(finding)
        panels.setdefault(whole if common[whole] > 1 else whole[:1], []).append((finding, curve))
    if not panels:
        return
    columns = min(len(panels), COLUMNS)
    rows = -(-len(panels) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(4.6 * columns, 3.9 * rows), layout="constrained", squeeze=False)
    for axes in grid.ravel()[len(panels) :]:
        axes.set_visible(False)
    for axes, (kind, members) in zip(grid.ravel(), panels.items(), strict=False):
        quantity, towards = kind[1:] or ("figure at risk", "distance, as the legend says")
        _panel(axes, members, alike=len(kind) > 1)
        axes.set_title(kind[0], fontsize=10)
        axes.set_xlabel(towards, fontsize=8)
        axes.set_ylabel("\n".join(textwrap.wrap(quantity, 44)), fontsize=8)
    saved(figure, path, dpi=110)


def _kind(finding: Finding) -> tuple[str, str, str]:
    return finding.case.group, finding.case.quantity, finding.case.towards


def _curve(finding: Finding) -> Array:
    """Return distance, error and tolerance (K, 3): at each distance the figure that takes most of its tolerance."""
    worst: dict[float, Figure] = {}
    for figure in finding.figures:
        if figure.distance != 0.0 and math.isfinite(figure.distance) and figure.tolerance > 0.0:
            known = worst.get(figure.distance)
            worst[figure.distance] = figure if known is None or figure.share > known.share else known
    return np.array([(d, abs(worst[d].value), worst[d].tolerance) for d in sorted(worst)])


def _panel(axes: Axes, curves: Sequence[tuple[Finding, Array]], alike: bool) -> None:
    sides = any(np.any(curve[:, 0] < 0.0) for _, curve in curves)
    colours = plt.get_cmap("tab10")(np.arange(10))
    for k, (finding, curve) in enumerate(curves):
        x, y, tolerance = curve.T
        colour, style = colours[k % len(colours)], ":" if finding.case.outside else "-"
        # A line that lies below another one stays visible where it is broader.
        broad = 1.2 + 0.7 * (len(curves) - 1 - k)
        name = finding.case.name if alike else f"{finding.case.name}; {finding.case.towards}"
        axes.plot(x, np.maximum(y, LEAST), style, marker=".", color=colour, linewidth=broad, alpha=0.8, label=name)
        axes.plot(x, tolerance, "--", color=colour, linewidth=0.8)
        bad = ~(y <= tolerance)
        if bad.any() and not finding.case.outside:
            axes.plot(x[bad], np.where(np.isfinite(y[bad]), y[bad], tolerance[bad]), "x", color=LIMIT, markersize=8)
    if sides:
        least = min(float(np.min(np.abs(curve[:, 0]))) for _, curve in curves)
        axes.set_xscale("symlog", linthresh=least)
        marks = 10.0 ** np.arange(0, math.log10(least) + 2.0, -4.0)
        axes.set_xticks([*-marks, 0.0, *marks[::-1]])
    else:
        axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(color=FAINT, alpha=0.3, linewidth=0.6)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False)
