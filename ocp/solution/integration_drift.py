"""Drift: how far the state integrated with the controls found leaves the state found."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.checks import Array
from ocp.numerics.polynomials import integration_matrix
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.system import slopes

MORE = 3  # Gauss points of the re-integration beyond the degree of the scheme


def drift(solution: Solution, problem: Problem) -> Array:
    """Return the distance (N + 1, nx) of the motion integrated from x(0) from the one found, at the ends of elements.

    To first order, e_k+1 = Phi_k e_k + (phi_k(x_k) - x_k+1), as `estimate` has it; signed, unit of the state.

    Args:
        solution: of positive duration.
        problem: that it solves.

    Raises:
        LinAlgError: an element is so long that the equations of its re-integration are singular.
    """
    local, transition, _ = _propagated(solution, problem)
    return _accumulated(local, transition)


def _accumulated(local: Array, transition: Array) -> Array:
    away = np.zeros((len(local) + 1, local.shape[1]))
    for k, (error, carried) in enumerate(zip(local, transition, strict=True)):
        away[k + 1] = carried @ away[k] + error
    return away


def _propagated(solution: Solution, problem: Problem) -> tuple[Array, Array, Array]:
    """Return phi_k(x_k) - x_k+1 (N, nx), its derivative by x_k (N, nx, nx), and both at m points (N, m, nx, 1 + nx)."""
    system, scheme = problem.system, solution.scheme
    count, nx = len(solution.grid), solution.states.shape[2]
    nodes, weights = polynomials.leggauss(scheme.degree + MORE)
    tau, weights = (nodes + 1.0) / 2.0, weights / 2.0
    m = len(tau)
    _, x, rate, u = solution.samples(tau)
    f, slope, _ = slopes(system).map(len(x))(x.T, u.T, np.tile(solution.parameters[:, None], len(x)))
    h = solution.duration * solution.grid.widths
    missed = (np.array(f).T - rate).reshape(count, m, nx)
    A = np.array(slope).reshape(nx, count, m, nx).transpose(1, 2, 0, 3)  # by element, point
    # delta_i = delta_0 + h sum_j a_ij (A_j delta_j + missed_j), once for delta_0 = 0 and once for each unit vector.
    a = integration_matrix(tau)
    system_matrix = np.eye(m * nx) - h[:, None, None] * np.einsum("ij,kjab->kiajb", a, A).reshape(count, m * nx, m * nx)
    forced = (h[:, None, None] * np.einsum("ij,kja->kia", a, missed)).reshape(count, m * nx, 1)
    starts = np.broadcast_to(np.tile(np.eye(nx), (m, 1)), (count, m * nx, nx))
    delta = np.linalg.solve(system_matrix, np.concatenate([forced, starts], axis=2)).reshape(count, m, nx, 1 + nx)
    grown = np.einsum("kjab,kjbc->kjac", A, delta)
    grown[..., 0] += missed
    end = h[:, None, None] * np.einsum("j,kjac->kac", weights, grown)
    return end[..., 0], np.eye(nx) + end[..., 1:], delta
