"""The Hamiltonian along a motion and its least value over the controls that the limits allow."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where, simple
from ocp.problem.hamiltonian import Hamiltonian, hamiltonian_of
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution

ROUNDS = 12  # of Newton's method, and of the minimisation of each of its quadratic models
BARRIER_ROUNDS = 40  # of the interior-point method
TO_BOUNDARY = 0.99  # largest share of the step to the nearest limit
FLAT = 1e-12  # curvature below this share of slope over range counts as zero


@dataclass(frozen=True, eq=False)
class Minimum:
    """The Hamiltonian at K points of a motion, with the control of the motion and with the best control."""

    value: Array  # (K,) H(x, u, lambda) [cost/s]
    least: Array  # (K,) min over the allowed u
    scale: Array  # (K,) sum of the absolute values of the terms of H
    control: Array  # (K, nu) minimiser


def minimise(solution: Solution, problem: Problem, tau: Array, costates: Array | None = None) -> Minimum:
    """Return H = lambda . f + running along the motion and its minimum over the allowed controls.

    If the controls have simple bounds only: Newton's method, each quadratic model minimised coordinate by coordinate;
    exact in one round for H linear or diagonally quadratic in u. With limits on expressions of the controls: a
    primal-dual interior-point method for all points at once. A control without limits may leave the interval that it
    has in the motion by the width of that interval.

    Args:
        solution: with costates.
        problem: that it solves.
        tau: (s,) points in [0, 1] of every element.
        costates: (N, s, nx) there; None for those of the solution.

    Source: Pontryagin et al., The Mathematical Theory of Optimal Processes; Nocedal, Wright, Numerical Optimization,
        19.3.
    """
    _, x, _, u = solution.samples(tau)
    if costates is None:
        costates = np.einsum("sd,kda->ksa", solution.scheme.costate_at(tau), solution.costates)
    p = solution.parameters
    fixed = (x.T, np.tile(p[:, None], len(x)), costates.reshape(x.shape).T)
    low, high = _box(problem, solution)
    value, scale = (np.array(part)[0] for part in _values(problem, len(x))(u.T, *fixed))
    limits = _mixed(problem)
    if u.shape[1] == 0:
        return Minimum(value, value, scale, u)
    model = _model(problem, limits, len(x))
    if limits:
        lower, upper = (
            np.array([getattr(problem.subject_to[i], side)[c] for i, c in limits]) for side in ("lower", "upper")
        )
        best = _interior(model, fixed, u, low, high, lower, upper)
    else:
        best = _newton(model, fixed, u, low, high)
    return Minimum(value, np.array(model(best.T, *fixed)[0])[0], scale, best)


def _mixed(problem: Problem) -> list[tuple[int, int]]:
    """Return (constraint, component) of the limits on expressions of the controls that are more than bounds."""
    u = problem.system.u
    return [
        (i, c)
        for i, constraint in enumerate(problem.subject_to)
        if constraint.where is Where.ALONG
        for c in range(constraint.expression.numel())
        if ca.depends_on(constraint.expression[c], u) and c not in {one for _, one in simple(constraint, u)}
    ]


def _box(problem: Problem, solution: Solution) -> tuple[Array, Array]:
    low, high = problem.limits(Where.ALONG, problem.system.u)
    used = solution.controls.reshape(-1, len(low))
    least, most = np.min(used, axis=0, initial=0.0), np.max(used, axis=0, initial=0.0)
    width = np.maximum(most - least, 1e-300)
    return np.where(np.isfinite(low), low, least - width), np.where(np.isfinite(high), high, most + width)


def _symbols(problem: Problem) -> tuple[Hamiltonian, list[ca.SX]]:
    H = hamiltonian_of(problem)
    x, u, p, costate = H.arguments
    return H, [u, x, p, costate]


def _values(problem: Problem, points: int) -> ca.Function:
    H, arguments = _symbols(problem)
    return ca.Function("values", arguments, [ca.densify(H.value), ca.densify(H.terms)]).map(points)


def _model(problem: Problem, limits: list[tuple[int, int]], points: int) -> ca.Function:
    """Return (u, x, p, lambda) -> H, its gradient and Hessian in u, the limits, their gradients and Hessians."""
    H, arguments = _symbols(problem)
    u = problem.system.u
    held = ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in limits)) if limits else ca.SX(0, 1)
    bends = [ca.vec(ca.densify(ca.hessian(held[k], u)[0])) for k in range(held.numel())]
    outputs = [H.value, H.slope, ca.vec(ca.densify(H.curvature)), held, ca.vec(ca.densify(ca.jacobian(held, u).T))]
    outputs.append(ca.horzcat(*bends) if bends else ca.SX(u.numel() ** 2, 0))
    return ca.Function("model", arguments, ca.cse([ca.densify(o) for o in outputs])).map(points)


def _newton(model: ca.Function, fixed: tuple[Array, ...], u: Array, low: Array, high: Array) -> Array:
    """Return the controls (K, nu) that minimise H within their bounds, starting from those of the motion."""
    (count, nu), best = u.shape, np.clip(u, low, np.maximum(low, high))
    value = np.array(model(best.T, *fixed)[0])[0]
    for _ in range(ROUNDS):
        _, slope, curvature, *_ = (np.array(part) for part in model(best.T, *fixed))
        step = _on_box(slope.T, curvature.T.reshape(count, nu, nu), best, low, high) - best
        moved = False
        for shorter in (1.0, 0.25, 0.05):
            trial = best + shorter * step
            there = np.array(model(trial.T, *fixed)[0])[0]
            better = there < value
            best, value = np.where(better[:, None], trial, best), np.where(better, there, value)
            step = np.where(better[:, None], 0.0, step)
            moved = moved or bool(better.any())
        if not moved:
            break
    return np.asarray(best)


def _on_box(slope: Array, curvature: Array, u: Array, low: Array, high: Array) -> Array:
    """Return the minimum of quadratic models within bounds, coordinate by coordinate; linear ones go to a bound."""
    best, slope = u.copy(), slope.copy()
    nu = u.shape[1]
    for _ in range(1 if nu == 1 else ROUNDS):
        for i in range(nu):
            bend = curvature[:, i, i]
            curved = bend * (high[i] - low[i]) > FLAT * np.abs(slope[:, i])
            far = np.where(slope[:, i] > 0.0, low[i], np.where(slope[:, i] < 0.0, high[i], best[:, i]))
            to = np.where(curved, np.clip(best[:, i] - slope[:, i] / np.where(curved, bend, 1.0), low[i], high[i]), far)
            slope += curvature[:, :, i] * (to - best[:, i])[:, None]
            best[:, i] = to
    return best


def solved(matrices: Array, right: Array) -> Array:
    """Return the solutions (K, n) of a stack of linear systems; of least norm if one of them is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        usable = np.all(np.isfinite(matrices), axis=(1, 2)) & np.all(np.isfinite(right), axis=1)
        result = np.zeros_like(right)
        result[usable] = np.einsum("kij,kj->ki", np.linalg.pinv(matrices[usable]), right[usable])
        return result


