"""Perturbation of an optimum: how it changes with the numbers of its NLP, to first order.

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
from ocp.sensitivities.kkt_system import Conditions, evaluate
from ocp.transcription.nlp import Nlp

REFINEMENTS = 1
AMBIGUOUS, CONTRADICTION = 1e-4, 1e-7  # above which an optimum is not isolated, rows contradict each other
NOTHING = 1e-9  # share of the cost that counts as no change of it
LOOSE = 1e-8  # price of a step where nothing determines it
STIFF = 1e12  # of a limit that is held
WEAK = 1e-7  # distance and multiplier (share of the largest one or slope) below which a limit is only just met


@functools.lru_cache(maxsize=16)
def slopes(derivatives: tuple[ca.Function, ca.Function], sizes: tuple[int, int, int], count: int) -> ca.Function:
    """Return (z, head, rest, y) -> d[grad f + A' y; g; f]/d head, where s = [head; rest].

    Args:
        derivatives: jac_g and grad_f.
        sizes: of z, s and g.
        count: of directions and of what varies in s.
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
    """By how much the numbers of an NLP change.

    Args:
        head: (np + 1 or np,) parameters, and the duration if it is given.
        bounds: of the unknowns (nz,), (nz,) and of the rows (ng,), (ng,); zero where there are none.
    """

    head: Array
    bounds: Bounds

    @staticmethod
    def between(old: tuple[Array, Bounds], new: tuple[Array, Bounds]) -> Direction:
        """Return the direction from some numbers, head and bounds, to others."""
        parts = []
        for before, after in zip(old[1], new[1], strict=True):
            both = np.isfinite(before) & np.isfinite(after)
            parts.append(np.where(both, after, 0.0) - np.where(both, before, 0.0))
        return Direction(new[0] - old[0], (parts[0], parts[1], parts[2], parts[3]))


@dataclass(frozen=True, eq=False)
class Derivative:
    """How an optimum changes along directions.

    Args:
        z, y: (nz, c), (ng, c) changes of the unknowns, NaN where they are not determined, and of the row's multipliers.
        cost: (c,) change of the cost, by the multipliers.
        gap: (c,) by how much the change of the unknowns gives another change of the cost, relative.
        met: (l,) numbers of the limits, among 2 (nz + k), that are only just met.
        moves: (l, c) how those limits are left, > 0, or broken, < 0.
        reason: why the unknowns are not determined, or empty.
        unique: whether the multipliers say what the cost does all the same.
    """

    z: Array
    y: Array
    cost: Array
    gap: Array
    met: Array
    moves: Array
    reason: str
    unique: bool


def differentiate(
    nlp: Nlp, bounds: Bounds, conditions: Conditions, at: Optimum, directions: tuple[Direction, ...],
    count: int,
) -> Derivative:  # fmt: skip
    """Return the derivative of an optimum along directions.

    Args:
        NLP: solved.
        bounds: of its unknowns and rows.
        conditions: of it.
        at: the root.
        directions: c of them.
        count: length of their heads.
    """
    nz, rows = len(at.z), at.rows
    head = np.stack([d.head for d in directions], axis=1)
    low, high, rows_low, rows_high = (np.stack([d.bounds[i] for d in directions], axis=1) for i in range(4))
    derivatives = nlp.derivatives["jac_g"], nlp.derivatives["grad_f"]
    function = slopes(derivatives, (nz, len(at.s), nlp.rows), count)
    change = np.array(function(at.z, at.s[:count], at.s[count:], at.y)) @ head
    here = evaluate(nlp, at.z, at.s, at.y)
    low, high = np.vstack([low, rows_low[rows]]), np.vstack([high, rows_high[rows]])
    known = np.zeros_like(low)  # what limits that are active do to their unknowns
    held = at.duals > at.gaps
    known[held[0]], known[held[1]] = low[held[0]], high[held[1]]
    known[:nz][at.fixed] = low[:nz][at.fixed]
    equal = np.where((bounds[2] == bounds[3])[:, None], rows_low, 0.0)
    bent = np.array(ca.mtimes(ca.triu2symm(here.hessian), known[:nz]))
    carried = np.array(ca.mtimes(here.jacobian, known[:nz]))
    carried[rows] -= known[nz:]
    slack = np.zeros((len(rows), len(directions)))
    right = np.vstack([-change[:nz] - bent, slack, equal - change[nz:-1] - carried])

    true = np.maximum(np.array([np.append(at.z, at.w) - np.append(bounds[0], bounds[2][rows]),
                                np.append(bounds[1], bounds[3][rows]) - np.append(at.z, at.w)]), 0.0)  # fmt: skip
    largest = max(float(np.max(np.abs(part), initial=0.0)) for part in (at.duals, at.y, here.gradient))
    weak = (true < WEAK) & (at.duals <= WEAK * largest) & np.isfinite(at.gaps)
    reason, kept = "", False
    for kept in (False, True) if weak.any() else (False,):
        stiffness = np.where(weak, STIFF if kept else 0.0, at.stiffness).sum(axis=0)
        linear = conditions.at(here.hessian, here.jacobian, stiffness)
        result, left, ambiguity = linear.solve(right, REFINEMENTS)
        if ambiguity < AMBIGUOUS:
            break
    else:
        reason = "the optimum is not isolated: other motions cost the same to second order"
        # The multipliers still say what the cost does, unless rows contradict each other.
        result, left, _ = conditions.at(here.hessian, here.jacobian, stiffness + LOOSE).solve(right, REFINEMENTS)
    step = result[: nz + len(rows)] + known
    unique = bool(np.all(left <= CONTRADICTION))
    if not reason and not unique:
        reason = "active limits depend on each other, and a change moves them apart"
    slope = here.gradient + np.array(ca.mtimes(here.jacobian.T, at.y)).ravel()
    cost = envelope(bounds, at, directions, slope) + change[-1] + at.y @ change[nz:-1]
    primal = here.gradient @ step[:nz] + change[-1]
    rounding = NOTHING * float(np.abs(here.gradient) @ np.abs(at.z))
    size = np.maximum(np.abs(cost), np.abs(here.gradient) @ np.abs(step[:nz])) + rounding
    side, place = np.nonzero(weak)
    moves = np.where(side[:, None] == 0, step[place] - low[place], high[place] - step[place])
    if kept:
        moves = -moves * STIFF
    if reason:
        step = np.full_like(step, np.nan)
        cost = cost if unique else np.full_like(cost, np.nan)
    return Derivative(
        step[:nz], result[len(step) :], cost, np.abs(primal - cost) / size, np.flatnonzero(weak), moves, reason, unique
    )


def envelope(bounds: Bounds, at: Optimum, directions: tuple[Direction, ...], slope: Array) -> Array:
    """Return the change of the cost (c,) by the multipliers when bounds and the values of rows are moved.

    Args:
        bounds: of the unknowns and rows.
        at: the root.
        directions: c of them; their heads do not count.
        slope: (nz,) grad f + A' y.
    """
    low, high, rows_low, rows_high = (np.stack([d.bounds[i] for d in directions], axis=1) for i in range(4))
    equal = np.where((bounds[2] == bounds[3])[:, None], rows_low, 0.0)
    low, high = np.vstack([low, rows_low[at.rows]]), np.vstack([high, rows_high[at.rows]])
    fixed = np.flatnonzero(at.fixed)
    return np.asarray(slope[fixed] @ low[fixed] + at.duals[0] @ low - at.duals[1] @ high - at.y @ equal)
