"""From a solution to the root of its conditions of optimality: the end of the central path.

Unknowns Z = [z; w] with a slack w for every row that has limits; Z between its limits, multipliers l, u >= 0:

    grad f + A' y - l + u = 0,   g(z, s) - w = 0,   l (Z - lower) = u (upper - Z) = mu -> 0

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
FIRST, LAST = 1e-10, 1e-20  # mu at the start and at the end
STEPS, TO_BOUNDARY = 24, 1.0 - 1e-6
CONVERGED = 1e-10  # residual of the scaled conditions
MET, HOLD = 1e-8, 1e12  # distance from a limit that meets it, stiffness of what is held there
NEAR = 1e-10  # price of a step, so that unknowns that nothing determines stay where they are
LEAST = 1e-13  # distance from a limit that still counts as one


@dataclass(frozen=True, eq=False)
class Optimum:
    """A root of the conditions of optimality.

    Args:
        z, y: (nz,), (ng,) unknowns and multipliers of the rows.
        s: parameters of the NLP.
        w: (k,) slacks of the limited rows.
        gaps: (2, nz + k) distances from the lower and upper limits, infinite where there are none.
        duals: (2, nz + k) multipliers of the lower and upper limits, >= 0.
        fixed: (nz,) unknowns with one value.
        rows: (k,) numbers of the limited rows.
        error: largest residual.
    """

    z: Array
    y: Array
    s: Array
    w: Array
    gaps: Array
    duals: Array
    fixed: Array
    rows: Array
    error: float

    @property
    def products(self) -> Array:
        """(2, nz + k) multiplier times distance of every limit."""
        return np.asarray(self.duals * np.where(np.isfinite(self.gaps), self.gaps, 0.0))

    @property
    def stiffness(self) -> Array:
        """(2, nz + k) multiplier over distance of every limit."""
        return np.asarray(self.duals / self.gaps)


def start(nlp: Nlp, bounds: Bounds, z: Array, s: Array, y: Array | None, limits: Array) -> tuple[Conditions, Optimum]:
    """Return where the way to the root begins.

    Args:
        NLP: solved.
        bounds: of its unknowns and rows.
        z, s: solution and parameters.
        y: (ng,) multipliers of the rows as far as known, or None.
        limits: (nz,) those of the bounds, > 0 at upper ones.
    """
    low, high, rows_low, rows_high = bounds
    fixed, rows = low >= high, np.flatnonzero((rows_low < rows_high) & (np.isfinite(rows_low) | np.isfinite(rows_high)))
    g = np.array(nlp.derivatives["jac_g"](z, s)[0]).ravel()
    w = np.clip(g[rows], rows_low[rows], rows_high[rows])
    there = np.append(z, w)
    true = np.array([there - np.append(low, rows_low[rows]), np.append(high, rows_high[rows]) - there])
    true[:, : len(z)][:, fixed] = np.inf
    matrix = conditions(nlp, fixed, rows)
    if y is None:
        # Multipliers that are not known are those that leave the least open, with what is at a limit held there.
        y, nothing = np.zeros(len(g)), np.zeros(len(there))
        at_limit = np.min(true, axis=0) < MET
        here, hold = evaluate(nlp, z, s, y), 1.0 + HOLD * at_limit
        first = Optimum(z, y, s, w, true, np.stack([nothing, nothing]), fixed, rows, np.inf)
        linear = matrix.at(0.0 * here.hessian, here.jacobian, hold)
        result = linear.solve(np.append(-_stationary(here, first), np.zeros(len(g)))[:, None])[0][:, 0]
        y, net = result[len(there) :], np.where(at_limit, hold * result[: len(there)], 0.0)
        net[np.abs(net) < MET * np.max(np.abs(y), initial=1.0)] = 0.0
    else:
        here = evaluate(nlp, z, s, y)
        slope = here.gradient + np.array(ca.mtimes(here.jacobian.T, y)).ravel()
        # Of a few unknowns, such as the duration, no multipliers are given.
        unknown = (limits == 0.0) & (np.min(true[:, : len(z)], axis=0) < MET)
        net = np.append(np.where(unknown, -slope, limits), y[rows])
        net[: len(z)][fixed] = 0.0
    # What is at a limit to rounding and has no multiplier is at a distance of the size of mu.
    pressed = np.maximum(np.array([-net, net]), 0.0)
    gaps = np.maximum(true, np.where(pressed > np.sqrt(FIRST), LEAST, np.sqrt(FIRST)))
    gaps = np.where((pressed <= np.sqrt(FIRST)) & (true > LEAST), np.maximum(true, LEAST), gaps)
    duals = np.clip(pressed, np.minimum(FIRST / gaps, np.sqrt(FIRST)), np.inf)
    duals[np.isinf(gaps)] = 0.0
    return matrix, Optimum(z, y, s, w, gaps, duals, fixed, rows, np.inf)


def _stationary(here: Evaluation, at: Optimum) -> Array:
    slope = np.append(here.gradient + np.array(ca.mtimes(here.jacobian.T, at.y)).ravel(), -at.y[at.rows])
    return np.asarray(slope - at.duals[0] + at.duals[1])


def settle(nlp: Nlp, bounds: Bounds, matrix: Conditions, at: Optimum) -> Optimum:
    """Follow the central path from a solution to the root of the conditions, mu -> 0, by Newton's method.

    Args:
        NLP: solved.
        bounds: of its unknowns and rows.
        at: from `start`.
    """
    rhs = np.where(bounds[2] == bounds[3], bounds[2], 0.0)
    mu = FIRST
    for _ in range(STEPS):
        here = evaluate(nlp, at.z, at.s, at.y)
        stationary = _stationary(here, at)
        missed = here.g - rhs
        missed[at.rows] -= at.w
        error = max(np.max(np.abs(stationary[matrix.keep])), np.max(np.abs(missed)))
        product = float(np.max(at.products, initial=0.0))
        at = replace(at, error=float(max(error, product)))
        if error < CONVERGED and product <= 10.0 * LAST:
            break
        if error < 1e3 * mu**0.5:
            mu = max(min(mu, product) ** 2, LAST)
        pull = np.where(np.isfinite(at.gaps), mu / at.gaps - at.duals, 0.0)
        right = -stationary + pull[0] - pull[1]
        linear = matrix.at(here.hessian, here.jacobian, at.stiffness.sum(axis=0) + NEAR)
        result = linear.solve(np.append(right, -missed)[:, None])[0][:, 0]
        if not np.all(np.isfinite(result)):
            break
        step = result[: len(right)]
        change = np.array([step, -step])
        duals = pull - at.stiffness * change
        one, other = _share(at.gaps, change), _share(at.duals, duals)
        nz = len(at.z)
        at = replace(
            at, z=at.z + one * step[:nz], w=at.w + one * step[nz:], y=at.y + other * result[len(right) :],
            gaps=at.gaps + one * change, duals=at.duals + other * duals,
        )  # fmt: skip
    return at


def _share(values: Array, change: Array) -> float:
    """Return the share of a change that keeps values positive."""
    falling = (change < 0.0) & np.isfinite(values) & (values > 0.0)
    return float(min(1.0, TO_BOUNDARY * np.min(-values[falling] / change[falling], initial=np.inf)))
