"""Panels of the pictures of studies: which results are drawn, and contours over two axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet

from models.plots.style import ACCENT, LIMIT, pretty
from ocp import StudyTable

MOST = 6  # panels of results
SKIPPED = ("iterations", "cost")
PAD = 0.04  # share of an axis beside its first and last case
EDGE = 0.1  # share of a picture at its edges in which no isoline is labelled
FOLLOWS = 0.999  # correlation with an axis beyond which a result is not worth a panel, such as a peak at its limit


@dataclass(frozen=True, eq=False)
class View:
    """A table, the result that is drawn first, and the units of its columns."""

    table: StudyTable
    result: str
    units: Mapping[str, str]

    def label(self, name: str) -> str:
        """Return a column with its unit."""
        shown = f"{name} [{self.units[name]}]" if self.units.get(name) else name
        kind, _, rest = shown.partition(" ")
        return f"{kind} {pretty(rest)}" if kind in ("peak", "rms") else shown

    def shown(self) -> list[str]:
        """Return the results to draw: the chosen one, then those that vary, and not only with one axis."""
        table = self.table
        rest = [name for name in table.results if name != self.result and name not in SKIPPED]
        axes = [table[name][table.ok] for name in numeric(table)]
        results = [self.result]
        for name in sorted((n for n in rest if not n.startswith("d ")), key=lambda n: n.startswith(("rms", "peak"))):
            y = table[name][table.ok]
            varies = np.ptp(y) > 1e-3 * np.max(np.abs(y))
            if varies and not any(len(axes) > 1 and abs(np.corrcoef(x, y)[0, 1]) > FOLLOWS for x in axes):
                results.append(name)
        return results[:MOST]


def contour(
    axes: Axes, view: View, members: np.ndarray, names: Sequence[str], result: str, marked: bool,
    levels: np.ndarray | int = 12,
) -> ContourSet | None:  # fmt: skip
    """Draw filled contours with isolines; cases that failed leave a hole. Returns what a colour bar needs, if any."""
    table = view.table
    x, y = (np.unique(table[name]) for name in names)
    z = np.full((len(y), len(x)), np.nan)
    own = members & table.ok
    z[np.searchsorted(y, table[names[1]][own]), np.searchsorted(x, table[names[0]][own])] = table[result][own]
    filled = None
    axes.set_xlim(_padded(x))
    axes.set_ylim(_padded(y))
    if np.isfinite(z).sum() >= 4 and np.nanmax(z) > np.nanmin(z):
        filled = axes.contourf(x, y, np.ma.masked_invalid(z), levels=levels, cmap="viridis")
        isolines = axes.contour(x, y, np.ma.masked_invalid(z), levels=filled.levels, colors="white", linewidths=0.5)
        _label(axes, isolines, np.column_stack([table[name][members] for name in names]))
    if marked:
        _cases(axes, table, members, names)
    axes.set_xlabel(view.label(names[0]))
    axes.set_ylabel(view.label(names[1]))
    return filled


def _padded(values: np.ndarray) -> tuple[float, float]:
    """Return limits of an axis that leave room for marks at its ends."""
    pad = PAD * float(np.ptp(values))
    return float(values[0]) - pad, float(values[-1]) + pad


def _label(axes: Axes, isolines: ContourSet, cases: np.ndarray) -> None:
    """Label every second isoline, inside of the picture and as far from the cases (K, 2) as it goes."""
    low, high = cases.min(axis=0), cases.max(axis=0)
    marks = (cases - low) / (high - low)
    for level, path in zip(np.asarray(isolines.levels)[1:-1:2], isolines.get_paths()[1:-1:2], strict=True):
        points = (path.vertices - low) / (high - low)
        inner = points[np.all((points > EDGE) & (points < 1.0 - EDGE), axis=1)]
        if len(inner):
            free = np.min(np.linalg.norm(inner[:, None] - marks[None], axis=2), axis=1)
            x, y = low + inner[int(np.argmax(free))] * (high - low)
            axes.clabel(isolines, [level], fontsize=7, fmt="%.4g", manual=[(float(x), float(y))])


def _cases(axes: Axes, table: StudyTable, members: np.ndarray, names: Sequence[str]) -> None:
    """Mark the cases by how they were found."""
    ways = np.array([way.partition(",")[0] for way in table["way"]])
    styles = {"cold": ("s", ACCENT), "warm": ("o", "white"), "carried": (".", "black")}
    for way, (marker, colour) in styles.items():
        own = members & table.ok & (ways == way)
        if own.any():
            points = table[names[0]][own], table[names[1]][own]
            edge: dict[str, Any] = {"markeredgecolor": "black", "markeredgewidth": 0.4, "zorder": 5}
            axes.plot(*points, marker, color=colour, markersize=3.5, linestyle="", label=way, **edge)
    bad = members & ~table.ok
    if bad.any():
        axes.plot(table[names[0]][bad], table[names[1]][bad], "x", color=LIMIT, markersize=6, label="failed")


def numeric(table: StudyTable) -> list[str]:
    """Return the axes that hold numbers and vary."""
    return [name for name in table.axes if table[name].dtype.kind in "if" and len(np.unique(table[name])) > 1]
