"""A programme with as many equations as unknowns: nothing is left to choose, so Newton's iteration solves it."""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.ipopt import Answer
from ocp.programme import Programme
from ocp.solution import Status

Array = np.ndarray
Sides = tuple[Array, Array, Array, Array]  # lower and upper bounds of unknowns, then of rows
ENOUGH = 1e-9  # of the scaled unknowns; the next correction would be rounding, as convergence is quadratic
MOST_ITERATIONS = 8
LARGEST = 1e3  # correction of a scaled unknown after which there is nothing near


@dataclass(frozen=True, eq=False)
class Equations:
    """g(z) = b in the unknowns that are not given; made by `as_equations`.

    Args:
        programme: whose rows they are.
        places: of the unknowns that are not given.
        linear: solver with the Jacobian by them, sparse QR.
    """

    programme: Programme
    places: list[int]
    linear: ca.Linsol

    def solve(self, z0: Array, p: Array, sides: Sides) -> Answer:
        """Solve for the unknowns, then for the multipliers: grad f + J' lambda = 0.

        Args:
            z0: (nz,) to start from; given unknowns at their values.
            p: parameters of the programme.
            sides: bounds; equal for given unknowns and for all rows.
        """
        begun = time.perf_counter()
        derivatives, z, wanted = self.programme.derivatives, z0.copy(), sides[2]
        inside, sizes, words, status = 0.0, [], "Newton's iteration does not converge", Status.FAILED
        lam, limits, cost = np.zeros(len(wanted)), np.zeros(len(z)), np.nan
        try:
            for _ in range(MOST_ITERATIONS):
                clock = time.perf_counter()
                rows, jacobian = derivatives["jac_g"](z, p)
                inside += time.perf_counter() - clock
                square = jacobian[:, self.places]
                missing = np.array(rows).ravel() - wanted
                step = np.array(self.linear.solve(square, ca.DM(missing.tolist()))).ravel()
                sizes.append(float(np.max(np.abs(step), initial=0.0)))
                if not sizes[-1] <= LARGEST:
                    break
                z[self.places] -= step
                if sizes[-1] <= ENOUGH:
                    words, status = "solved as equations", Status.SOLVED
                    break
            value, gradient = derivatives["grad_f"](z, p)
            cost = float(value)
            if status is Status.SOLVED:
                lam = -np.array(self.linear.solve(square, gradient[self.places], True)).ravel()
                limits = -np.array(gradient + jacobian.T @ ca.DM(lam.tolist())).ravel()
                limits[self.places] = 0.0
        except RuntimeError as error:  # a matrix that cannot be factorised
            words, status = str(error).splitlines()[-1], Status.FAILED
        seconds = time.perf_counter() - begun
        return Answer(z, lam, limits, cost, status, words, len(sizes), inside, seconds, {"correction": sizes})


def as_equations(programme: Programme, sides: Sides) -> Equations | None:
    """Return a programme as equations, or None if there are more or fewer of them than unknowns, or inequalities.

    Args:
        programme: transcribed.
        sides: bounds of the unknowns and of the rows.
    """
    low, high, rows_low, rows_high = sides
    given = low == high
    limited = (np.isfinite(low) | np.isfinite(high)) & ~given
    if limited.any() or np.any(rows_low != rows_high) or np.sum(~given) != len(rows_low):
        return None
    places = np.flatnonzero(~given).tolist()
    pattern = programme.derivatives["jac_g"].sparsity_out(1)
    chosen = ca.DM(pattern, 1.0)[:, places].sparsity()
    return Equations(programme, places, ca.Linsol("linear", "qr", chosen))
