"""The Hamiltonian along a motion and its least value over the controls that the limits allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
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
    fixed = (x, solution.parameters, costates.reshape(x.shape))
    low, high = _box(problem, solution)
    values = _values(problem)
    value, scale = (part[:, 0] for part in evaluate(values, u, *fixed))
    if u.shape[1] == 0:
        return Minimum(value, value, scale, u)
    limits = _mixed(problem)
    model = _model(problem, limits, fixed)
    if limits:
        lower, upper = (
            np.array([getattr(problem.subject_to[i], side)[c] for i, c in limits]) for side in ("lower", "upper")
        )
        best = _interior(model, u, low, high, lower, upper)
    else:
        best = _newton(model, lambda controls: evaluate(values, controls, *fixed)[0][:, 0], u, low, high)
    return Minimum(value, evaluate(values, best, *fixed)[0][:, 0], scale, best)


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


def _values(problem: Problem) -> ca.Function:
    H, arguments = _symbols(problem)
    return ca.Function("values", arguments, [ca.densify(H.value), ca.densify(H.terms)])


@dataclass(frozen=True, eq=False)
class _Local:
    """Derivatives of the Hamiltonian and of m limits by the controls at K points, at controls `u`."""

    u: Array  # (K, nu)
    slope: Array  # (K, nu) of H
    bend: Array  # (K, nu, nu) of H
    held: Array  # (K, m) limited expressions
    slopes: Array  # (K, m, nu) of these
    bends: Array | None  # (K, m, nu, nu) of these; None where all are linear in the controls

    def moved(self, u: Array) -> _Local:
        """Return the same at other controls, for a quadratic H and linear limits."""
        step = u - self.u
        slope = self.slope + (self.bend @ step[..., None])[..., 0]
        return _Local(u, slope, self.bend, self.held + (self.slopes @ step[..., None])[..., 0], self.slopes, None)


Model = Callable[[Array], _Local]  # of controls (K, nu)


def _model(problem: Problem, limits: list[tuple[int, int]], fixed: tuple[Array, ...]) -> Model:
    """Return the derivatives by the controls at points with fixed (x, p, costates).

    Where H is quadratic and the limits are linear in the controls, the functions are evaluated once.
    """
    H, arguments = _symbols(problem)
    u, count, m = problem.system.u, len(fixed[0]), len(limits)
    nu = u.numel()
    held = ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in limits)) if limits else ca.SX(0, 1)
    slopes = ca.jacobian(held, u)
    linear = not ca.depends_on(slopes, u)
    bends = [] if linear else [ca.vec(ca.densify(ca.hessian(held[k], u)[0])) for k in range(m)]
    outputs = [H.slope, ca.vec(ca.densify(H.curvature)), held, ca.vec(ca.densify(slopes.T)), ca.horzcat(*bends)]
    function = ca.Function("model", arguments, ca.cse([ca.densify(o) for o in outputs]))

    def at(controls: Array) -> _Local:
        slope, bend, g, first, second = evaluate(function, controls, *fixed)
        curved = None if linear else second.reshape(count, m, nu, nu)
        return _Local(controls, slope, bend.reshape(count, nu, nu), g, first.reshape(count, m, nu), curved)

    if not linear or ca.depends_on(H.curvature, u):
        return at
    known: list[_Local] = []

    def once(controls: Array) -> _Local:
        if not known:
            known.append(at(controls))
        return known[0].moved(controls)

    return once


def _newton(model: Model, value_at: Callable[[Array], Array], u: Array, low: Array, high: Array) -> Array:
    """Return the controls (K, nu) that minimise H within their bounds, starting from those of the motion."""
    best = np.clip(u, low, np.maximum(low, high))
    value = value_at(best)
    for _ in range(ROUNDS):
        local = model(best)
        step = _on_box(local.slope, local.bend, best, low, high) - best
        moved = False
        for shorter in (1.0, 0.25, 0.05):
            trial = best + shorter * step
            there = value_at(trial)
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


def _interior(model: Model, u: Array, low: Array, high: Array, lower: Array, upper: Array) -> Array:
    """Return the controls (K, nu) that minimise H within their bounds and lower <= g(x, u) <= upper."""
    nu = u.shape[1]
    below, above = np.isfinite(lower), np.isfinite(upper)
    width = np.maximum(high - low, 1e-300)
    ends = nu, 2 * nu, 2 * nu + int(above.sum())  # of the multipliers of high, low, upper

    def limits(g: Array, v: Array) -> Array:  # c (K, n), all <= 0
        return np.hstack([(v - high) / width, (low - v) / width, (g - upper)[:, above], (lower - g)[:, below]])

    def changes(slopes: Array, step: Array) -> Array:  # A step, A = dc/dv
        moved = (slopes @ step[..., None])[..., 0]
        return np.hstack([step / width, -step / width, moved[:, above], -moved[:, below]])

    def on_held(of_upper: Array, of_lower: Array) -> Array:  # (K, m)
        held = np.zeros((len(of_upper), len(lower)))
        held[:, above] += of_upper
        held[:, below] += of_lower
        return held

    def pulled(slopes: Array, y: Array) -> Array:  # A' y
        first, second, third, fourth = np.split(y, ends, axis=1)
        return np.asarray((first - second) / width + (on_held(third, -fourth)[:, None] @ slopes)[:, 0])

    def squared(slopes: Array, y: Array) -> Array:  # A' diag(y) A
        first, second, third, fourth = np.split(y, ends, axis=1)
        own = ((first + second + 1e-14) / width**2)[..., None] * np.eye(nu)
        return np.asarray(slopes.transpose(0, 2, 1) @ (on_held(third, fourth)[..., None] * slopes) + own)

    v = np.clip(u, low + 0.05 * width, high - 0.05 * width)
    local = model(v)
    scale = np.maximum(np.max(np.abs(local.slope * width), axis=1), 1e-300)[:, None]  # of H at every point
    s = np.maximum(-limits(local.held, v), 0.1)
    z = np.ones(s.shape)
    for _ in range(BARRIER_ROUNDS):
        slopes = local.slopes
        gap = np.mean(s * z, axis=1)
        target = np.maximum(0.1 * gap, 1e-16)[:, None]
        primal = limits(local.held, v) + s
        K = local.bend / scale[..., None] + squared(slopes, z / s)
        if local.bends is not None:
            weights = on_held(z[:, ends[1] : ends[2]], -z[:, ends[2] :])
            K = K + (weights[:, None] @ local.bends.reshape(*weights.shape, nu * nu)).reshape(K.shape)
        dual = local.slope / scale + pulled(slopes, z)
        step = solved(K, -(dual + pulled(slopes, (target + z * primal) / s - z)))
        ds = -primal - changes(slopes, step)
        dz = (target - z * ds) / s - z
        alpha = np.minimum(_step_length(s, ds), _step_length(z, dz))[:, None]
        v, s, z = v + alpha * step, s + alpha * ds, z + alpha * dz
        if np.all(gap < 1e-15):
            break
        local = model(v)
    return np.asarray(v)


def _step_length(values: Array, steps: Array) -> Array:
    """Return the largest share (K,) of steps, at most one, that keeps values positive."""
    with np.errstate(divide="ignore", invalid="ignore"):
        longest = np.where(steps < 0.0, -TO_BOUNDARY * values / steps, np.inf)
    return np.asarray(np.minimum(1.0, np.min(longest, axis=1)))
