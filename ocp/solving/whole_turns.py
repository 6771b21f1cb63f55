"""Controls that are angles: which ones are; whole turns between neighbouring collocation points are removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import probes
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.transcription.schemes.scheme import Control

TURN = 2.0 * np.pi
SAME = 1e-10  # difference, relative to the largest value, that is rounding
POINTS = 50  # of the motion at which the equations are compared, at most


def without_whole_turns(solution: Solution) -> Solution:
    """Return the same motion with controls that do not jump by whole turns from one collocation point to the next.

    A direction of thrust enters the equations by sine and cosine only. The NLP then determines it up to a multiple of
    2 pi at every collocation point by itself, and the polynomial through values that differ by whole turns is not the
    control of the motion. Values at the points, cost and multipliers of the NLP are the same for all of them.

    Controls are left alone where they have a limit, where they do not jump, where the equations do not have the period
    2 pi in them, and where they are piecewise linear, as the equations then depend on the values between the points.

    Args:
        solution: of any status.
    """
    problem, shape = solution.problem, solution.scheme.control
    known = solution.controls.size > 0 and bool(np.all(np.isfinite(solution.controls)))
    if problem is None or shape is Control.LINEAR or not known:
        return solution
    values = solution.controls.reshape(-1, solution.controls.shape[2])
    jumps = np.any(np.abs(np.diff(values, axis=0)) > np.pi, axis=0)
    if not jumps.any():
        return solution
    _, x, _, u = solution.samples(solution.scheme.points)
    chosen = np.unique(np.linspace(0, len(x) - 1, min(POINTS, len(x))).astype(int))
    free = np.flatnonzero(jumps & _without_limits(problem)).tolist()
    angles = [i for i in free if _is_periodic(problem, x[chosen], u[chosen], solution.parameters, i)]
    if not angles:
        return solution
    values = values.copy()
    values[:, angles] = np.unwrap(values[:, angles], axis=0)
    return replace(solution, controls=values.reshape(solution.controls.shape))


def angles_without_limits(problem: Problem, values: Sequence[float]) -> list[int]:
    """Return the indices of the controls without limits in which the equations have the period 2 pi.

    Args:
        problem: one phase.
        values: of the parameters.
    """
    system = problem.system
    free = _without_limits(problem)
    if not free.any():
        return []
    curved = np.array(ca.which_depends(_equations(problem), system.u, 2, False), dtype=bool)
    nx, nu = system.x.numel(), system.u.numel()
    points = probes((3, nx + nu), 0.3, 0.9)
    p = np.array(values, dtype=float)
    return [
        i for i in np.flatnonzero(free & curved).tolist() if _is_periodic(problem, points[:, :nx], points[:, nx:], p, i)
    ]


def _without_limits(problem: Problem) -> Array:
    low, high = problem.limits(Where.ALONG, problem.system.u)
    return np.asarray(np.isinf(low) & np.isinf(high))


def _equations(problem: Problem) -> ca.SX:
    """Return rates, running cost and all constrained expressions in a column."""
    constrained = [c.expression for c in problem.subject_to]
    return ca.densify(ca.vertcat(problem.system.rate, problem.minimise.running, *constrained))


def _is_periodic(problem: Problem, x: Array, u: Array, p: Array, i: int) -> bool:
    """Return whether rates, cost and limits are the same with control i one turn further, at K states and controls."""
    system = problem.system
    function = ca.Function("equations", [system.x, system.u, system.p], [_equations(problem)])
    further = u.copy()
    further[:, i] += TURN
    parameters = np.tile(p[:, None], len(x))
    here, there = (_values(function, x, one, parameters) for one in (u, further))
    scale = np.max(np.abs(here), axis=1, keepdims=True)
    return bool(np.all(np.abs(there - here) <= SAME * scale + 1e-300))


def _values(function: ca.Function, x: Array, u: Array, parameters: Array) -> Array:
    return np.asarray(function.map(len(x))(x.T, u.T, parameters).full())
