"""Newton's method from a solution to an accurate root of its conditions of optimality, along the central path.

Unknowns are Z = [z; w] with a slack variable w for every constraint row that is an inequality. With multipliers
l, u >= 0 of the lower and upper bounds of Z, and the barrier parameter reduced to zero:

    grad f + A' y - l + u = 0,   g(z, s) - w = 0,   l (Z - lower) = u (upper - Z) = barrier -> 0

Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2006, 19.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.sensitivities.kkt_system import Conditions, Evaluation, conditions, evaluate
from ocp.transcription.nlp import Nlp

Bounds = tuple[Array, Array, Array, Array]  # lower, upper of the unknowns (nz,), lower, upper of the rows (ng,)
FIRST, LAST = 1e-10, 1e-20  # barrier parameter at the start and at the end
STEPS = 24  # of Newton's method
TO_BOUNDARY = 1.0 - 1e-6  # largest share of the step to the nearest bound
CONVERGED = 1e-10  # residual of the scaled conditions
MET = 1e-8  # a slack below this counts as active
HOLD = 1e12  # diagonal weight of an unknown at its bound in the least-squares problem for the first multipliers
NEAR = 1e-10  # diagonal regularisation: unknowns that nothing determines do not move
LEAST = 1e-13  # smallest slack; smaller ones are rounding


@dataclass(frozen=True, eq=False)
class Optimum:
    """A root of the conditions of optimality.

    Args:
        z, y: (nz,), (ng,) unknowns and multipliers of the constraint rows.
        s: parameters of the NLP.
        w: (k,) slack variables of the inequality rows.
        slacks: (2, nz + k) distances of Z from its lower and upper bounds, infinite where there are none.
        multipliers: (2, nz + k) of the lower and upper bounds of Z, >= 0.
        fixed: (nz,) whether the bounds leave an unknown one value only.
        rows: (k,) indices of the inequality rows.
        error: largest residual.
    """

    z: Array
    y: Array
    s: Array
    w: Array
    slacks: Array
    multipliers: Array
    fixed: Array
    rows: Array
    error: float

    @property
    def products(self) -> Array:
        """(2, nz + k) multiplier times slack of every bound."""
        return np.asarray(self.multipliers * np.where(np.isfinite(self.slacks), self.slacks, 0.0))

    @property
    def stiffness(self) -> Array:
        """(2, nz + k) multiplier over slack of every bound."""
        return np.asarray(self.multipliers / self.slacks)


def initial_point(
    nlp: Nlp, bounds: Bounds, z: Array, s: Array, y: Array | None, limits: Array
) -> tuple[Conditions, Optimum]:
    """Return the conditions of optimality and the point from which `settle` starts.

    Args:
        nlp: solved.
        bounds: of its unknowns and constraint rows.
        z, s: solution and parameters.
        y: (ng,) multipliers of the rows as far as known; None for a least-squares estimate of them.
        limits: (nz,) multipliers of the bounds of z, > 0 at upper ones; zero where they are not known.
    """
    low, high, rows_low, rows_high = bounds
    fixed, rows = low >= high, np.flatnonzero((rows_low < rows_high) & (np.isfinite(rows_low) | np.isfinite(rows_high)))
    g = np.array(nlp.derivatives["jac_g"](z, s)[0]).ravel()
    w = np.clip(g[rows], rows_low[rows], rows_high[rows])
    values = np.append(z, w)
    true = np.array([values - np.append(low, rows_low[rows]), np.append(high, rows_high[rows]) - values])
    true[:, : len(z)][:, fixed] = np.inf
    matrix = conditions(nlp, fixed, rows)
    if y is None:
        nothing = np.zeros(len(values))
        unknown = Optimum(z, np.zeros(len(g)), s, w, true, np.stack([nothing, nothing]), fixed, rows, np.inf)
        y, net = _estimated_multipliers(nlp, matrix, unknown)
    else:
        here = evaluate(nlp, z, s, y)
        slope = here.gradient + np.array(ca.mtimes(here.jacobian.T, y)).ravel()
        # Multipliers of a few unknowns, such as the duration, are not stored with a solution.
        unstored = (limits == 0.0) & (np.min(true[:, : len(z)], axis=0) < MET)
        net = np.append(np.where(unstored, -slope, limits), y[rows])
        net[: len(z)][fixed] = 0.0
    # A weakly active bound (slack of rounding size, no multiplier) starts with a slack of the root of the barrier.
    pressed = np.maximum(np.array([-net, net]), 0.0)
    slacks = np.maximum(true, np.where(pressed > np.sqrt(FIRST), LEAST, np.sqrt(FIRST)))
    slacks = np.where((pressed <= np.sqrt(FIRST)) & (true > LEAST), np.maximum(true, LEAST), slacks)
    multipliers = np.clip(pressed, np.minimum(FIRST / slacks, np.sqrt(FIRST)), np.inf)
    multipliers[np.isinf(slacks)] = 0.0
    return matrix, Optimum(z, y, s, w, slacks, multipliers, fixed, rows, np.inf)


def _estimated_multipliers(nlp: Nlp, matrix: Conditions, at: Optimum) -> tuple[Array, Array]:
    """Return multipliers of rows (ng,) and bounds (nz + k,) of least residual, with active bounds held."""
    at_bound = np.min(at.slacks, axis=0) < MET
    here, weights = evaluate(nlp, at.z, at.s, at.y), 1.0 + HOLD * at_bound
    linear = matrix.at(0.0 * here.hessian, here.jacobian, weights)
    result = linear.solve(np.append(-_stationarity(here, at), np.zeros(len(at.y)))[:, None])[0][:, 0]
    count = len(at_bound)
    y, net = result[count:], np.where(at_bound, weights * result[:count], 0.0)
    net[np.abs(net) < MET * np.max(np.abs(y), initial=1.0)] = 0.0
    return y, net


def _stationarity(here: Evaluation, at: Optimum) -> Array:
    """Return the gradient (nz + k,) of the Lagrangian with respect to Z."""
    slope = np.append(here.gradient + np.array(ca.mtimes(here.jacobian.T, at.y)).ravel(), -at.y[at.rows])
    return np.asarray(slope - at.multipliers[0] + at.multipliers[1])


def settle(nlp: Nlp, bounds: Bounds, matrix: Conditions, at: Optimum) -> Optimum:
    """Return the root of the conditions, by Newton's method with the barrier parameter going to zero.

    Args:
        nlp: solved.
        bounds: of its unknowns and constraint rows.
        matrix: the conditions, as `initial_point` returns them.
        at: the point from `initial_point`.
    """
    rhs = np.where(bounds[2] == bounds[3], bounds[2], 0.0)
    barrier = FIRST
    for _ in range(STEPS):
        here = evaluate(nlp, at.z, at.s, at.y)
        stationarity = _stationarity(here, at)
        missed = here.g - rhs
        missed[at.rows] -= at.w
        error = max(np.max(np.abs(stationarity[matrix.keep])), np.max(np.abs(missed)))
        product = float(np.max(at.products, initial=0.0))
        at = replace(at, error=float(max(error, product)))
        if error < CONVERGED and product <= 10.0 * LAST:
            break
        if error < 1e3 * barrier**0.5:
            barrier = max(min(barrier, product) ** 2, LAST)
        pull = np.where(np.isfinite(at.slacks), barrier / at.slacks - at.multipliers, 0.0)
        right = -stationarity + pull[0] - pull[1]
        linear = matrix.at(here.hessian, here.jacobian, at.stiffness.sum(axis=0) + NEAR)
        result = linear.solve(np.append(right, -missed)[:, None])[0][:, 0]
        if not np.all(np.isfinite(result)):
            break
        step = result[: len(right)]
        change = np.array([step, -step])
        pressed = pull - at.stiffness * change
        primal, dual = _step_length(at.slacks, change), _step_length(at.multipliers, pressed)
        nz = len(at.z)
        at = replace(
            at, z=at.z + primal * step[:nz], w=at.w + primal * step[nz:], y=at.y + dual * result[len(right) :],
            slacks=at.slacks + primal * change, multipliers=at.multipliers + dual * pressed,
        )  # fmt: skip
    return at


def _step_length(values: Array, change: Array) -> float:
    """Return the largest share of a step, at most one, that keeps values positive."""
    falling = (change < 0.0) & np.isfinite(values) & (values > 0.0)
    return float(min(1.0, TO_BOUNDARY * np.min(-values[falling] / change[falling], initial=np.inf)))
