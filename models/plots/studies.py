"""Pictures of studies: lines over one axis, contours over two, small multiples over more, and what matters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from models.plots.study_panels import View, contour, numeric
from models.plots.style import ACCENT, FAINT, LIMIT, MOTION, File, saved
from ocp import StudyTable
from ocp.studies.main_effects import influences
from ocp.studies.neighbour_check import unchecked_jumps


def study(
    table: StudyTable, result: str = "duration", units: Mapping[str, str] | None = None, path: File | None = None
) -> Figure:
    """Draw results of a study: lines over one axis, contours over two, small multiples over three, else points.

    Args:
        table: with at least one solved case, and an axis of numbers that varies.
        result: column that is drawn first.
        units: of columns, by name.
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.

    Raises:
        ValueError: no case is solved, or no axis of numbers varies.
        OSError: the file cannot be written.
    """
    names = numeric(table)
    if not names or not table.ok.any():
        raise ValueError("study: nothing to draw, expected a solved case and an axis of numbers that varies")
    return saved(_kind(table)[1](View(table, result, units or {}), names), path)


def draw(
    table: StudyTable, result: str, stem: Path, units: Mapping[str, str], formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the pictures of a study: its results, and what its result depends on.

    Args:
        table: with at least one solved case.
        result: column that is drawn first.
        stem: of the files, to which what they show is added.
        units: of columns, by name.
        formats: suffixes of the files, such as png, svg, pdf.

    Returns:
        The pictures written.
    """
    names, view, made = numeric(table), View(table, result, units), []
    for suffix in formats:
        if names:
            made.append(stem.with_name(f"{stem.name}_{_kind(table)[0]}.{suffix}"))
            study(table, result, units, made[-1])
        if table.ok.sum() > len(names) > 0:
            made.append(stem.with_name(f"{stem.name}_ranking.{suffix}"))
            saved(ranking(view), made[-1])
    return made


def _kind(table: StudyTable) -> tuple[str, Callable[[View, Sequence[str]], Figure]]:
    """Return what suits the axes of a study, and the function that draws it."""
    kinds = {
        1: ("lines", lambda view, names: lines(view, names[0])), 2: ("contours", contours), 3: ("multiples", multiples)
    }  # fmt: skip
    names = numeric(table)
    return kinds[len(names)] if len(names) in kinds and is_grid(table, names) else ("scatter", scatter)


def lines(view: View, axis: str) -> Figure:
    """Return the picture of results over one axis; gaps where cases failed."""
    table, result = view.table, view.result
    shown = view.shown()
    figure, panels = _panels(len(shown))
    x = table[axis]
    order = np.argsort(x)
    groups = _groups(table, [axis])
    for axes, name in zip(panels, shown, strict=True):
        for label, members in groups.items():
            own = order[members[order]]
            y = np.where(table.ok[own], table[name][own], np.nan)
            axes.plot(x[own], y, "-", color=MOTION if len(groups) == 1 else None, linewidth=1.4, label=label)
            axes.plot(x[own], y, ".", color=MOTION if len(groups) == 1 else axes.lines[-1].get_color(), markersize=5)
            _slopes(axes, table, axis, name, own)
        _failed(axes, table, x, None)
        axes.set_xlabel(view.label(axis))
        axes.set_ylabel(view.label(name))
        axes.grid(color=FAINT, alpha=0.3, linewidth=0.6)
    if len(groups) > 1:
        panels[0].legend(fontsize=8, frameon=False)
    _mark_jumps(panels[0], table, [axis], result)
    return figure


def contours(view: View, names: Sequence[str]) -> Figure:
    """Return the picture of results over two axes, with the cases and how each was found."""
    shown = view.shown()
    figure, panels = _panels(len(shown))
    for k, (axes, name) in enumerate(zip(panels, shown, strict=True)):
        filled = contour(axes, view, np.ones(len(view.table), dtype=bool), names, name, marked=k == 0)
        if filled is not None:
            figure.colorbar(filled, ax=axes).set_label(view.label(name), fontsize=9)
    _mark_jumps(panels[0], view.table, names, view.result)
    _legend(figure)
    return figure


