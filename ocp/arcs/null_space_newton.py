"""Newton's iteration for an NLP without inequalities that has about as many equations as unknowns."""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import probes
from ocp.solution.solution import Status
from ocp.solving.nlp_solver import NlpResult
from ocp.transcription.nlp import Nlp

Sides = tuple[Array, Array, Array, Array]  # lower and upper bounds of unknowns, then of rows
ENOUGH = 1e-9  # correction of the scaled unknowns that ends the iteration; the next would be rounding
MOST_ITERATIONS = 10
LARGEST = 1e3  # correction of a scaled unknown that ends the iteration: it diverges
MOST_FREE = 6  # largest number of unknowns more than equations


@dataclass(frozen=True, eq=False)
class Equations:
    """min f(z) subject to g(z) = b with few unknowns more than equations, or none; made by `as_equations`.

    With rows C that make B = [g'; C] square, B Z = [0; I] spans the directions that the equations leave free. A step
    dz = r + Z y has B r = [b - g; 0] and (Z' H Z) y = -Z' (grad f + H r), with the Hessian H of the Lagrangian.

    Args:
        nlp: with cost f and rows g.
        unknowns: indices of the unknowns that are not fixed by equal bounds.
        border: C.
        linear: solver with B, sparse QR.

    Source: J. Nocedal, S. J. Wright, Numerical Optimization, 18.3 (null-space method).
    """

    nlp: Nlp
    unknowns: list[int]
    border: ca.DM
    linear: ca.Linsol

    def solve(self, z0: Array, p: Array, sides: Sides) -> NlpResult:
        """Solve for the unknowns and the multipliers, grad f + g' lambda = 0.

        Args:
            z0: (nz,) to start from; given unknowns at their values.
            p: parameters of the NLP.
            sides: bounds; equal for given unknowns and for all rows.
        """
        begun = time.perf_counter()
        z, sizes, wanted = z0.copy(), list[float](), ca.DM(sides[2].tolist())
        count, free = len(sides[2]), self.border.size1()
        lam, limits, cost, inside = np.zeros(count), np.zeros(len(z)), np.nan, 0.0
        status, message = Status.FAILED, "Newton's iteration does not converge"
        try:
            for _ in range(MOST_ITERATIONS):
                clock = time.perf_counter()
                rows, jacobian = self.nlp.derivatives["jac_g"](z, p)
                inside += time.perf_counter() - clock
                square = jacobian[:, self.unknowns]
                square = ca.vertcat(square, self.border) if free else square
                both = ca.diagcat(wanted - rows, ca.DM.eye(free)) if free else wanted - rows
                step, directions = np.split(np.array(self.linear.solve(square, ca.densify(both))), [1], axis=1)
                step, least = step.ravel(), 1.0
                if free:
                    along, least = self._chosen(z, p, square, step, directions)
                    step = step + along
                sizes.append(float(np.max(np.abs(step), initial=0.0)))
                if not sizes[-1] <= LARGEST:
                    break
                z[self.unknowns] += step
                if sizes[-1] <= ENOUGH:
                    status, message = Status.SOLVED, "solved as equations"
                    break
            value, gradient = self.nlp.derivatives["grad_f"](z, p)
            cost = float(value)
            if status is Status.SOLVED and least <= 0.0:
                status, message = Status.FAILED, "Newton's iteration leads to no minimum"
            if status is Status.SOLVED:
                result = -self.linear.solve(square, gradient[self.unknowns], True)[:count]
                lam, limits = np.array(result).ravel(), -np.array(gradient + jacobian.T @ result).ravel()
                limits[self.unknowns] = 0.0
        except RuntimeError as error:  # a matrix that cannot be factorised
            status, message = Status.FAILED, str(error).splitlines()[-1]
        seconds = time.perf_counter() - begun
        return NlpResult(z, lam, limits, cost, status, message, len(sizes), inside, seconds, {"correction": sizes})

    def _chosen(self, z: Array, p: Array, square: ca.DM, step: Array, directions: Array) -> tuple[Array, float]:
        """Return the step along the directions that the equations leave free, and the least curvature there."""
        derivatives, count = self.nlp.derivatives, square.size1() - directions.shape[1]
        gradient = derivatives["grad_f"](z, p)[1][self.unknowns]
        lam = -self.linear.solve(square, gradient, True)[:count]
        upper, whole = derivatives["hess_lag"](z, p, 1.0, lam), np.zeros((len(z), directions.shape[1]))
        whole[self.unknowns] = directions
        both = np.array(upper @ whole) + np.array(upper.T @ whole)
        bent = (both - np.array(ca.diag(upper)) * whole)[self.unknowns]
        curvature, slope = directions.T @ bent, directions.T @ np.array(gradient).ravel() + bent.T @ step
        if not np.all(np.isfinite(curvature)):
            return np.full(len(step), np.nan), 0.0
        along = -directions @ np.linalg.lstsq(curvature, slope, rcond=None)[0]
        return along, float(np.min(np.linalg.eigvalsh((curvature + curvature.T) / 2.0)))


def as_equations(nlp: Nlp, sides: Sides) -> Equations | None:
    """Return the equations of an NLP; None if there are inequalities, too many equations, or too few.

    Args:
        nlp: transcribed, its durations unknowns.
        sides: bounds of the unknowns and of the rows.
    """
    low, high, rows_low, rows_high = sides
    given = low == high
    limited = (np.isfinite(low) | np.isfinite(high)) & ~given
    unknowns = np.flatnonzero(~given)
    free = len(unknowns) - len(rows_low)
    if limited.any() or np.any(rows_low != rows_high) or not 0 <= free <= MOST_FREE:
        return None
    # The directions that the equations leave free move the switches, as a rule.
    durations = np.searchsorted(unknowns, nlp.layout.horizon)
    border = ca.DM(free, len(unknowns))
    border[:, durations.tolist()] = probes((free, len(durations)), 0.5, 1.5)
    pattern = nlp.derivatives["jac_g"].sparsity_out(1)
    chosen = ca.DM(pattern, 1.0)[:, unknowns.tolist()]
    return Equations(nlp, unknowns.tolist(), border, ca.Linsol("linear", "qr", ca.vertcat(chosen, border).sparsity()))
