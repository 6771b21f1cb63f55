"""Times between the rows of a table at which a motion must be evaluated, so that nothing between them is missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array

# Largest distance between a quantity and the straight line between two times, as a share of its largest value.
TOLERANCE = 5e-5
PROBES = (0.29, 0.68)  # of a step, away from its middle: symmetric motions cross the straight line there
DEPTH = 14  # refinements of one step, each by three
MOST = 2_000_000  # times added
CHUNK = 8192  # steps looked at together: their numbers stay in the cache
GROWTH = 1.01  # a peak that grows by this factor in each of the last refinements has no bound
LAST = 5
NARROW = 1e-8  # share of the duration; shorter steps are the two sides of a jump


@dataclass(frozen=True, eq=False)
class Refined:
    """Quantities at times between which they are linear to within the tolerance."""

    t: Array  # (K,) increasing [s]
    values: Array  # (K, m)
    growing: Array  # (m,) whether the peak of the quantity kept growing: it has no bound
    coarse: bool  # whether the tolerance was not reached


def refine(t: Array, values: Array, evaluate: Callable[[Array], Array], watched: Array, still: Array) -> Refined:
    """Add times until the watched quantities are linear between neighbouring times.

    Every step is probed at two points. If one is off the straight line by more than TOLERANCE of the largest value of
    its quantity, the three parts of the step are probed again.

    Args:
        t: (K,) increasing [s].
        values: (K, m) quantities at these times.
        evaluate: times (L,) -> (L, m).
        watched: columns that must be resolved.
        still: (K - 1,) steps that need no probe, as the motion is known to be straight there.
    """
    open_steps = np.flatnonzero(~still & (np.diff(t) > NARROW * (t[-1] - t[0])))
    first, last = (t[open_steps], values[open_steps]), (t[open_steps + 1], values[open_steps + 1])
    times, parts = [t], [values]
    peaks = [np.max(np.abs(values), axis=0)]
    added = 0
    for _ in range(DEPTH):
        if not len(first[0]) or added > MOST:
            break
        width, change = last[0] - first[0], last[1] - first[1]
        probed = []
        bent = np.zeros(len(first[0]), dtype=bool)
        scale = peaks[-1]
        for fraction in PROBES:
            at = first[0] + fraction * width
            result = evaluate(at)
            scale = np.maximum(scale, np.max(np.abs(result), axis=0))
            probed.append((at, result))
        for fraction, (_, result) in zip(PROBES, probed, strict=True):
            apart = np.abs(result - first[1] - fraction * change)[:, watched]
            bent |= np.any(apart > TOLERANCE * np.maximum(scale, 1e-9 * np.max(scale))[watched], axis=1)
        peaks.append(scale)
        for at, result in probed:
            times.append(at)
            parts.append(result)
            added += len(at)
        ends = [first, *probed, last]
        # A step of the width of rounding cannot be split.
        bent &= width > 1e-12 * (t[-1] - t[0])
        first, last = _joined(ends[:-1], bent), _joined(ends[1:], bent)
    coarse = len(first[0]) > 0
    growing = np.zeros(values.shape[1], dtype=bool)
    if coarse and len(peaks) > LAST:
        recent = np.stack(peaks[-LAST - 1 :])
        growing = np.all(recent[1:] > GROWTH * recent[:-1], axis=0)
    if len(times) == 1:
        return Refined(t, values, growing, coarse)
    every, order = np.unique(np.concatenate(times), return_index=True)
    return Refined(every, np.concatenate(parts)[order], growing, coarse)


def with_knots(t: Array, knots: Array, jumps: bool) -> Array:
    """Return the times (L,) that must be added to rows so that no step reaches across a knot of the motion.

    Args:
        t: (K,) rows, increasing [s].
        knots: times at which a derivative of the motion jumps [s].
        jumps: whether the accelerations jump there, so that a second time just before each knot is needed.
    """
    inside = knots[(knots > t[0]) & (knots < t[-1])]
    if jumps and len(inside):
        inside = np.concatenate([inside, inside - 0.1 * NARROW * (t[-1] - t[0])])
    if len(inside) == len(t) - 2 and np.array_equal(inside, t[1:-1]):
        return np.empty(0)  # a recording: every row is a knot
    return np.setdiff1d(inside, t)


def straight(t: Array, q: Array, v: Array, a: Array, tau: Array, derivative: Callable[[Array, int], Array]) -> Array:
    """Return the steps (K - 1,) on which the motion is straight and the torques hardly change: they need no probe.

    Velocity and acceleration at one point of the step must lie on the straight line between its ends, and position and
    torque must change so little that the curvature of the torque is below the tolerance.

    Args:
        t: (K,) increasing [s].
        q, v, a, tau: (K, n) of the motion.
        derivative: times and order -> (L, n).
    """
    # Differences that count as small, of positions, torques, velocities and accelerations.
    turn = 0.01 * np.minimum(1.0, _peaks(q) + 1e-300)
    pull, apart = 0.01 * _peaks(tau), [TOLERANCE * _peaks(rows) for rows in (v, a)]
    calm = np.empty(len(t) - 1, dtype=bool)
    for start in range(0, len(calm), CHUNK):
        part, ends = slice(start, start + CHUNK), slice(start, start + CHUNK + 1)
        calm[part] = _within(np.diff(q[ends], axis=0), turn) & _within(np.diff(tau[ends], axis=0), pull)
        chosen = np.flatnonzero(calm[part])
        if not len(chosen):
            continue
        every = len(chosen) == len(calm[part])
        first: slice | Array = slice(0, -1) if every else chosen
        last: slice | Array = slice(1, None) if every else chosen + 1
        at = t[ends][first] + PROBES[0] * (t[ends][last] - t[ends][first])
        for order, rows, most in ((1, v[ends], apart[0]), (2, a[ends], apart[1])):
            line = (1.0 - PROBES[0]) * rows[first] + PROBES[0] * rows[last]
            calm[start + chosen] &= _within(derivative(at, order) - line, most)
    return calm


def _within(values: Array, most: Array) -> Array:
    """Return in which rows (K,) no column exceeds its own bound; by columns, as numpy is slow along short rows."""
    results = np.ones(len(values), dtype=bool)
    for column, bound in zip(values.T, most, strict=True):
        results &= np.abs(column) <= bound
    return results


def _peaks(values: Array) -> Array:
    """Return the largest absolute value of every column (n,)."""
    return np.array([max(column.max(), -column.min()) for column in values.T])


def _joined(sides: list[tuple[Array, Array]], chosen: Array) -> tuple[Array, Array]:
    return np.concatenate([t[chosen] for t, _ in sides]), np.concatenate([values[chosen] for _, values in sides])
