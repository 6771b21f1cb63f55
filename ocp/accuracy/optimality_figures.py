"""Pontryagin's conditions along a solution as figures: constancy of the Hamiltonian, gain left by the controls."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.accuracy.even_multipliers import Adjoint, even
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Free, Problem
from ocp.solution.cost_scale import scale_of_cost
from ocp.solution.figure import Figure
from ocp.solution.solution import Solution
from ocp.solution.state_scales import LEAST

AT_LIMIT = 1e-9  # relative distance from its limit within which a duration is at it


class Optimality(NamedTuple):
    """Figures of the report that concern optimality."""

    deviation: Figure  # largest, of H from its constant value
    mean: float  # of H
    offset: Figure  # of the mean from the constant value
    gain: Figure  # left by the controls


class _Values(NamedTuple):
    """At K points: H, dH/du (nu, K), the diagonal of d^2H/du^2 (nu, K), the sum of absolute terms of H."""

    value: Array
    slope: Array
    curvature: Array
    terms: Array


def optimality(solution: Solution, problem: Problem) -> Optimality:
    """Evaluate Pontryagin's conditions at the collocation points, where the costates are defined.

    Args:
        solution: with costates.
        problem: that it solves.
    """
    times, x, _, u = solution.samples(solution.scheme.points)
    adjoint = even(solution, problem)
    given = _values(solution, problem, x, u, solution.costates)
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    total = max(weights.sum(), 1e-300)
    mean = float(weights @ given.value[0] / total)
    least = LEAST * scale_of_cost(solution, problem) / total
    scale = max(abs(problem.minimise.time), float(weights @ given.terms[0] / total), least)
    target = -problem.minimise.time if _free_duration(solution, problem) else mean
    far = np.abs(given.value[0] - target)
    index = int(np.argmax(far))
    deviation = Figure(far[index] / scale, "share", "the mean of the terms of H", "H", times[index])
    offset = Figure(abs(mean - target) / scale, "share", "the mean of the terms of H", "mean H")
    return Optimality(deviation, mean, offset, _gain(solution, problem, given, adjoint, weights))


def _values(solution: Solution, problem: Problem, x: Array, u: Array, costates: Array) -> _Values:
    H = hamiltonian_of(problem)
    outputs = [H.value, H.slope, ca.diag(ca.densify(H.curvature)), H.terms]
    function = ca.Function("H", list(H.arguments), outputs).map(len(x))
    parameters = np.tile(solution.parameters[:, None], len(x))
    return _Values(*(np.array(part) for part in function(x.T, u.T, parameters, costates.reshape(len(x), -1).T)))


def _free_duration(solution: Solution, problem: Problem) -> bool:
    """Return whether the duration is strictly between its limits; at a limit H has another constant value."""
    horizon = problem.horizon
    if not isinstance(horizon, Free):
        return False
    above = horizon.lower + AT_LIMIT * max(horizon.lower, horizon.guess) < solution.duration
    return above and solution.duration * (1.0 + AT_LIMIT) < horizon.upper


def _gain(solution: Solution, problem: Problem, given: _Values, adjoint: Adjoint, weights: Array) -> Figure:
    """Return the integral of the decrease of H when every control alone moves to its best value within its limits.

    With redistributed multipliers of state limits in the elements where that gives a smaller bound.
    """
    times, x, _, u = solution.samples(solution.scheme.points)
    if _coupled(problem):
        return Figure(np.nan, "share", "the cost", "undefined")
    gap = _decrease(problem, given, u)
    if adjoint.moved:
        count = len(solution.grid)
        other = _decrease(problem, _values(solution, problem, x, u, adjoint.costates), u)
        before, after = ((weights * one).reshape(count, -1).sum(axis=1) for one in (gap, other))
        better = after + adjoint.slack < before
        gap = np.where(np.repeat(better, len(gap) // count), other, gap)
        slack = float(adjoint.slack[better].sum())
    else:
        slack = 0.0
    worst = times[int(np.argmax(gap))] if gap.size else np.nan
    left = float(weights @ gap + slack)
    return Figure(left / scale_of_cost(solution, problem), "share", "the cost", "controls", worst)


def _decrease(problem: Problem, at: _Values, u: Array) -> Array:
    """Return the decrease of H (K,) at every point, added up over the controls."""
    low, high = problem.limits(Where.ALONG, problem.system.u)
    largest = np.max(np.abs(u), axis=0, initial=0.0)  # a control without limits may move by its largest value
    lower, upper = np.where(np.isfinite(low), low, u - largest), np.where(np.isfinite(high), high, u + largest)
    slope, curvature = at.slope.T, at.curvature.T
    best = np.where(slope > 0.0, lower, upper)
    # A convex Hamiltonian may have its minimum before the limit.
    with np.errstate(divide="ignore", invalid="ignore"):
        to_minimum = np.where(curvature > 0.0, slope / curvature, np.inf)
    step = np.minimum(np.abs(u - best), np.abs(to_minimum))
    decrease = np.abs(slope) * step - np.where(curvature > 0.0, curvature, 0.0) * step**2 / 2.0
    return np.asarray(np.sum(np.where(slope * (u - best) > 0.0, decrease, 0.0), axis=1))


def _coupled(problem: Problem) -> bool:
    """Return whether a constraint depends on controls in another way than as a bound of single ones."""
    u = problem.system.u
    return any(
        ca.depends_on(constraint.expression, u)
        and not all(component.is_symbolic() for component in ca.vertsplit(constraint.expression))
        for constraint in problem.subject_to
    )
