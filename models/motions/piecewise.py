"""Piecewise polynomials of time: the common form of profiles, splines and smoothed samples."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array

# A derivative counts as continuous if it jumps by less than this share of its largest value.
CONTINUOUS = 1e-7
INSIDE = 1e-9  # share of a piece by which a time at its end is moved inside, to be on its side of a jump
CHUNK = 8192  # times evaluated at once: their numbers stay in the cache
DENSE = 1000  # rows of a motion that was not given at certain times


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
            raise ValueError(f"Piecewise: pieces as short as {np.min(np.diff(breaks)):.3g} s exceed double precision")
        object.__setattr__(self, "breaks", breaks)
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def degree(self) -> int:
        """Highest power."""
        return int(self.coefficients.shape[1]) - 1

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of the given order at times t, from the right at a break, shape (len(t), n)."""
        value = np.zeros((len(t), self.coefficients.shape[2]))
        if order <= self.degree:
            for start in range(0, len(t), CHUNK):
                part = slice(start, start + CHUNK)
                self._evaluate(t[part], order, value[part])
        return value

    def _evaluate(self, t: Array, order: int, value: Array) -> None:
        """Write the derivative of an order <= degree at times (K,) into value (K, n), by Horner's rule."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.coefficients) - 1)
        since = t - self.breaks[piece]
        # One time in each of successive pieces, as the rows of a recording: their coefficients need not be gathered.
        successive = piece[-1] - piece[0] == len(t) - 1 and bool(np.all(np.diff(piece) == 1))
        own = self.coefficients[piece[0] : piece[-1] + 1] if successive else self.coefficients[piece]
        if not np.any(since):
            np.multiply(own[:, order], math.factorial(order), out=value)
            return
        for i, column in enumerate(value.T):  # numpy is slow in loops over a short last axis
            for j in range(self.degree, order - 1, -1):
                column *= since
                column += own[:, j, i] * math.perm(j, order)

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


def dense(breaks: Array) -> Array:
    """Return about 1000 times: every piece from its start to its end, the end moved inside by a tiny amount.

    Args:
        breaks: (M + 1,) increasing [s].
    """
    duration = breaks[-1] - breaks[0]
    parts = []
    for first, last in itertools.pairwise(breaks):
        inside = np.linspace(first, last, max(3, math.ceil(DENSE * (last - first) / duration)) + 1)
        if last < breaks[-1]:
            inside[-1] -= INSIDE * (last - first)
        parts.append(inside)
    return np.unique(np.concatenate(parts))
