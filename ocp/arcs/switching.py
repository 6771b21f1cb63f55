"""Switching functions dH/du of the controls along a motion."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.arcs.control_limits import sides_of
from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class SwitchingFunctions:
    """dH/du_i along a motion, H = lambda . f + running, at K points.

    Args:
        values: (K, nu) [cost/s per unit of the control].
        gains: (K, nu) cost per second that the best value of each control alone would save, >= 0.
        shares: (K, nu) values times the range of the control, divided by the scale of the terms of H.
        inside: (K, nu) whether the best value lies between the limits.
    """

    values: Array
    gains: Array
    shares: Array
    inside: Array


def switching_functions(
    problem: Problem, x: Array, u: Array, costates: Array, parameters: Sequence[float] | Array,
    multipliers: Array | None = None,
) -> SwitchingFunctions:  # fmt: skip
    """Return the switching functions along a motion.

    A control minimises H: at its lower limit where dH/du > 0, at its upper one where dH/du < 0. A limit of one control
    and states is a limit of that control where the states are given. Limits that couple several controls are left to
    their multipliers.

    Args:
        problem: one phase.
        x, u, costates: (K, nx), (K, nu), (K, nx).
        parameters: (np,) values.
        multipliers: (K, nu) sum over the active limits of several controls of multiplier times d limit / du, added to
            dH/du.

    Source: Pontryagin et al., The Mathematical Theory of Optimal Processes.
    """
    system = problem.system
    function = _slopes(problem)
    numbers = np.array(parameters, dtype=float)
    p = np.tile(numbers[:, None], len(x))
    result = mapped(function, len(x))(x.T, u.T, p, costates.T)
    values, terms, curvature = np.array(result[0]).T, np.array(result[1]).ravel(), np.array(result[2]).T
    values = values if multipliers is None else values + multipliers
    scale = max(abs(problem.minimise.time), float(np.mean(terms)), 1e-300)
    low, high = sides_of(problem, x, u, numbers)
    largest = np.max(np.abs(u), axis=0, initial=0.0)
    bare_low, bare_high = problem.limits(Where.ALONG, system.u)
    width = np.where(np.isfinite(bare_high - bare_low), bare_high - bare_low, largest)
    least, most = np.where(np.isfinite(low), low, u - largest), np.where(np.isfinite(high), high, u + largest)
    # H is a parabola in each control: its least value is at the vertex or at a bound.
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.where(curvature > 0.0, u - values / curvature, np.where(values > 0.0, least, most))
    step = np.clip(vertex, least, np.maximum(least, most)) - u
    gains = np.maximum(-(values * step + np.maximum(curvature, 0.0) / 2.0 * step**2), 0.0)
    if not _quadratic(problem):
        gains = np.minimum(gains, _decreases(problem, (x, u, p.T, costates), step, multipliers))
    inside = (vertex > least) & (vertex < most) & (curvature > 0.0)
    return SwitchingFunctions(values, gains, values * width / scale, inside)


@functools.lru_cache(maxsize=32)
def _quadratic(problem: Problem) -> bool:
    """Return whether H is a parabola, or a straight line, in every control."""
    H, u = hamiltonian_of(problem), problem.system.u
    return not any(ca.depends_on(H.curvature[i, i], u[i]) for i in range(u.numel()))


def _decreases(
    problem: Problem, point: tuple[Array, Array, Array, Array], step: Array, multipliers: Array | None
) -> Array:
    """Return by how much H itself falls when each control alone makes its step (K, nu), >= 0."""
    x, u, p, costates = point
    function = mapped(_values(problem), len(x))
    before = np.array(function(x.T, u.T, p.T, costates.T)).ravel()
    results = np.zeros_like(u)
    for i in range(u.shape[1]):
        there = u.copy()
        there[:, i] += step[:, i]
        after = np.array(function(x.T, there.T, p.T, costates.T)).ravel()
        added = 0.0 if multipliers is None else multipliers[:, i] * step[:, i]
        results[:, i] = np.maximum(before - after - added, 0.0)
    return results


@functools.lru_cache(maxsize=32)
def _values(problem: Problem) -> ca.Function:
    H = hamiltonian_of(problem)
    return ca.Function("H", list(H.arguments), [ca.densify(H.value)])


@functools.lru_cache(maxsize=32)
def _slopes(problem: Problem) -> ca.Function:
    """Return the function (x, u, p, lambda) -> (dH/du, size of the terms of H, d^2H/du_i^2)."""
    H, u = hamiltonian_of(problem), problem.system.u
    slope = H.slope
    curvature = ca.vertcat(*(ca.jacobian(slope[i], u[i]) for i in range(u.numel())))
    return ca.Function("switching", list(H.arguments), [slope, H.terms, ca.densify(curvature)])
