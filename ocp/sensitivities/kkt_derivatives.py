"""Derivatives of an optimum with respect to the numbers of its NLP, from the linearised conditions of optimality.

Source: A. V. Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming, 1983; H. Pirnay,
    R. Lopez-Negrete, L. T. Biegler, Optimal sensitivity based on IPOPT, Math. Program. Comput. 4, 2012.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.sensitivities.kkt_root import Bounds, Optimum
from ocp.sensitivities.kkt_system import Conditions, Evaluation, evaluate
from ocp.transcription.nlp import Nlp

REFINEMENTS = 1  # rounds of iterative refinement of each linear solve
AMBIGUOUS = 1e-4  # error of a recovered random vector above which the unknowns are not determined
CONTRADICTION = 1e-7  # relative residual above which the constraint rows contradict each other
NOTHING = 1e-9  # share of the cost below which a change of the cost counts as zero
LOOSE = 1e-8  # regularisation that determines a step where nothing else does
STIFF = 1e12  # diagonal weight that keeps a weakly active bound active
WEAK = 1e-7  # slack and multiplier (share of the largest multiplier or slope) below which a bound is weakly active


@functools.lru_cache(maxsize=16)
def parameter_slopes(
    derivatives: tuple[ca.Function, ca.Function], sizes: tuple[int, int, int], count: int
) -> ca.Function:
    """Return (z, head, rest, y) -> d[grad f + A' y; g; f]/d head, where s = [head; rest].

    Args:
        derivatives: jac_g and grad_f of the NLP.
        sizes: numbers of unknowns z, parameters s and constraint rows g.
        count: number of leading parameters that vary.
    """
    jac_g, grad_f = derivatives
    z, y = ca.MX.sym("z", sizes[0]), ca.MX.sym("y", sizes[2])
    head, tail = ca.MX.sym("head", count), ca.MX.sym("tail", sizes[1] - count)
    g, jacobian = jac_g(z, ca.vertcat(head, tail))
    f, gradient = grad_f(z, ca.vertcat(head, tail))
    together = ca.vertcat(gradient + ca.mtimes(jacobian.T, y), g, f)
    return ca.Function("slopes", [z, head, tail, y], [ca.jtimes(together, head, ca.MX.eye(count))])


@dataclass(frozen=True, eq=False)
class Direction:
    """Rates of change of the numbers of an NLP.

    Args:
        head: (np + 1 or np,) of the parameters, and of the duration if it is given.
        bounds: of the bounds of the unknowns (nz,), (nz,) and of the constraint rows (ng,), (ng,); zero where a bound
            is infinite.
    """

    head: Array
    bounds: Bounds

    @staticmethod
    def between(old: tuple[Array, Bounds], new: tuple[Array, Bounds]) -> Direction:
        """Return the difference of two sets of numbers, each (head, bounds)."""
        parts = []
        for before, after in zip(old[1], new[1], strict=True):
            both = np.isfinite(before) & np.isfinite(after)
            parts.append(np.where(both, after, 0.0) - np.where(both, before, 0.0))
        return Direction(new[0] - old[0], (parts[0], parts[1], parts[2], parts[3]))


@dataclass(frozen=True, eq=False)
class Derivative:
    """Derivatives of an optimum along c directions.

    Args:
        z, y: (nz, c), (ng, c) of the unknowns, NaN where they are not determined, and of the row multipliers.
        cost: (c,) of the cost, from the multipliers.
        gap: (c,) relative difference to the same derivative computed from z.
        weak: (l,) indices of the weakly active bounds among the 2 (nz + k) lower, then upper ones.
        moves: (l, c) rate at which those bounds become inactive, > 0, or violated, < 0.
        reason: why the unknowns are not determined; empty if they are.
        unique: whether the multipliers determine the derivative of the cost all the same.
    """

    z: Array
    y: Array
    cost: Array
    gap: Array
    weak: Array
    moves: Array
    reason: str
    unique: bool


@dataclass(frozen=True, eq=False)
class _Changes:
    """Directions as columns: of parameters, and of the bounds of Z = [z; w] and of the equations."""

    conditions: Array  # (nz + ng + 1, c) of [grad f + A' y; g; f] for fixed z and y
    low: Array  # (nz + k, c)
    high: Array  # (nz + k, c)
    known: Array  # (nz + k, c) of the components of Z that are at an active bound
    equations: Array  # (ng, c) of the right-hand sides of equality rows


def differentiate(
    nlp: Nlp, bounds: Bounds, conditions: Conditions, at: Optimum, directions: tuple[Direction, ...], count: int
) -> Derivative:
    """Return the derivatives of an optimum along directions.

    Args:
        nlp: solved.
        bounds: of its unknowns and constraint rows.
        conditions: its conditions of optimality.
        at: their root.
        directions: c of them.
        count: length of their heads.
    """
    nz, rows = len(at.z), at.rows
    changes = _changes(nlp, bounds, at, directions, count)
    here = evaluate(nlp, at.z, at.s, at.y)
    right = _right_hand_side(changes, here, rows)
    weak = _weakly_active(bounds, at, here)
    reason, kept, result, left = _linear_solve(conditions, here, at, weak, right)
    step = result[: nz + len(rows)] + changes.known
    unique = bool(np.all(left <= CONTRADICTION))
    if not reason and not unique:
        reason = "active constraints depend on each other, and a change moves them apart"
    slope = here.gradient + np.array(ca.mtimes(here.jacobian.T, at.y)).ravel()
    cost = envelope(bounds, at, directions, slope) + changes.conditions[-1] + at.y @ changes.conditions[nz:-1]
    primal = here.gradient @ step[:nz] + changes.conditions[-1]
    rounding = NOTHING * float(np.abs(here.gradient) @ np.abs(at.z))
    scale = np.maximum(np.abs(cost), np.abs(here.gradient) @ np.abs(step[:nz])) + rounding
    side, index = np.nonzero(weak)
    moves = np.where(side[:, None] == 0, step[index] - changes.low[index], changes.high[index] - step[index])
    if kept:
        moves = -moves * STIFF
    if reason:
        step = np.full_like(step, np.nan)
        cost = cost if unique else np.full_like(cost, np.nan)
    gap, indices = np.abs(primal - cost) / scale, np.flatnonzero(weak)
    return Derivative(step[:nz], result[len(step) :], cost, gap, indices, moves, reason, unique)


def _changes(nlp: Nlp, bounds: Bounds, at: Optimum, directions: tuple[Direction, ...], count: int) -> _Changes:
    head = np.stack([d.head for d in directions], axis=1)
    low, high, rows_low, rows_high = (np.stack([d.bounds[i] for d in directions], axis=1) for i in range(4))
    derivatives = nlp.derivatives["jac_g"], nlp.derivatives["grad_f"]
    function = parameter_slopes(derivatives, (len(at.z), len(at.s), nlp.rows), count)
    change = np.array(function(at.z, at.s[:count], at.s[count:], at.y)) @ head
    low, high = np.vstack([low, rows_low[at.rows]]), np.vstack([high, rows_high[at.rows]])
    known = np.zeros_like(low)
    active = at.multipliers > at.slacks
    known[active[0]], known[active[1]] = low[active[0]], high[active[1]]
    known[: len(at.z)][at.fixed] = low[: len(at.z)][at.fixed]
    return _Changes(change, low, high, known, np.where((bounds[2] == bounds[3])[:, None], rows_low, 0.0))


def _right_hand_side(changes: _Changes, here: Evaluation, rows: Array) -> Array:
    """Return the right-hand sides (nz + k + ng, c) of the linearised conditions, known changes moved there."""
    nz = len(here.gradient)
    bent = np.array(ca.mtimes(ca.triu2symm(here.hessian), changes.known[:nz]))
    carried = np.array(ca.mtimes(here.jacobian, changes.known[:nz]))
    carried[rows] -= changes.known[nz:]
    slack = np.zeros((len(rows), changes.low.shape[1]))
    return np.vstack([-changes.conditions[:nz] - bent, slack, changes.equations - changes.conditions[nz:-1] - carried])


def _weakly_active(bounds: Bounds, at: Optimum, here: Evaluation) -> Array:
    """Return whether each bound (2, nz + k) is met without a multiplier."""
    values = np.append(at.z, at.w)
    slack = np.maximum(np.array([values - np.append(bounds[0], bounds[2][at.rows]),
                                 np.append(bounds[1], bounds[3][at.rows]) - values]), 0.0)  # fmt: skip
    largest = max(float(np.max(np.abs(part), initial=0.0)) for part in (at.multipliers, at.y, here.gradient))
    return np.asarray((slack < WEAK) & (at.multipliers <= WEAK * largest) & np.isfinite(at.slacks))


def _linear_solve(
    conditions: Conditions, here: Evaluation, at: Optimum, weak: Array, right: Array
) -> tuple[str, bool, Array, Array]:
    """Solve the linearised conditions, weakly active bounds inactive first, then active.

    Returns:
        why the unknowns are not determined (empty if they are), whether weakly active bounds were kept active, the
        solution (nz + k + ng, c), and its relative residuals (c,).
    """
    for kept in (False, True) if weak.any() else (False,):
        stiffness = np.where(weak, STIFF if kept else 0.0, at.stiffness).sum(axis=0)
        linear = conditions.at(here.hessian, here.jacobian, stiffness)
        result, left, ambiguity = linear.solve(right, REFINEMENTS)
        if ambiguity < AMBIGUOUS:
            return "", kept, result, left
    # The multipliers still determine the derivative of the cost, unless rows contradict each other.
    result, left, _ = conditions.at(here.hessian, here.jacobian, stiffness + LOOSE).solve(right, REFINEMENTS)
    return "the optimum is not isolated: other motions cost the same to second order", kept, result, left


def envelope(bounds: Bounds, at: Optimum, directions: tuple[Direction, ...], slope: Array) -> Array:
    """Return the derivative of the cost (c,) with respect to moved bounds and right-hand sides, from the multipliers.

    Args:
        bounds: of the unknowns and constraint rows.
        at: the root.
        directions: c of them; their heads do not count.
        slope: (nz,) grad f + A' y.
    """
    low, high, rows_low, rows_high = (np.stack([d.bounds[i] for d in directions], axis=1) for i in range(4))
    equal = np.where((bounds[2] == bounds[3])[:, None], rows_low, 0.0)
    low, high = np.vstack([low, rows_low[at.rows]]), np.vstack([high, rows_high[at.rows]])
    fixed = np.flatnonzero(at.fixed)
    return np.asarray(slope[fixed] @ low[fixed] + at.multipliers[0] @ low - at.multipliers[1] @ high - at.y @ equal)
