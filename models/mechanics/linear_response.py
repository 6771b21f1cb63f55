"""Response of a first-order lag and of an undamped oscillator to a piecewise linear input, integrated exactly."""

from __future__ import annotations

import numpy as np

from ocp.checks import Array


def lag_error(t: Array, values: Array, constants: Array) -> Array:
    """Return input minus output (n, K) of first-order lags T y' + y = input that start settled.

    Args:
        t: (K,) times [s], not decreasing; two equal times are a jump of the input.
        values: (n, K) input.
        constants: (n,) T [s]; NaN or 0 for a channel without a lag.
    """
    behind = np.zeros_like(values)
    settled = ~(constants > 0.0)
    constant = np.where(settled, 1.0, constants)
    error = np.zeros(len(values))
    for k in range(1, len(t)):
        step, change = t[k] - t[k - 1], values[:, k] - values[:, k - 1]
        if step <= 0.0:
            error = error + change  # the input jumps, the output does not
        else:
            # e = values - y obeys T e' + e = T values', and values' is constant on the piece.
            slope, decay = constant * change / step, np.exp(-step / constant)
            error = slope + (error - slope) * decay
        behind[:, k] = error
    behind[settled] = 0.0
    return behind


def oscillator_error(t: Array, values: Array, frequencies: Array) -> Array:
    """Return input minus output (n, K) of undamped oscillators y'' + w^2 y = w^2 input that start at rest.

    Args:
        t: (K,) times [s], not decreasing; two equal times are a jump of the input.
        values: (n, K) input.
        frequencies: (n,) w [rad/s]; NaN or 0 for a rigid channel.
    """
    apart = np.zeros_like(values)
    rigid = ~(frequencies > 0.0)
    w = np.where(rigid, 1.0, frequencies)
    error, speed = np.zeros(len(values)), np.zeros(len(values))  # e = values - y and y'
    for k in range(1, len(t)):
        step, change = t[k] - t[k - 1], values[:, k] - values[:, k - 1]
        if step <= 0.0:
            error = error + change
        else:
            slope = change / step
            # e'' + w^2 e = 0 with e' = slope - y'.
            rate = slope - speed
            c, s = np.cos(w * step), np.sin(w * step)
            error, rate = error * c + rate * s / w, rate * c - error * w * s
            speed = slope - rate
        apart[:, k] = error
    apart[rigid] = 0.0
    return apart
