"""Costates between the collocation points, one degree higher than their interpolant, from the adjoint equation."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.checks import Array
from ocp.numerics.polynomials import lagrange_matrix
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.transcription.schemes.scheme import Control

FITS = 0.1  # distance from the costates at the points, relative to their range in the element


def costates_between(solution: Solution, problem: Problem, tau: Array) -> Array:
    """Return costates (N, s, nx) at points tau of every element.

    lambda' = -dH/dx at the d collocation points gives a polynomial of degree d, whose constant is that of the least
    mean distance from the costates at the points. Where it passes by them, as where a limit of states presses on the
    motion, and for schemes that do not need it, the interpolant of degree d - 1 is returned.

    A polynomial control and the interpolated costate of degree d - 1 satisfy dH/du = 0 at the same points, so that
    their distance from each other between the points is not that of the control from its optimum. The cost that this
    hides is of order 2 d: that of the error itself for Gauss-Legendre schemes, of higher order for the others.

    Args:
        solution: with costates.
        problem: that it solves.
        tau: (s,) points in [0, 1].
    """
    scheme = solution.scheme
    simple = np.einsum("sd,kda->ksa", scheme.costate_at(tau), solution.costates)
    if scheme.control is not Control.COLLOCATED or scheme.order < 2 * scheme.degree:
        return np.asarray(simple)
    count, d, nx = solution.costates.shape
    _, x, _, u = solution.samples(scheme.points)
    H = hamiltonian_of(problem)
    slope = ca.Function("slope", list(H.arguments), [ca.densify(ca.gradient(H.value, H.arguments[0]))]).map(len(x))
    parameters = np.tile(solution.parameters[:, None], len(x))
    values = slope(x.T, u.T, parameters, solution.costates.reshape(len(x), nx).T)
    rates = -values.full().T.reshape(count, d, nx) * (solution.duration * solution.grid.widths)[:, None, None]
    at_points, at_tau = (np.einsum("sd,kda->ksa", _integrals(scheme.points, t), rates) for t in (scheme.points, tau))
    constant = np.einsum("d,kda->ka", scheme.weights, solution.costates - at_points)[:, None, :]
    missed = np.max(np.abs(at_points + constant - solution.costates), axis=1)
    largest = np.max(np.abs(solution.costates), axis=(0, 1))
    fits = missed <= FITS * np.ptp(rates, axis=1) + FITS * np.max(np.abs(rates), axis=1) + 1e-12 * largest
    whole = np.all(fits & np.isfinite(missed), axis=1)
    return np.asarray(np.where(whole[:, None, None], at_tau + constant, simple))


def _integrals(points: Array, tau: Array) -> Array:
    """Return the matrix (s, d) of integrals from 0 to tau of the Lagrange polynomials through points (d,)."""
    nodes, weights = polynomials.leggauss(len(points))
    inside = tau[:, None] * (nodes + 1.0) / 2.0
    values = lagrange_matrix(points, inside.ravel()).reshape(len(tau), len(nodes), len(points))
    return np.asarray(np.einsum("s,q,sqd->sd", tau, weights / 2.0, values))
