"""Scale of the cost of a motion, with which gains and errors of the cost are compared."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.solution.state_scales import LEAST, control_scales, scales_of_states


def scale_of_cost(solution: Solution, problem: Problem) -> float:
    """Return |cost|, at least 1/1000 of the change of the cost by a change of each state and control by its scale.

    A cost near zero (an exact tracking, a goal that is reached, an effort that is not needed) is no scale: its shares
    would be arbitrary. A constant added to the cost changes nothing above that floor. A problem without cost has the
    scale 1.

    Args:
        solution: with finite states.
        problem: that it solves.
    """
    minimise, system = problem.minimise, problem.system
    change = abs(minimise.time) * solution.duration
    if not (minimise.running.is_zero() and minimise.final.is_zero()):
        points = [0, len(solution.states) // 2, len(solution.states) - 1]
        x = np.vstack([solution.states[points, 0], solution.states[-1:, -1]])
        u = np.vstack([solution.controls[points, 0], solution.controls[-1:, -1]])
        scale = np.append(scales_of_states(solution, problem)[0], control_scales(solution, problem))
        function = ca.Function("cost", [system.x, system.u, system.p], [minimise.running, minimise.final])
        running, final = _changes(function, x, u, solution.parameters, scale)
        change += solution.duration * float(np.max(running)) + float(final[-1])
    cost = abs(solution.cost) if np.isfinite(solution.cost) else 0.0
    return max(cost, LEAST * change) or 1.0


def _changes(function: ca.Function, x: Array, u: Array, parameters: Array, scale: Array) -> tuple[Array, Array]:
    """Return the sums (K,) over all arguments of the larger change of both outputs by plus and minus one scale."""
    points = np.hstack([x, u])
    count, n = points.shape
    steps = np.concatenate([np.zeros((1, n)), np.diag(scale), -np.diag(scale)])
    every = (points[:, None, :] + steps).reshape(-1, n).T
    columns = np.tile(parameters[:, None], every.shape[1])
    values = function.map(every.shape[1])(every[: x.shape[1]], every[x.shape[1] :], columns)
    results = []
    for value in values:
        table = np.array(value).reshape(count, 2 * n + 1)
        change = np.nan_to_num(np.abs(table[:, 1:] - table[:, :1]), posinf=0.0)
        results.append(np.sum(np.maximum(change[:, :n], change[:, n:]), axis=1))
    return results[0], results[1]
