"""Picture of the stability suite: what is at risk against the distance to the degeneracy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from picture import FAINT, LIMIT
from stability_case import Finding

LEAST = 1e-18  # where zeros are drawn


def draw(findings: Sequence[Finding], path: Path) -> None:
    """Draw every case that has distances, one panel for each group; dashed where the tolerance is.

    Args:
        findings: of the suite.
        path: of the picture.
    """
    known = [f for f in findings if any(not math.isnan(figure.distance) for figure in f.figures)]
    groups = list(dict.fromkeys(f.case.group for f in known))
    if not groups:
        return
    columns = min(len(groups), 2)
    rows = -(-len(groups) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(7.2 * columns, 4.2 * rows), layout="constrained", squeeze=False)
    for axes in grid.ravel()[len(groups) :]:
        axes.set_visible(False)
    for axes, group in zip(grid.ravel(), groups, strict=False):
        _panel(axes, [f for f in known if f.case.group == group])
        axes.set_title(group)
    part = path.with_name(f"{path.stem}.part.png")
    try:
        figure.savefig(part, dpi=130)
        part.replace(path)
    finally:
        plt.close(figure)
        part.unlink(missing_ok=True)


def _panel(axes: Axes, findings: Sequence[Finding]) -> None:
    colours = plt.get_cmap("tab20")(np.linspace(0.0, 1.0, max(len(findings), 2)))
    for finding, colour in zip(findings, colours, strict=False):
        points = sorted((f.distance, max(abs(f.value), LEAST), f.tolerance) for f in finding.figures
                        if f.distance > 0.0 and math.isfinite(f.value))  # fmt: skip
        if not points:
            continue
        x, y, tolerance = np.array(points).T
        style = ":" if finding.case.outside else "-"
        axes.loglog(x, y, style, marker=".", color=colour, linewidth=1.2, label=f"{finding.case.name}")
        axes.loglog(x, np.maximum(tolerance, LEAST), "--", color=colour, linewidth=0.7, alpha=0.6)
        bad = np.array([not abs(value) <= most for value, most in zip(y, tolerance, strict=True)])
        if bad.any() and not finding.case.outside:
            axes.loglog(x[bad], y[bad], "x", color=LIMIT, markersize=7)
    axes.grid(color=FAINT, alpha=0.3, linewidth=0.6)
    axes.set_xlabel("distance to the degeneracy")
    axes.set_ylabel("figure at risk")
    axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
