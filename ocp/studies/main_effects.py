"""Effect of every axis of a study on a result, and neighbouring cases between which the result jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.studies.table import StudyTable
from ocp.studies.warm_start_tree import neighbours

STEEP = 5.0  # a jump: slope off the mean of its neighbours by more than this times their difference
ROUNDING = 1e-4  # smallest jump, relative to the result


@dataclass(frozen=True)
class Influence:
    """Effect of one axis on a result, from all solved cases.

    Args:
        axis: name.
        slope: d result / d value, by a plane through all cases (least squares).
        elasticity: slope times mean value over mean result: percent for one percent.
        effect: largest minus smallest mean of the result over the values of the axis (main effect); for scattered
            cases slope times range.
        share: of the variance that the plane explains, by this axis.
    """

    axis: str
    slope: float
    elasticity: float
    effect: float
    share: float


def influences(table: StudyTable, result: str = "duration") -> tuple[Influence, ...]:
    """Return how a result depends on every axis of numbers, the strongest main effect first.

    Args:
        table: of a study.
        result: name of a column.

    Raises:
        TypeError: table is not a StudyTable.
        KeyError: no such column.
        ValueError: a column without numbers, fewer solved cases than axes of numbers, or no such axis.

    Source: main effects and regression on standardised inputs: A. Saltelli et al., Global Sensitivity Analysis, 2008.
    """
    y = _numbers(table, result)
    names = [name for name in table.axes if table[name].dtype.kind in "if" and len(np.unique(table[name])) > 1]
    known = table.ok & np.isfinite(y)
    if not names or known.sum() <= len(names):
        raise ValueError(
            f"influences: {int(known.sum())} solved cases and {len(names)} axes of numbers, "
            "expected at least one axis, and more cases than axes"
        )
    x, y = np.array([table[name][known] for name in names], dtype=float).T, y[known]
    plane = np.column_stack([np.ones(len(y)), x - x.mean(axis=0)])
    slopes = np.linalg.lstsq(plane, y, rcond=None)[0][1:]
    explained = (slopes * x.std(axis=0)) ** 2
    total = max(float(explained.sum()), 1e-300)
    results = [
        Influence(
            name, float(slope), float(slope * column.mean() / y.mean()) if y.mean() else float("nan"),
            _main_effect(column, y, float(slope)), float(part) / total,
        )
        for name, slope, column, part in zip(names, slopes, x.T, explained, strict=True)
    ]  # fmt: skip
    return tuple(sorted(results, key=lambda one: -abs(one.effect)))


def jumps(table: StudyTable, result: str = "cost") -> tuple[tuple[int, int], ...]:
    """Return the pairs of neighbours between which a result leaves its trend; they may lie in different local optima.

    The slope between them differs from the mean of the slopes on both sides by more than five times what these differ
    from each other. A kink, where one optimum becomes better than another, is not reported.

    Args:
        table: of a study on a grid.
        result: name of a column.

    Raises:
        TypeError: table is not a StudyTable.
        KeyError: no such column.
        ValueError: a column without numbers.
    """
    y = _numbers(table, result)
    pairs = [(a, b) for a, b in neighbours(table.cases) if np.isfinite(y[a]) and np.isfinite(y[b])]
    slopes = {}
    for a, b in pairs:
        name = next(n for n in table.axes if table.cases[a][n] != table.cases[b][n])
        width = float(table.cases[b][name]) - float(table.cases[a][name])  # type: ignore[arg-type]
        slopes[a, b] = name, width, float(y[b] - y[a]) / width
    ends = {(name, b): slope for (_, b), (name, _, slope) in slopes.items()}
    begins = {(name, a): slope for (a, _), (name, _, slope) in slopes.items()}
    results = []
    for (a, b), (name, width, slope) in slopes.items():
        before, after = ends.get((name, a)), begins.get((name, b))
        if before is None or after is None:
            continue
        away, beside = abs(slope - (before + after) / 2.0) * width, abs(after - before) * width
        if away > STEEP * beside + ROUNDING * abs(float(y[a])):
            results.append((a, b))
    return tuple(results)


def _numbers(table: StudyTable, result: str) -> Array:
    checks.instance("table", table, StudyTable, "the table of a study, study.run()")
    checks.text("result", result, "the name of a column")
    column = table[result]
    if column.dtype.kind not in "fiu":
        numeric = ", ".join(table.results) or "none"
        raise checks.refused("result", result, f"a column of numbers, such as {numeric}")
    return column


def _main_effect(column: Array, y: Array, slope: float) -> float:
    levels = np.unique(column)
    if len(levels) > len(column) / 2:
        return slope * float(np.ptp(column))
    means = [float(y[column == level].mean()) for level in levels]
    return (max(means) - min(means)) * (1.0 if means[-1] >= means[0] else -1.0)
