"""Picture of the stability suite: one line for each case, coloured by how much of its tolerance it takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize

from hard_cases.case import Finding
from models.plots.style import FAINT, LIMIT, saved

LEAST = -6.0  # power of ten of the smallest share of a tolerance that has a colour of its own
ROW = 0.155  # height of a line [inches]
WIDTH = 8.2  # of a page [inches]
SHOWN = (1e-17, 1e14)  # distances; a case that goes on to overflow is cut off
LABEL = 62  # characters of the name of a case


def draw(findings: Sequence[Finding], path: Path) -> None:
    """Draw every case that has distances as a line of squares over the distance from its degeneracy.

    The colour is the share that the figure takes of its tolerance; crosses are figures beyond it, of cases outside of
    the declared domain too. Counts of which none may be wrong have no distance: they stand in the table.

    Args:
        findings: of the suite.
        path: of the picture.
    """
    rows: list[tuple[str, Finding | None]] = []
    for group in dict.fromkeys(finding.case.group for finding in findings):
        own = [finding for finding in findings if finding.case.group == group and _points(finding)]
        rows += [(group, None), *((_name(finding), finding) for finding in own)] if own else []
    if not rows:
        return
    figure, axes = plt.subplots(figsize=(WIDTH, 1.0 + ROW * len(rows)), layout="constrained")
    scale, drawn = Normalize(LEAST, 0.0), None
    for k, (_, finding) in enumerate(rows):
        if finding is None:
            axes.axhline(k, color=FAINT, linewidth=0.4)
            continue
        points = _points(finding)
        distance, share = np.array(points).T
        powers = np.clip(np.log10(np.maximum(share, 10.0**LEAST)), LEAST, 0.0)
        at = np.full(len(points), k)
        drawn = axes.scatter(distance, at, c=powers, norm=scale, cmap="viridis", s=11, marker="s")
        beyond = share > 1.0
        axes.plot(distance[beyond], np.full(beyond.sum(), k), "x", color=LIMIT, markersize=4)
    axes.set_xscale("log")
    axes.set_xlim(*SHOWN)
    axes.set_ylim(len(rows) - 0.3, -0.8)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=6.5)
    for label, (_, finding) in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_fontweight("bold" if finding is None else "normal")
        label.set_color(FAINT if finding is not None and finding.case.outside else "black")
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=7, labeltop=True, top=True)
    axes.set_xlabel("distance from the degeneracy, as named behind each case", fontsize=8)
    axes.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.5)
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.5, aspect=40, pad=0.01)
        words = "power of ten of figure / tolerance (0: all of it; cross: beyond; grey names: outside the domain)"
        bar.set_label(words, fontsize=7)
        bar.ax.tick_params(labelsize=7)
    saved(figure, path, dpi=150)


def _points(finding: Finding) -> list[tuple[float, float]]:
    """Return the absolute distances that are not zero, each with the largest share of its tolerance there."""
    worst: dict[float, float] = {}
    for figure in finding.figures:
        distance = abs(figure.distance)
        if math.isfinite(distance) and distance > 0.0:
            share = figure.share if math.isfinite(figure.share) else math.inf
            worst[distance] = max(share, worst.get(distance, 0.0))
    return sorted((distance, min(share, 1e300)) for distance, share in worst.items())


def _name(finding: Finding) -> str:
    case = finding.case
    text = f"{case.name} ({case.towards})" if case.towards else case.name
    return text if len(text) <= LABEL else f"{text[: LABEL - 4]} ..."
