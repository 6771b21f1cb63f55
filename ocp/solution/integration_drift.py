"""Drift: distance between the state of a solution and the state integrated with its controls."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.numerics.polynomials import integration_matrix
from ocp.numerics.rate_functions import slopes
from ocp.problem.problem import Free, Problem
from ocp.solution.solution import Solution

MORE = 3  # the re-integration uses this many Gauss points more than the degree of the scheme


def drift(solution: Solution, problem: Problem, more: int = MORE) -> Array:
    """Return the integrated minus the stored state (N + 1, nx) at the ends of the elements, to first order.

    e_k+1 = Phi_k e_k + (phi_k(x_k) - x_k+1), with phi_k the motion over element k and Phi_k its derivative.

    Args:
        solution: of positive duration.
        problem: that it solves.
        more: Gauss points of the re-integration beyond the degree of the scheme.

    Raises:
        LinAlgError: an element is so long that the equations of its re-integration are singular.
    """
    local, transition, _ = propagated(solution, problem, more)
    return accumulated(local, transition)


SHORT = 1e-6  # duration relative to its guess below which a motion is suspected to be none
GROSS = 1e-2  # drift relative to the range of a state above which the equations of motion are not satisfied


def collapsed(solution: Solution) -> bool:
    """Return whether a free duration has shrunk to nothing though start and goal differ.

    With unbounded states an NLP can satisfy its scaled equations by a duration of zero and infinite rates. The states
    integrated with the controls stay at the start then.

    Args:
        solution: of any status.
    """
    problem = solution.problem
    if problem is None or not isinstance(problem.horizon, Free) or not np.all(np.isfinite(solution.data)):
        return False
    if not 0.0 < solution.duration < SHORT * problem.horizon.guess:
        return False
    with np.errstate(all="ignore"):
        try:
            away = np.abs(drift(solution, problem))
        except np.linalg.LinAlgError:
            return True
    width = np.ptp(solution.states, axis=(0, 1))
    return not bool(np.all(away <= GROSS * np.where(width > 0.0, width, np.inf)))


def accumulated(local: Array, transition: Array) -> Array:
    """Return the drift (N + 1, nx) that local errors (N, nx) add up to with transition matrices (N, nx, nx)."""
    away = np.zeros((len(local) + 1, local.shape[1]))
    for k, (error, carried) in enumerate(zip(local, transition, strict=True)):
        away[k + 1] = carried @ away[k] + error
    return away


def propagated(solution: Solution, problem: Problem, more: int = MORE) -> tuple[Array, Array, Array]:
    """Integrate every element from its own start by one Newton step of a Gauss collocation of higher order.

    Args:
        solution: of positive duration.
        problem: that it solves.
        more: Gauss points beyond the degree of the scheme.

    Returns:
        phi_k(x_k) - x_k+1 (N, nx), d phi_k/dx_k (N, nx, nx), and both at the Gauss points (N, m, nx, 1 + nx).
    """
    system, scheme = problem.system, solution.scheme
    count, nx = len(solution.grid), solution.states.shape[2]
    tau, weights, a = _gauss(scheme.degree + more)
    m = len(tau)
    _, x, rate, u = solution.samples(tau)
    f, slope, _ = evaluate(slopes(system), x, u, solution.parameters)
    h = solution.duration * solution.grid.widths
    missed = (f - rate).reshape(count, m, nx)
    A = slope.reshape(count, m, nx, nx).transpose(0, 1, 3, 2)  # by element, point, row
    # delta_i = delta_0 + h sum_j a_ij (A_j delta_j + missed_j), once for delta_0 = 0 and once for each unit vector.
    system_matrix = np.eye(m * nx) - h[:, None, None] * np.einsum("ij,kjab->kiajb", a, A).reshape(count, m * nx, m * nx)
    forced = (h[:, None, None] * np.einsum("ij,kja->kia", a, missed)).reshape(count, m * nx, 1)
    starts = np.broadcast_to(np.tile(np.eye(nx), (m, 1)), (count, m * nx, nx))
    delta = np.linalg.solve(system_matrix, np.concatenate([forced, starts], axis=2)).reshape(count, m, nx, 1 + nx)
    grown = A @ delta
    grown[..., 0] += missed
    end = h[:, None, None] * np.einsum("j,kjac->kac", weights, grown)
    return end[..., 0], np.eye(nx) + end[..., 1:], delta


@functools.lru_cache(maxsize=16)
def _gauss(points: int) -> tuple[Array, Array, Array]:
    """Return points (m,), weights (m,) and integration matrix (m, m) of Gauss quadrature on [0, 1]."""
    nodes, weights = polynomials.leggauss(points)
    tau = (nodes + 1.0) / 2.0
    return tau, weights / 2.0, integration_matrix(tau)
