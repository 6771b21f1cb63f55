"""Costates where limits of states act: what a limit pushes, spread over the element on which it acts."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.numerics.polynomials import slope_matrix
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.transcription.schemes.scheme import Control

NEAR = 1e-4  # share of its size within which a limit may act


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Costates of a motion whose limits push evenly, and what that leaves.

    Args:
        costates: (N, d, nx) at the collocation points.
        slack: (N,) multipliers moved to places where the motion keeps a distance from its limit, times that distance,
            of every element [cost].
        moved: whether the costates are other ones than those of the motion.
    """

    costates: Array
    slack: Array
    moved: bool


def even(solution: Solution, problem: Problem) -> Adjoint:
    """Return costates for which limits of first order, c(x) <= c_max with dc/dt that depends on u, push evenly.

    An NLP holds a limit at single points. In an element with a constant control it binds at one of them, and its
    multiplier makes lambda a saw there: right in the mean, wrong by what the limit pushes in between, and so are the
    switching functions. Any other distribution of the multiplier,

        lambda + sum_c e_c(t) grad c(x),   integral of e_c over the element = 0,

    certifies as well: to first order the cost lies above the optimum by at most the integral of
    (H(u) - min H) + mu_c (c_max - c), for every lambda and mu_c >= 0 that the adjoint equation connects. Here e_c
    makes the switching functions least on every element, in the mean square of what they are worth over the ranges of
    the controls; by complementarity only the moved part of the multipliers, de_c/dt, has a slack to pay. That mu_c
    stays positive is not enforced; on problems with a known optimum the bound holds (tests/test_adjoint.py).

    With a control that is linear or collocated on an element, or a Hamiltonian that is curved in it, the costates stay
    as they are: there the multipliers are no saw, and their switching functions tell what the shape of the control
    costs.

    Args:
        solution: of any status; elements with numbers that are none are left alone.
        problem: that it solves.

    Source: R. F. Hartl, S. P. Sethi, R. G. Vickson, A survey of the maximum principles for optimal control problems
        with state constraints, SIAM Review 37 (1995), direct adjoining; D. G. Luenberger, Optimization by Vector Space
        Methods, 1969, 8.6 (duality).
    """
    scheme, (count, d, nx) = solution.scheme, solution.costates.shape
    slack, nu = np.zeros(count), problem.system.u.numel()
    as_it_is = Adjoint(solution.costates, slack, False)
    if d < 2 or scheme.control is not Control.CONSTANT:
        return as_it_is
    function, low, high = _limits(problem)
    if not len(low):
        return as_it_is
    _, x, _, u = solution.samples(scheme.points)
    given = x.T, u.T, np.tile(solution.parameters[:, None], len(x)), solution.costates.reshape(len(x), nx).T
    shapes: tuple[tuple[int, ...], ...] = ((len(low),), (len(low), nx), (nu,), (nu, len(low)))
    values, gradients, slopes, authority = (
        np.array(part).T.reshape(count, d, *shape)
        for part, shape in zip(mapped(function, len(x)).call(given), shapes, strict=True)
    )
    reach = _reach(problem, u)
    size = np.where(np.isfinite(high - low), high - low, np.max(np.abs(values), axis=(0, 1)))
    away = np.minimum(high - values, values - low)
    known = [np.all(np.isfinite(part.reshape(count, -1)), axis=1) for part in (values, gradients, slopes, authority)]
    acts = (np.min(away, axis=1) <= NEAR * size) & np.all(known, axis=0)[:, None]
    root = np.sqrt(np.abs(scheme.weights))
    # Polynomials through the points without a mean, and their slopes.
    free = np.linalg.svd(scheme.weights[None, :])[2][1:].T
    slope = slope_matrix(scheme.points, scheme.points) @ free
    costates = solution.costates.copy()
    for k in np.flatnonzero(acts.any(axis=1)):
        held = np.flatnonzero(acts[k])
        pushed = root[:, None, None] * authority[k][:, :, held] * reach[:, None]
        result = _least(pushed, root[:, None] * slopes[k] * reach, free)
        costates[k] += np.einsum("aj,ij,iax->ix", result, free, gradients[k][:, held])
        slack[k] = np.sum(np.abs(np.einsum("aj,ij,i,ia->a", result, slope, scheme.weights, away[k][:, held])))
    return Adjoint(costates, slack, bool(acts.any()))


def _least(pushed: Array, values: Array, free: Array) -> Array:
    """Return the coefficients (a, d - 1) of e_c in `free` that make values + pushed e least.

    Args:
        pushed: (d, nu, a) by which each e_c changes each value.
        values: (d, nu) at the points.
        free: (d, d - 1) values of polynomials at the points.
    """
    matrix = np.einsum("iua,ij->iuaj", pushed, free)
    size = np.maximum(np.sqrt(np.sum(matrix**2, axis=(0, 1, 3))), 1e-300)  # each limit has a unit of its own
    matrix = (matrix / size[:, None]).reshape(values.size, -1)
    result = np.linalg.lstsq(matrix, -values.ravel(), rcond=None)[0]
    return np.asarray(result.reshape(len(size), -1) / size[:, None])


def _reach(problem: Problem, u: Array) -> Array:
    """Return the ranges (nu,) of the controls; what the motion uses where there is none."""
    low, high = problem.limits(Where.ALONG, problem.system.u)
    used = np.max(np.abs(u), axis=0)
    return np.asarray(np.where(np.isfinite(high - low) & (high > low), high - low, np.where(used > 0.0, used, 1.0)))


@functools.lru_cache(maxsize=32)
def _limits(problem: Problem) -> tuple[ca.Function, Array, Array]:
    """Return (x, u, p, lambda) -> c, grad c, dH/du, d(dc/dt)/du of the limits of first order, and both their sides.

    None where H is curved in the controls.
    """
    system, rows = problem.system, []
    H = hamiltonian_of(problem)
    if not H.curvature.is_zero():
        return ca.Function(), np.zeros(0), np.zeros(0)
    for constraint in problem.subject_to:
        if constraint.where is not Where.ALONG:
            continue
        for c, expression in enumerate(ca.vertsplit(constraint.expression)):
            of_states = not ca.depends_on(expression, system.u) and ca.depends_on(expression, system.x)
            finite = np.isfinite(constraint.lower[c]) or np.isfinite(constraint.upper[c])
            if of_states and finite and ca.depends_on(ca.jtimes(expression, system.x, system.rate), system.u):
                rows.append((expression, constraint.lower[c], constraint.upper[c]))
    limits = ca.vertcat(*(row[0] for row in rows)) if rows else ca.SX(0, 1)
    gradients = ca.jacobian(limits, system.x)
    authority = ca.jacobian(ca.mtimes(gradients, system.rate), system.u)
    outputs = [limits, ca.vec(gradients.T), H.slope, ca.vec(authority)]
    function = ca.Function("limits", list(H.arguments), ca.cse([ca.densify(one) for one in outputs]))
    return function, np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
