"""Cost that a motion saves by exceeding limits of states between the nodes, from the multipliers of the limits."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.transcription.element_points import path_rows

SAMPLES = 25  # points of every element


def cost_of_violations(solution: Solution, problem: Problem) -> tuple[Array, float]:
    """Return the cost of limits exceeded between the nodes, of every element (N,), and the complementarity error.

    The largest excess in an element times the multipliers of the limit there, or in a neighbour if they are larger.

    Args:
        solution: without multipliers nothing is known, and both are zero.
        problem: that it solves.
    """
    if solution.multipliers is None:
        return np.zeros(len(solution.grid)), 0.0
    cost, left = _of_bounds(solution, problem, solution.multipliers.x)
    return cost + _of_expressions(solution, problem, solution.multipliers.path), left


def _of_bounds(solution: Solution, problem: Problem, multipliers: Array) -> tuple[Array, float]:
    count = len(solution.grid)
    cost, left = np.zeros(count), 0.0
    low, high = problem.limits(Where.ALONG, problem.system.x)
    if not (np.isfinite(low).any() or np.isfinite(high).any()):
        return cost, left
    _, x, _, _ = solution.samples(np.linspace(0.0, 1.0, SAMPLES))
    inside = x.reshape(count, -1, len(low))
    for excess, sign in ((inside - high, 1.0), (low - inside, -1.0)):
        # At the ends of the motion these multipliers belong to boundary values as well, which are bounds of the same
        # unknowns.
        load = np.maximum(sign * multipliers, 0.0)
        load[0, 0], load[-1, -1] = 0.0, 0.0
        away = np.abs(solution.states - (high if sign > 0.0 else low))
        left += float(np.sum((load * np.where(np.isfinite(away), away, 0.0))[:, 1:]))
        cost += np.sum(_largest(excess) * _nearby(load.sum(axis=1)), axis=1)
    return cost, left


def _of_expressions(solution: Solution, problem: Problem, multipliers: Array) -> Array:
    """Return the same for limits on expressions of states, such as obstacles."""
    system, count = problem.system, len(solution.grid)
    cost, rows = np.zeros(count), path_rows(problem, solution.scheme)
    if not rows or sum(number for _, _, number in rows) != multipliers.shape[1]:
        return cost
    first = np.cumsum([0, *(number for _, _, number in rows)])
    _, x, _, u = solution.samples(np.linspace(0.0, 1.0, SAMPLES))
    parameters = np.tile(solution.parameters[:, None], len(x))
    for (i, c, number), start in zip(rows, first[:-1], strict=True):
        constraint = problem.subject_to[i]
        expression = constraint.expression[c]
        if ca.depends_on(expression, system.u):
            continue  # the minimum of H over the controls contains these limits
        function = ca.Function("limit", [system.x, system.u, system.p], [ca.densify(expression)]).map(len(x))
        values = np.array(function(x.T, u.T, parameters)).reshape(count, -1, 1)
        own = multipliers[:, start : start + number]
        for excess, sign in ((values - constraint.upper[c], 1.0), (constraint.lower[c] - values, -1.0)):
            load = np.sum(np.maximum(sign * own, 0.0), axis=1, keepdims=True)
            cost += np.sum(_largest(excess) * _nearby(load), axis=1)
    return cost


def _largest(excess: Array) -> Array:
    """Return the largest positive excess (N, n) of values (N, s, n)."""
    return np.asarray(np.max(np.maximum(np.nan_to_num(excess, neginf=0.0), 0.0), axis=1))


def _nearby(load: Array) -> Array:
    """Return the largest multiplier (N, n) of every element and its two neighbours."""
    return np.asarray(np.maximum(load, np.maximum(np.roll(load, 1, axis=0), np.roll(load, -1, axis=0))))
