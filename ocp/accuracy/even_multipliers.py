"""Costates under state limits: the multiplier of a limit, redistributed evenly over each element."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.accuracy.control_shape import switching_controls
from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.numerics.polynomials import slope_matrix
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.transcription.schemes.scheme import Control

DEPENDENT = 1e-8  # relative singular value below which two limits have the same effect on the switching functions
NEAR = 1e-4  # distance from a limit, relative to its scale, within which it may be active


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Costates after the multipliers of state limits have been redistributed within every element.

    Args:
        costates: (N, d, nx) at the collocation points.
        slack: (N,) complementarity error that this causes on every element: moved multipliers times the distance from
            the limit at the points to which they moved [cost].
        moved: whether the costates differ from those of the solution.
    """

    costates: Array
    slack: Array
    moved: bool


def even(solution: Solution, problem: Problem) -> Adjoint:
    """Return costates with the multipliers of first-order state limits redistributed within every element.

    A limit c(x) <= c_max is of first order if dc/dt depends on u. In an element with a constant control it is active
    at a single collocation point. Its multiplier then makes the costate jump from point to point (a saw-tooth):
    correct on average over the element, but not pointwise, and neither are the switching functions. Any other
    distribution of the multiplier with the same integral,

        lambda + sum_c e_c(t) grad c(x),   integral of e_c over the element = 0,

    gives a bound as well: to first order the cost exceeds the optimum by at most the integral of
    (H(u) - min H) + nu_c (c_max - c), for every lambda and multiplier density nu_c >= 0 that satisfy the adjoint
    equation. Here e_c minimises the mean square of the switching functions, each times the range of its control, on
    every element. By complementarity only the moved part of the multipliers, de_c/dt, contributes to the second
    term. nu_c >= 0 is not enforced; on problems with a known optimum the bound holds (tests/accuracy/test_adjoint.py).

    Costates are returned unchanged for continuous or collocated controls and where H is nonlinear in the controls (by
    more than a small cost on effort): there is no saw-tooth then, and the switching functions measure the error due to
    the shape of the control.

    Args:
        solution: of any status; elements with NaN or infinite values are returned unchanged.
        problem: that it solves.

    Source: R. F. Hartl, S. P. Sethi, R. G. Vickson, A survey of the maximum principles for optimal control problems
        with state constraints, SIAM Review 37 (1995), direct adjoining; D. G. Luenberger, Optimization by Vector Space
        Methods, 1969, 8.6 (duality).
    """
    scheme, (count, d, nx) = solution.scheme, solution.costates.shape
    slack, nu = np.zeros(count), problem.system.u.numel()
    unchanged = Adjoint(solution.costates, slack, False)
    if d < 2 or scheme.control not in (Control.CONSTANT, Control.SEGMENTS):
        return unchanged
    function, low, high = _limits(problem)
    if not len(low):
        return unchanged
    _, x, _, u = solution.samples(scheme.points)
    given = x.T, u.T, np.tile(solution.parameters[:, None], len(x)), solution.costates.reshape(len(x), nx).T
    shapes: tuple[tuple[int, ...], ...] = ((len(low),), (len(low), nx), (nu,), (nu, len(low)))
    values, gradients, slopes, authority = (
        np.array(part).T.reshape(count, d, *shape)
        for part, shape in zip(mapped(function, len(x)).call(given), shapes, strict=True)
    )
    ranges = _control_ranges(problem, u)
    scale = np.where(np.isfinite(high - low), high - low, np.max(np.abs(values), axis=(0, 1)))
    away = np.minimum(high - values, values - low)
    known = [np.all(np.isfinite(part.reshape(count, -1)), axis=1) for part in (values, gradients, slopes, authority)]
    acts = (np.min(away, axis=1) <= NEAR * scale) & np.all(known, axis=0)[:, None]
    root = np.sqrt(np.abs(scheme.weights))
    # Basis of the polynomials through the points with zero mean, and their derivatives.
    free = np.linalg.svd(scheme.weights[None, :])[2][1:].T
    slope = slope_matrix(scheme.points, scheme.points) @ free
    costates = solution.costates.copy()
    for k in np.flatnonzero(acts.any(axis=1)):
        held = np.flatnonzero(acts[k])
        effect = root[:, None, None] * authority[k][:, :, held] * ranges[:, None]
        result = _least_squares(effect, root[:, None] * slopes[k] * ranges, free)
        costates[k] += np.einsum("aj,ij,iax->ix", result, free, gradients[k][:, held])
        slack[k] = np.sum(np.abs(np.einsum("aj,ij,i,ia->a", result, slope, scheme.weights, away[k][:, held])))
    return Adjoint(costates, slack, bool(acts.any()))


def _least_squares(effect: Array, values: Array, free: Array) -> Array:
    """Return the coefficients (a, d - 1) of e_c in the basis `free` that minimise |values + effect e|.

    Args:
        effect: (d, nu, a) derivative of each value with respect to each e_c.
        values: (d, nu) at the points.
        free: (d, d - 1) values of the basis polynomials at the points.
    """
    matrix = np.einsum("iua,ij->iuaj", effect, free)
    scale = np.maximum(np.sqrt(np.sum(matrix**2, axis=(0, 1, 3))), 1e-300)  # each limit has a unit of its own
    matrix = (matrix / scale[:, None]).reshape(values.size, -1)
    result = np.linalg.lstsq(matrix, -values.ravel(), rcond=DEPENDENT)[0]
    return np.asarray(result.reshape(len(scale), -1) / scale[:, None])


def _control_ranges(problem: Problem, u: Array) -> Array:
    """Return the widths (nu,) of the limits of the controls; without limits the largest value in the motion."""
    low, high = problem.limits(Where.ALONG, problem.system.u)
    used = np.max(np.abs(u), axis=0)
    return np.asarray(np.where(np.isfinite(high - low) & (high > low), high - low, np.where(used > 0.0, used, 1.0)))


@functools.lru_cache(maxsize=32)
def _limits(problem: Problem) -> tuple[ca.Function, Array, Array]:
    """Return (x, u, p, lambda) -> c, grad c, dH/du, d(dc/dt)/du of the first-order limits, and their bounds.

    Without limits if H is nonlinear in the controls.
    """
    system, rows = problem.system, []
    H = hamiltonian_of(problem)
    if not switching_controls(problem):
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