def _interior(
    model: ca.Function, fixed: tuple[Array, ...], u: Array, low: Array, high: Array, lower: Array, upper: Array
) -> Array:
    """Return the controls (K, nu) that minimise H within their bounds and lower <= g(x, u) <= upper."""
    count, nu = u.shape
    below, above = np.isfinite(lower), np.isfinite(upper)
    width = np.maximum(high - low, 1e-300)
    eye = np.eye(nu)

    def limits(g: Array, v: Array) -> Array:  # all <= 0
        return np.hstack([(v - high) / width, (low - v) / width, (g - upper)[:, above], (lower - g)[:, below]])

    v = np.clip(u, low + 0.05 * width, high - 0.05 * width)
    evaluated = [np.array(part) for part in model(v.T, *fixed)]
    scale = np.maximum(np.max(np.abs(evaluated[1].T * width), axis=1), 1e-300)  # of H at every point
    c = limits(evaluated[3].T, v)
    s, z = np.maximum(-c, 0.1), np.ones(c.shape)
    for _ in range(BARRIER_ROUNDS):
        _, slope, bend, g, jacobian, bends = (np.array(part) for part in model(v.T, *fixed))
        m = len(lower)
        a = jacobian.reshape(nu, m, count, order="F").transpose(2, 1, 0)
        rows = [np.tile(eye / width, (count, 1, 1)), np.tile(-eye / width, (count, 1, 1)), a[:, above], -a[:, below]]
        A = np.concatenate(rows, axis=1)
        weight = np.zeros((count, m))
        weight[:, above] += z[:, 2 * nu : 2 * nu + above.sum()]
        weight[:, below] -= z[:, 2 * nu + above.sum() :]
        H = bend.T.reshape(count, nu, nu) / scale[:, None, None]
        H = H + np.einsum(
            "kc,kcij->kij", weight, bends.reshape(nu * nu, count, m).transpose(1, 2, 0).reshape(count, m, nu, nu)
        )
        c = limits(g.T, v)
        gap = np.mean(s * z, axis=1)
        target = np.maximum(0.1 * gap, 1e-16)[:, None]
        dual, primal = slope.T / scale[:, None] + np.einsum("kci,kc->ki", A, z), c + s
        K = H + np.einsum("kci,kc,kcj->kij", A, z / s, A) + 1e-14 * np.diag(1.0 / width**2)
        right = -(dual + np.einsum("kci,kc->ki", A, (target + z * primal) / s - z))
        step = solved(K, right)
        ds = -primal - np.einsum("kci,ki->kc", A, step)
        dz = (target - z * ds) / s - z
        alpha = np.minimum(_step_length(s, ds), _step_length(z, dz))[:, None]
        v, s, z = v + alpha * step, s + alpha * ds, z + alpha * dz
        if np.all(gap < 1e-15):
            break
    return np.asarray(v)


def _step_length(values: Array, steps: Array) -> Array:
    """Return the largest share (K,) of steps, at most one, that keeps values positive."""
    with np.errstate(divide="ignore", invalid="ignore"):
        longest = np.where(steps < 0.0, -TO_BOUNDARY * values / steps, np.inf)
    return np.asarray(np.minimum(1.0, np.min(longest, axis=1)))
