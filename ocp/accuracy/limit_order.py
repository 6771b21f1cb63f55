"""The order in which controls and states are at their limits: where it is the same, polishing finds the same arcs."""

from __future__ import annotations

import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.solution.solution import Solution

NEAR = 1e-3  # distance from a limit, relative to the range, within which a mean of an element is at it

Pattern = tuple[tuple[int, ...], ...]  # for every control and state: -1 at its lower limit, 1 at its upper one, else 0


def control_pattern(solution: Solution) -> Pattern:
    """Return for each control, then each state, the order of its lower limit (-1), upper limit (1) and neither (0).

    A single element between two limits contains a switch and does not count.

    Args:
        solution: with its problem.
    """
    problem = solution.problem
    assert problem is not None
    parts = ((problem.system.u, solution.controls.mean(axis=1)), (problem.system.x, solution.states.mean(axis=1)))
    results: list[tuple[int, ...]] = []
    for symbols, means in parts:
        low, high = problem.limits(Where.ALONG, symbols)
        results += [_order(means[:, i], low[i], high[i]) for i in range(means.shape[1])]
    return tuple(results)


def _order(values: Array, low: float, high: float) -> tuple[int, ...]:
    width = high - low if np.isfinite(high - low) else float(np.ptp(values))
    near = NEAR * (width if width > 0.0 else 1.0)
    where = np.where(values <= low + near, -1, np.where(values >= high - near, 1, 0))
    edges = np.flatnonzero(np.diff(where)) + 1
    runs = np.split(where, edges)
    kept = [int(run[0]) for k, run in enumerate(runs) if run[0] or len(run) > 1 or k in (0, len(runs) - 1)]
    return tuple(one for k, one in enumerate(kept) if k == 0 or one != kept[k - 1])
