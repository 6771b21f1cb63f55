"""Piecewise polynomials of time: what profiles, splines and smoothed samples have in common."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array

# A derivative counts as continuous if it jumps by less than this share of its size.
CONTINUOUS = 1e-7
INSIDE = 1e-9  # share of a piece by which its end is moved inside
DENSE = 1000  # times of a motion that has none of its own


@dataclass(frozen=True, eq=False)
class Piecewise:
    """q(t) = sum_j c_kj (t - t_k)^j on [t_k, t_k+1).

    Args:
        breaks: (M + 1,) increasing times [s].
        coefficients: (M, d + 1, n) c_kj, lowest power first.

    Raises:
        ValueError: shapes disagree, times do not increase, or a coefficient is not finite.
    """

    breaks: Array
    coefficients: Array

    def __post_init__(self) -> None:
        breaks, coefficients = np.asarray(self.breaks, dtype=float), np.asarray(self.coefficients, dtype=float)
        if coefficients.ndim != 3 or breaks.shape != (len(coefficients) + 1,):
            raise ValueError(
                f"Piecewise: breaks {breaks.shape}, coefficients {coefficients.shape}, expected (M + 1,), (M, d + 1, n)"
            )
        if not np.all(np.diff(breaks) > 0.0):
            raise ValueError("Piecewise: breaks must increase")
        if not np.all(np.isfinite(coefficients)):
            raise ValueError(
                f"Piecewise: pieces as short as {np.min(np.diff(breaks)):.3g} s go beyond double precision"
            )
        object.__setattr__(self, "breaks", breaks)
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def degree(self) -> int:
        """Highest power."""
        return int(self.coefficients.shape[1]) - 1

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of the given order at times t, from the right at a break, shape (len(t), n)."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.coefficients) - 1)
        since = (t - self.breaks[piece])[:, None]
        value = np.zeros((len(t), self.coefficients.shape[2]))
        for j in range(self.degree, order - 1, -1):
            value = value * since + self.coefficients[piece, j] * math.perm(j, order)
        return value

    def smoothness(self) -> int:
        """Return the highest order whose derivative, and all below it, is continuous; -1 if q itself jumps."""
        inner, width = self.breaks[1:-1], np.diff(self.breaks)
        for order in range(self.degree + 1):
            if not len(inner):
                break
            before = np.zeros((len(inner), self.coefficients.shape[2]))
            for j in range(self.degree, order - 1, -1):
                before = before * width[:-1, None] + self.coefficients[:-1, j] * math.perm(j, order)
            jump = np.abs(self.coefficients[1:, order] * math.factorial(order) - before)
            size = np.max(np.abs(self.coefficients[:, order:]).sum(axis=1), axis=0) + np.max(np.abs(before), axis=0)
            if np.any(jump > CONTINUOUS * np.maximum(size * math.factorial(order), 1e-300)):
                return order - 1
        return self.degree


def hermite(times: Array, values: Array) -> Piecewise:
    """Return the piecewise polynomial of degree 2 m - 1 through q, v, ... up to order m - 1 at every time.

    Args:
        times: (K,) increasing [s].
        values: (K, m, n) derivatives of order 0 .. m - 1 at the times.

    Source: the two-point Taylor (Hermite) interpolant, solved once in the unit interval.
    """
    m = values.shape[1]
    width = np.diff(times)[:, None]
    # In s = (t - t_k) / h the derivatives at both ends fix the 2 m coefficients by one constant matrix.
    ends = np.zeros((2 * m, 2 * m))
    for order in range(m):
        ends[order, order] = math.factorial(order)
        ends[m + order] = [math.perm(j, order) if j >= order else 0.0 for j in range(2 * m)]
    powers = width[:, :, None] ** np.arange(m)[None, :, None]
    known = np.concatenate([values[:-1] * powers, values[1:] * powers], axis=1)
    # Its inverse times (m - 1)! holds integers: without the rounding of the machine's linear algebra.
    whole = math.factorial(m - 1)
    inverse = np.rint(np.linalg.inv(ends) * whole) / whole
    in_unit = np.tensordot(known, inverse, axes=(1, 1)).swapaxes(1, 2)
    with np.errstate(all="ignore"):  # Piecewise refuses what overflows
        coefficients = in_unit / width[:, :, None] ** np.arange(2 * m)[None, :, None]
    return Piecewise(times, coefficients)


def dense(breaks: Array) -> Array:
    """Return times that show every piece from its start to its end, the end seen from inside.

    Args:
        breaks: (M + 1,) increasing [s].
    """
    span = breaks[-1] - breaks[0]
    parts = []
    for first, last in itertools.pairwise(breaks):
        inside = np.linspace(first, last, max(3, math.ceil(DENSE * (last - first) / span)) + 1)
        if last < breaks[-1]:
            inside[-1] -= INSIDE * (last - first)
        parts.append(inside)
    return np.unique(np.concatenate(parts))
