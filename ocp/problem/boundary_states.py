"""States at both ends of a motion that satisfy the conditions there."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Where, single_symbols
from ocp.problem.nearby_states import nearby
from ocp.problem.problem import Fixed, Problem

ITERATIONS = 30  # of Gauss-Newton
SATISFIED, FARTHER = 1e-9, 1.2  # residual, and how much farther than the nearest one a state may be that is kept
CLOSE = 1e-12  # largest relative residual of a condition that counts as satisfied


def ends(problem: Problem, values: Sequence[float] | Array) -> tuple[Array, Array, tuple[bool, bool]]:
    """Return states that satisfy the start and end conditions, and whether those conditions determine them uniquely.

    Args:
        problem: one phase.
        values: (np,) of the parameters.
    """
    first, last, fixed = _ends(problem, tuple(map(float, values)))
    return first.copy(), last.copy(), fixed


@functools.lru_cache(maxsize=16)
def _ends(problem: Problem, values: tuple[float, ...]) -> tuple[Array, Array, tuple[bool, bool]]:
    p = ca.DM(list(values))
    low, high = problem.limits(Where.ALONG, problem.system.x)
    still = np.clip(np.zeros(len(low)), low, np.maximum(low, high))
    first, start_fixed = _satisfying(problem, Where.START, still, p)
    if problem.system.t is not None:
        clock, horizon = problem.system.clock, problem.horizon
        still = first.copy()
        still[clock] += horizon.duration if isinstance(horizon, Fixed) else horizon.guess
    else:
        still = first
    last, end_fixed = _satisfying(problem, Where.END, still, p)
    return first, last, (start_fixed, end_fixed)


def _satisfying(problem: Problem, where: Where, x: Array, p: ca.DM) -> tuple[Array, bool]:
    system = problem.system
    wanted = [c for c in problem.subject_to if c.where is where and not ca.depends_on(c.expression, system.u)]
    if not wanted:
        return x, False
    low, high = np.concatenate([c.lower for c in wanted]), np.concatenate([c.upper for c in wanted])
    bounds = [(index, c.lower[k], c.upper[k]) for c in wanted for n, index, k in single_symbols(c, system) if n == 0]
    x = x.copy()
    for index, lower, upper in bounds:
        # Bounds of single states are satisfied first; other expressions may not be defined for other values.
        x[index] = np.clip(x[index], lower, upper)
    if len(bounds) == len({index for index, _, _ in bounds}) == len(low):
        return x, sum(lower == upper for _, lower, upper in bounds) == len(x)
    expression = ca.vertcat(*(c.expression for c in wanted))
    slope = ca.densify(ca.jacobian(expression, system.x))
    function = ca.Function("ends", [system.x, system.p], [expression, slope])
    reached, whole = _by_gauss_newton(function, x, p, (low, high))
    fixed = {index for index, lower, upper in bounds if lower == upper}
    free = ca.vertcat(*(symbol for index, symbol in enumerate(ca.vertsplit(system.x)) if index not in fixed))
    if not ca.depends_on(ca.jacobian(expression, free), free):
        return reached, whole
    # Nonlinear conditions may have other solutions, and undamped steps end anywhere if they are far from satisfied.
    along = problem.limits(Where.ALONG, system.x)
    found = nearby(function, x, p.full().ravel(), (low, high), along)
    if not len(found):
        return reached, False
    near = _first_allowed(problem, found, p)
    value = np.array(function(reached, p)[0]).ravel()
    kept = np.all(np.abs(np.clip(value, low, high) - value) <= SATISFIED * np.maximum(np.abs(value), 1.0))
    within = np.all((reached >= along[0]) & (reached <= along[1]))
    if kept and within and np.linalg.norm(reached - x) <= FARTHER * np.linalg.norm(near - x):
        return _first_allowed(problem, np.stack([reached, near]), p), False
    return _by_gauss_newton(function, near, p, (low, high))[0], False


def _first_allowed(problem: Problem, states: Array, p: ca.DM) -> Array:
    """Return the first of some states (K, nx) that keeps the limits on expressions of the state; the first, if none."""
    system = problem.system
    limits = [c for c in problem.subject_to if c.where is Where.ALONG and not ca.depends_on(c.expression, system.u)]
    if not limits:
        return np.asarray(states[0])
    function = ca.Function("limits", [system.x, system.p], [ca.densify(ca.vertcat(*(c.expression for c in limits)))])
    (values,) = evaluate(function, states, p.full().ravel())
    low, high = (np.concatenate([getattr(c, side) for c in limits]) for side in ("lower", "upper"))
    kept = np.all((values >= low) & (values <= high), axis=1)
    return np.asarray(states[int(np.argmax(kept))])


def _by_gauss_newton(function: ca.Function, x: Array, p: ca.DM, limits: tuple[Array, Array]) -> tuple[Array, bool]:
    """Return the state that undamped steps lead to, and whether the conditions determine it uniquely."""
    low, high = limits
    whole = False
    for _ in range(ITERATIONS):
        value, slope = (np.array(part) for part in function(x, p))
        short = np.clip(value.ravel(), low, high) - value.ravel()
        if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(short))):
            return x, False
        whole = (
            bool(np.linalg.matrix_rank(_equilibrated(slope[low == high])) == len(x)) if np.any(low == high) else False
        )
        if np.all(np.abs(short) <= CLOSE * np.maximum(np.abs(value.ravel()), np.abs(slope) @ np.abs(x))):
            break
        x = x + np.linalg.lstsq(slope, short, rcond=None)[0]
    return x, whole


def _equilibrated(matrix: Array) -> Array:
    """Return a matrix with rows, then columns, divided by their norms, so that its rank does not depend on units."""
    for axis in (1, 0):
        size = np.linalg.norm(matrix, axis=axis, keepdims=True)
        matrix = matrix / np.where(size > 0.0, size, 1.0)
    return matrix
