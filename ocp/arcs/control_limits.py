"""Limits that couple controls with states or with each other: what they leave to a single control at one instant."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Problem

FLAT = 1e-12  # effect of a control on a limit, share of the largest along the motion, below which it has none


@functools.lru_cache(maxsize=64)
def coupled_limits(problem: Problem) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
    """Return (constraint, component, controls) of the inequalities along the motion that are more than control bounds.

    Args:
        problem: one phase.
    """
    u, results = problem.system.u, []
    for i, constraint in enumerate(problem.subject_to):
        if constraint.where is not Where.ALONG or not ca.depends_on(constraint.expression, u):
            continue
        own = {c for _, c in simple(constraint, u)}
        for c in range(constraint.expression.numel()):
            low, high = float(constraint.lower[c]), float(constraint.upper[c])
            if c in own or low == high or not (np.isfinite(low) or np.isfinite(high)):
                continue
            depends = ca.which_depends(constraint.expression[c], u, 1, False)
            chosen = tuple(k for k, own_effect in enumerate(depends) if own_effect)
            if chosen:
                results.append((i, c, chosen))
    return tuple(results)


def curved_limit(problem: Problem) -> str:
    """Return the name of a limit that is curved in several controls, such as |u| <= 1; empty if there is none.

    Such a limit alone determines all its controls; no one of them is at a bound or holds it.

    Args:
        problem: one phase.
    """
    for i, c, own in coupled_limits(problem):
        constraint = problem.subject_to[i]
        bends = ca.hessian(constraint.expression[c], problem.system.u)[0]
        if len(own) > 1 and not bends.is_zero() and bends.nnz() > 0:
            return problem.labels(constraint)[c].name
    return ""


def sides_of(problem: Problem, x: Array, u: Array, parameters: Array) -> tuple[Array, Array]:
    """Return the least and the largest value (K, nu) of every control where states and other controls are given.

    A limit g(x, u) <= g_max allows u_i up to u_i + (g_max - g) / (dg/du_i), exact if g is linear in u_i; a limit of
    several controls leaves to each what the others leave to it only if it depends on one control alone.

    Args:
        problem: one phase.
        x, u: (K, nx), (K, nu).
        parameters: (np,) values.
    """
    low, high = (np.tile(side, (len(x), 1)) for side in problem.limits(Where.ALONG, problem.system.u))
    chosen = [(i, c, own[0]) for i, c, own in coupled_limits(problem) if len(own) == 1]
    if not chosen:
        return low, high
    values, slopes = (
        np.array(part).T
        for part in mapped(_values(problem), len(x))(x.T, u.T, np.tile(np.array(parameters)[:, None], len(x)))
    )
    for k, (i, c, control) in enumerate(chosen):
        constraint, slope, own = problem.subject_to[i], slopes[:, k], u[:, control]
        usable = np.abs(slope) > FLAT * np.max(np.abs(slope), initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = [own + (float(side[c]) - values[:, k]) / slope for side in (constraint.lower, constraint.upper)]
        least, most = np.minimum(*ends), np.maximum(*ends)
        low[:, control] = np.where(usable, np.maximum(low[:, control], least), low[:, control])
        high[:, control] = np.where(usable, np.minimum(high[:, control], most), high[:, control])
    return low, high


@functools.lru_cache(maxsize=32)
def _values(problem: Problem) -> ca.Function:
    """Return the function (x, u, p) -> limits of one control each, and their derivatives by it."""
    system = problem.system
    chosen = [(problem.subject_to[i].expression[c], own[0]) for i, c, own in coupled_limits(problem) if len(own) == 1]
    slopes = [ca.jacobian(expression, system.u[control]) for expression, control in chosen]
    outputs = [ca.vertcat(*(expression for expression, _ in chosen)), ca.vertcat(*slopes)]
    return ca.Function("limits", [system.x, system.u, system.p], [ca.densify(output) for output in outputs])


def blocking(
    problem: Problem, point: tuple[Array, Array, Array], control: int, side: int
) -> tuple[int, int, int] | None:
    """Return (constraint, component, side of it) of the limit that a control meets first; None if it has a bound there.

    Args:
        problem: one phase.
        point: state (nx,), control (nu,), parameters (np,).
        control: index of the one that moves, all others as they are.
        side: -1 downwards, 1 upwards.
    """
    x, u, parameters = point
    bound = float(problem.limits(Where.ALONG, problem.system.u)[(side + 1) // 2][control])
    nearest, result = (abs(bound - u[control]) if np.isfinite(bound) else np.inf), None
    for i, c, own in coupled_limits(problem):
        if control not in own:
            continue
        constraint = problem.subject_to[i]
        value, slope = (float(part) for part in _one(problem, i, c, control)(x, u, parameters))
        toward = 1 if slope * side > 0.0 else -1
        limit = float((constraint.upper if toward > 0 else constraint.lower)[c])
        if slope == 0.0 or not np.isfinite(limit):
            continue
        away = max((limit - value) / (slope * side), 0.0)
        if away < nearest:
            nearest, result = away, (i, c, toward)
    return result


@functools.lru_cache(maxsize=256)
def _one(problem: Problem, i: int, c: int, control: int) -> ca.Function:
    system, expression = problem.system, problem.subject_to[i].expression[c]
    slope = ca.jacobian(expression, system.u[control])
    return ca.Function("limit", [system.x, system.u, system.p], [ca.densify(expression), ca.densify(slope)])


def pushes_of(
    problem: Problem, held: list[tuple[int, int, int]], point: tuple[Array, Array, Array], slopes: Array
) -> Array:
    """Return the sum of multiplier times d limit / du (K, nu) of active limits, each held by a control of its own.

    The multipliers are those with which dH/du_i vanishes, limits included, for the controls that hold the limits.

    Args:
        problem: one phase.
        held: (constraint, component, control) of the active limits.
        point: states (K, nx), controls (K, nu), parameters (np,).
        slopes: (K, nu) dH/du without the limits.
    """
    x, u, parameters = point
    function = _gradients(problem, tuple((i, c) for i, c, _ in held))
    rows = np.array(mapped(function, len(x))(x.T, u.T, np.tile(np.array(parameters)[:, None], len(x))))
    rows = rows.reshape(u.shape[1], len(held), len(x), order="F").transpose(0, 2, 1)
    holders = [control for _, _, control in held]
    matrices = rows[holders].transpose(1, 0, 2)  # (K, holder, limit)
    multipliers = np.linalg.pinv(matrices) @ -slopes[:, holders, None]
    return np.asarray(np.einsum("ikm,km->ki", rows, multipliers[:, :, 0]))


@functools.lru_cache(maxsize=64)
def _gradients(problem: Problem, chosen: tuple[tuple[int, int], ...]) -> ca.Function:
    """Return the function (x, u, p) -> (nu, m) gradients of limits by the controls."""
    system = problem.system
    limits = ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in chosen))
    return ca.Function("gradients", [system.x, system.u, system.p], [ca.densify(ca.jacobian(limits, system.u).T)])
