"""Adaptive integration of x' = f(t, x) by extrapolation, to tolerances near rounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
Rate = Callable[[float, Array], Array]

COLUMNS = 8  # of the extrapolation table: order 16
SAFETY = 0.7
SHRINK, GROW = 0.1, 4.0  # limits of one change of the step
MOST_STEPS = 100_000


@dataclass(frozen=True)
class Step:
    """Result of an integration over one interval."""

    x: Array  # (nx,) state at the end
    step: float  # proposal for the next step [s]
    reached: float  # time reached [s]; short of the end if the step vanished or f is not finite


@np.errstate(over="ignore", invalid="ignore")  # a step that is not finite is rejected
def integrate(
    rate: Rate, t0: float, t1: float, x0: Array, rtol: float, atol: Array | float, first: float = 0.0
) -> Step:
    """Integrate a smooth ODE from t0 to t1 with steps of order 16.

    The modified midpoint rule with 2, 4, ..., 16 substeps has an error expansion in even powers of the step; Aitken-
    Neville extrapolation removes the first seven. The last two diagonal entries estimate the error.

    Args:
        rate: f(t, x) -> (nx,).
        t0, t1: interval [s], t1 > t0.
        x0: (nx,).
        rtol, atol: tolerance of one step, atol scalar or (nx,).
        first: first step to try [s]; 0 for the interval.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9 (Gragg-Bulirsch-Stoer).
    """
    t, x = t0, np.array(x0, dtype=float)
    step = min(first, t1 - t0) if first > 0.0 else t1 - t0
    for _ in range(MOST_STEPS):
        if t >= t1:
            break
        h = t1 - t if t + step * (1.0 + 1e-9) >= t1 else step
        new, error = _extrapolate(rate, t, x, h, rtol, atol)
        if error <= 1.0:
            t, x = (t1 if h == t1 - t else t + h), new
        factor = SAFETY * error ** (-1.0 / (2 * COLUMNS - 1)) if error > 0.0 else GROW
        proposal = h * float(np.clip(factor, SHRINK, GROW))
        if error <= 1.0 and h < step:
            proposal = max(proposal, step)  # a last short piece says nothing about the step
        step = proposal
        if step < 1e-14 * max(abs(t), t1 - t0):
            return Step(x, step, t)
    return Step(x, step, t)


def _extrapolate(rate: Rate, t: float, x: Array, h: float, rtol: float, atol: Array | float) -> tuple[Array, float]:
    """Return the extrapolated state after h and the error in units of the tolerance (inf if not finite)."""
    slope = rate(t, x)
    table: list[Array] = []
    error = np.inf
    for k in range(COLUMNS):
        substeps = 2 * (k + 1)
        column = [_midpoint(rate, t, x, slope, h, substeps)]
        for j in range(1, k + 1):
            ratio = (substeps / (substeps - 2.0 * j)) ** 2
            column.append(column[j - 1] + (column[j - 1] - table[j - 1]) / (ratio - 1.0))
        if k == COLUMNS - 1:
            size = np.asarray(atol) + rtol * np.maximum(np.abs(x), np.abs(column[-1]))
            error = float(np.max(np.abs(column[-1] - column[-2]) / size, initial=0.0))
        table = column
    return table[-1], error if np.isfinite(error) else np.inf


def _midpoint(rate: Rate, t: float, x: Array, slope: Array, h: float, substeps: int) -> Array:
    """Return Gragg's modified midpoint rule after h; the smoothing step is left out, as an even number needs none."""
    small = h / substeps
    before, now = x, x + small * slope
    for k in range(1, substeps):
        before, now = now, before + 2.0 * small * rate(t + k * small, now)
    return now
