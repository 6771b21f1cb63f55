"""Adaptive integration of x' = f(t, x) by extrapolation, to tolerances near rounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
Rate = Callable[[float, Array], Array]
Rounding = Callable[[float, Array], Array]

COLUMNS = 8  # of the extrapolation table: order 16
SAFETY = 0.7
SHRINK, GROW = 0.1, 4.0  # limits of one change of the step
MOST_STEPS = 100_000
AMPLIFIED = 20.0  # root of the sum of the squared weights of the last entry, 69, times that of rounding, 0.29 eps
TORN = 2.0  # tolerances between the two extrapolations: their constants differ, a torn motion is off by far more


@dataclass(frozen=True)
class Step:
    """Result of an integration over one interval."""

    x: Array  # (nx,) state at the end
    step: float  # proposal for the next step [s]
    reached: float  # time reached [s]; short of the end if the step vanished, f is not finite or steps ran out
    exhausted: bool = False  # whether the steps ran out


@np.errstate(over="ignore", invalid="ignore")  # a step that is not finite is rejected
def integrate(
    rate: Rate,
    t0: float,
    t1: float,
    x0: Array,
    rtol: float,
    atol: Array | float,
    first: float = 0.0,
    *,
    rounding: Rounding | None = None,
    steps: int = MOST_STEPS,
) -> Step:
    """Integrate a smooth ODE from t0 to t1 with steps of order 16.

    The modified midpoint rule with 2, 4, ..., 16 substeps has an error expansion in even powers of the step; Aitken-
    Neville extrapolation removes the first seven. The last two diagonal entries estimate the error. The rule carries
    two chains of states, at even and odd places; where f has a jump or a thin layer, each may settle on its own side
    of it, and the extrapolation agrees with itself on a wrong motion. So an accepted step also agrees with the
    extrapolation of Gragg's smoothed values, which mix the chains.

    Args:
        rate: f(t, x) -> (nx,).
        t0, t1: interval [s], t1 > t0.
        x0: (nx,).
        rtol, atol: tolerance of one step, atol scalar or (nx,).
        first: first step to try [s]; 0 for the interval.
        rounding: (t, x) -> (nx,) uncertainty of f by rounding: no step is held to more than that; None for none.
        steps: most of them, those rejected included.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9 (Gragg-Bulirsch-Stoer; the
        smoothing is (9.13c)).
    """
    t, x = t0, np.array(x0, dtype=float)
    step = min(first, t1 - t0) if first > 0.0 else t1 - t0
    noise = rounding(t, x) if rounding else np.zeros(len(x))
    for _ in range(steps):
        if t >= t1:
            return Step(x, step, t)
        h = t1 - t if t + step * (1.0 + 1e-9) >= t1 else step
        new, error = _extrapolate(rate, t, x, h, rtol, atol, h * noise)
        if error <= 1.0:
            t, x = (t1 if h == t1 - t else t + h), new
            noise = rounding(t, x) if rounding else noise
        factor = SAFETY * error ** (-1.0 / (2 * COLUMNS - 1)) if error > 0.0 else GROW
        proposal = h * float(np.clip(factor, SHRINK, GROW))
        if error <= 1.0 and h < step:
            proposal = max(proposal, step)  # a last short piece says nothing about the step
        step = proposal
        if step < 1e-14 * max(abs(t), t1 - t0):
            return Step(x, step, t)
    return Step(x, step, t, exhausted=t < t1)


def _extrapolate(
    rate: Rate, t: float, x: Array, h: float, rtol: float, atol: Array | float, noise: Array
) -> tuple[Array, float]:
    """Return the extrapolated state after h and the error in units of the tolerance (inf if not finite).

    Args:
        rate, t, x, h, rtol, atol: as in `integrate`.
        noise: (nx,) what the rounding of f makes of x in h.
    """
    with np.errstate(all="ignore"):  # what overflows is rejected
        slope = rate(t, x)
        chains = [_midpoint(rate, t, x, slope, h, 2 * (k + 1)) for k in range(COLUMNS)]
        new, before = _neville([now for now, _ in chains])
        size = np.asarray(atol) + rtol * np.maximum(np.abs(x), np.abs(new)) + AMPLIFIED * noise
        # Rounding does not shrink with the step like the rest of the estimate: it shall not choose the step.
        error = float(np.max(np.maximum(np.abs(new - before) - 2.0 * noise, 0.0) / size, initial=0.0))
        if error <= 1.0:
            ends = [(now + last + h / (2 * k + 2) * rate(t + h, now)) / 2.0 for k, (now, last) in enumerate(chains)]
            apart = float(np.max(np.abs(new - _neville(ends)[0]) / size, initial=0.0))
            error = error if apart <= TORN else apart
    return new, error if np.isfinite(error) else np.inf


def _neville(columns: list[Array]) -> tuple[Array, Array]:
    """Return the last two entries of the table over 2, 4, ... substeps, extrapolated in squares of the step."""
    table: list[Array] = []
    for k, first in enumerate(columns):
        row = [first]
        for j in range(1, k + 1):
            ratio = ((k + 1.0) / (k + 1.0 - j)) ** 2
            row.append(row[j - 1] + (row[j - 1] - table[j - 1]) / (ratio - 1.0))
        table = row
    return table[-1], table[-2]


def _midpoint(rate: Rate, t: float, x: Array, slope: Array, h: float, substeps: int) -> tuple[Array, Array]:
    """Return Gragg's modified midpoint rule after h, not smoothed, and the state one substep before."""
    small = h / substeps
    before, now = x, x + small * slope
    for k in range(1, substeps):
        before, now = now, before + 2.0 * small * rate(t + k * small, now)
    return now, before
