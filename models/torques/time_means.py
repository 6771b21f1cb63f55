"""Means over time of quantities sampled at any times: the one definition for every rms and energy of a motion."""

from __future__ import annotations

import numpy as np

from ocp.checks import Array

CHUNK = 8192  # steps looked at together: their numbers stay in the cache


def rms(t: Array, values: Array) -> Array:
    """Return the root mean square over time of quantities that are linear between the times, shape (n,).

    sqrt(1/T integral f^2 dt), with the mean square (f_k^2 + f_k f_k+1 + f_k+1^2) / 3 on a step

    Args:
        t: (K,) increasing [s].
        values: (K, n).
    """
    step = np.diff(t)
    # Two dot products for each column instead of the square of every step: a million rows stay cheap.
    squares = np.einsum("k,kn,kn->n", _weights(t), values, values) * 2.0
    products = np.einsum("k,kn,kn->n", step, values[:-1], values[1:])
    return np.asarray(np.sqrt(np.maximum(squares + products, 0.0) / 3.0 / (t[-1] - t[0])))


def rms_of_samples(t: Array, values: Array) -> Array:
    """Return the root mean square over time of quantities without a course between the times (noise), shape (n,).

    Args:
        t: (K,) increasing [s].
        values: (K, n).
    """
    return np.asarray(np.sqrt(_weights(t) @ values**2 / (t[-1] - t[0])))


def positive_part(t: Array, values: Array) -> Array:
    """Return the integral over time of max(f, 0) of quantities that are linear between the times, shape (n,).

    Args:
        t: (K,) increasing [s].
        values: (K, n).
    """
    step, results = np.diff(t), np.zeros(values.shape[1])
    for start in range(0, len(step), CHUNK):
        width, ends = step[start : start + CHUNK], values[start : start + CHUNK + 1]
        for i, column in enumerate(ends.T):
            first, last = column[:-1], column[1:]
            area = np.maximum(first + last, 0.0) / 2.0
            crossing = np.flatnonzero((first < 0.0) != (last < 0.0))
            high, low = np.maximum(first, last)[crossing], np.minimum(first, last)[crossing]
            area[crossing] = high**2 / (high - low) / 2.0
            results[i] += width @ area
    return results


def runs(flags: Array) -> list[tuple[int, int]]:
    """Return the index of the first True of every run of them in flags (K,), and the index after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(after)) for first, after in edges.reshape(-1, 2)]


def crossings(t: Array, excess: Array) -> list[tuple[int, int, float, float]]:
    """Return the runs in which a quantity (K,) is above zero: first and after, and the times of the two crossings."""
    results = []
    for first, after in runs(excess > 0.0):
        start, end = float(t[first]), float(t[after - 1])
        if first > 0 and np.isfinite(excess[first - 1]) and np.isfinite(excess[first]):
            start -= (t[first] - t[first - 1]) * float(excess[first] / (excess[first] - excess[first - 1]))
        if after < len(t) and np.isfinite(excess[after]) and np.isfinite(excess[after - 1]):
            end += (t[after] - t[after - 1]) * float(excess[after - 1] / (excess[after - 1] - excess[after]))
        results.append((first, after, float(start), float(end)))
    return results


def _weights(t: Array) -> Array:
    """Return the weights of the trapezoidal rule (K,) [s]."""
    step = np.diff(t)
    weights = np.zeros(len(t))
    weights[:-1] += step / 2.0
    weights[1:] += step / 2.0
    return weights