def multiples(view: View, names: Sequence[str]) -> Figure:
    """Return contours over the two axes with most values, one panel for each value of the third."""
    table, result = view.table, view.result
    counts = {name: len(np.unique(table[name])) for name in names}
    third = min(names, key=lambda name: counts[name])
    first, second = (name for name in names if name != third)
    values = np.unique(table[third])
    figure, panels = _panels(len(values))
    solved = table[result][table.ok]
    levels = np.asarray(MaxNLocator(13).tick_values(np.nanmin(solved), np.nanmax(solved)))
    shared = None
    for axes, value in zip(panels, values, strict=True):
        filled = contour(axes, view, table[third] == value, (first, second), result, marked=True, levels=levels)
        shared = filled if filled is not None else shared
        unit = view.units.get(third, "")
        axes.set_title(f"{third} = {value:g} {unit}".rstrip(), fontsize=9)
    if shared is not None:
        figure.colorbar(shared, ax=panels).set_label(view.label(result), fontsize=9)
    _legend(figure)
    return figure


def scatter(view: View, names: Sequence[str]) -> Figure:
    """Return the result over every axis, for cases that lie on no grid."""
    table, result = view.table, view.result
    figure, panels = _panels(len(names))
    for axes, name in zip(panels, names, strict=True):
        axes.plot(table[name][table.ok], table[result][table.ok], ".", color=MOTION, markersize=5)
        _failed(axes, table, table[name], None)
        axes.set_xlabel(view.label(name))
        axes.set_ylabel(view.label(result))
        axes.grid(color=FAINT, alpha=0.3, linewidth=0.6)
    return figure


def ranking(view: View) -> Figure:
    """Return bars of elasticities and main effects, the strongest on top.

    Raises:
        ValueError: too few solved cases.
    """
    rows = influences(view.table, view.result)[::-1]
    figure, panels = plt.subplots(1, 2, figsize=(9.0, 1.4 + 0.45 * len(rows)), layout="constrained", sharey=True)
    columns = (
        (panels[0], [row.elasticity for row in rows], "elasticity [% per %]"),
        (panels[1], [row.effect for row in rows], f"main effect on {view.label(view.result)}"),
    )
    for axes, values, label in columns:
        bars = axes.barh([row.axis for row in rows], values, color=[LIMIT if v > 0.0 else MOTION for v in values])
        axes.bar_label(bars, fmt="%+.3g", padding=3, fontsize=8)
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.margins(x=0.3)
        axes.set_xlabel(label)
    return figure


def _legend(figure: Figure) -> None:
    """Explain the marks of all panels once, above them."""
    known = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if known:
        figure.legend(
            known.values(), known.keys(), loc="outside upper left", ncols=len(known), fontsize=8, frameon=False
        )


def _mark_jumps(axes: Axes, table: StudyTable, names: Sequence[str], result: str) -> None:
    """Mark neighbours that may lie in different local optima and were not compared with each other."""
    for a, b in unchecked_jumps(table.cases, table.records):
        points = [[table.cases[k][name] for k in (a, b)] for name in names]
        values = table[result][[a, b]]
        axes.plot(*points, *([values] if len(names) == 1 else []), "-", color=LIMIT, linewidth=2.5)


def _slopes(axes: Axes, table: StudyTable, axis: str, name: str, own: np.ndarray) -> None:
    """Draw derivatives at the optimum as short tangents, where the study has them."""
    column = f"d {name} / d {axis}"
    if column not in table.columns or len(own) < 2:
        return
    x, y, slope = table[axis][own], table[name][own], table[column][own]
    reach = 0.3 * np.min(np.diff(np.sort(x)))
    for x0, y0, s in zip(x, y, slope, strict=True):
        axes.plot([x0 - reach, x0 + reach], [y0 - s * reach, y0 + s * reach], color=ACCENT, linewidth=2.0, zorder=4)


def _failed(axes: Axes, table: StudyTable, x: np.ndarray, y: np.ndarray | None) -> None:
    """Mark failed cases on the lower edge."""
    bad = ~table.ok
    if bad.any():
        axes.plot(x[bad], np.zeros(bad.sum()), "x", color=LIMIT, transform=axes.get_xaxis_transform(), clip_on=False)


def is_grid(table: StudyTable, names: Sequence[str]) -> bool:
    """Whether the cases stand on a grid: few values on every axis."""
    counts = [len(np.unique(table[name])) for name in names]
    return len(names) == 1 or int(np.prod(counts)) <= len(table)


def _groups(table: StudyTable, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the cases that share everything but the drawn axes."""
    others = [name for name in table.axes if name not in names and len({repr(c[name]) for c in table.cases}) > 1]
    labels = np.array([", ".join(f"{name} {case[name]}" for name in others) for case in table.cases])
    return {label: labels == label for label in dict.fromkeys(labels.tolist())}


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = 2 if count == 4 else min(count, 3)
    rows = -(-count // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(4.6 * columns, 3.6 * rows), layout="constrained", squeeze=False)
    for axes in grid.ravel()[count:]:
        axes.set_visible(False)
    return figure, list(grid.ravel()[:count])
