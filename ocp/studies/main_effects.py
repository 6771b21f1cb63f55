"""Effect of every axis of a study on a result, and neighbouring cases between which the result jumps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.studies.designs import Case
from ocp.studies.table import StudyTable
from ocp.studies.warm_start_tree import neighbours

STEEP = 1.5  # a jump: slope off the mean of its neighbours by more than this times their difference
Slopes = dict[tuple[int, int], tuple[str, float, float]]  # pair -> axis, width, slope
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

    The slope between them differs from the mean of the slopes on both sides by more than 1.5 times what these differ
    from each other; or a single case lies above the curve through its neighbours. A kink, where one optimum becomes
    better than another, is not reported.

    Args:
        table: of a study on a grid.
        result: name of a column.

    Raises:
        TypeError: table is not a StudyTable.
        KeyError: no such column.
        ValueError: a column without numbers.
    """
    y = _numbers(table, result)
    return jump_pairs(table.cases, [float(one) if np.isfinite(one) else None for one in y])


def jump_pairs(cases: Sequence[Case], values: Sequence[float | None]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of neighbours between which a value leaves its trend, as `jumps` does.

    Args:
        cases: of a study.
        values: of the cases; None where there is none.
    """
    slopes: Slopes = {}
    for a, b in neighbours(cases):
        here, there = values[a], values[b]
        if here is None or there is None:
            continue
        name = next(n for n in cases[a] if cases[a][n] != cases[b][n])
        width = float(cases[b][name]) - float(cases[a][name])  # type: ignore[arg-type]
        slopes[a, b] = name, width, (there - here) / width
    ends = {(name, b): slope for (_, b), (name, _, slope) in slopes.items()}
    begins = {(name, a): slope for (a, _), (name, _, slope) in slopes.items()}
    results = []
    for (a, b), (name, width, slope) in slopes.items():
        before, after = ends.get((name, a)), begins.get((name, b))
        if before is None or after is None:
            continue
        away, beside = abs(slope - (before + after) / 2.0) * width, abs(after - before) * width
        if away > STEEP * beside + ROUNDING * abs(float(values[a] or 0.0)):
            results.append((a, b))
    return tuple(dict.fromkeys([*results, *_peaks(slopes, values)]))


def _peaks(pairs: Slopes, values: Sequence[float | None]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of a single case with its neighbours, whose value lies above the curve through four of them."""
    following: dict[tuple[str, int], int] = {}
    before: dict[tuple[str, int], int] = {}
    for (a, b), (name, _, _) in pairs.items():
        following[name, a], before[name, b] = b, a
    for (name, k), right in following.items():
        left = before.get((name, k))
        ends = before.get((name, left)) if left is not None else None, following.get((name, right))
        if left is None or ends[0] is None or ends[1] is None:
            continue
        outer, y0, y1, last, here = (float(values[n] or 0.0) for n in (ends[0], left, right, ends[1], k))
        steps = abs(y1 - y0) + abs(y0 - outer) + abs(last - y1)
        if here - (4.0 * (y0 + y1) - outer - last) / 6.0 > 0.35 * steps + ROUNDING * abs(here):
            yield from ((left, k), (k, right))


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
