"""Piecewise polynomials through given derivatives at every time."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from models.motions.piecewise import Piecewise
from ocp.checks import Array


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
    # h^0, h^1, ... (K - 1, 2 m, 1) by products, which are ten times faster than powers
    powers = np.cumprod(np.concatenate([np.ones_like(width), np.repeat(width, 2 * m - 1, axis=1)], axis=1), axis=1)
    powers = powers[:, :, None]
    known = np.concatenate([values[:-1] * powers[:, :m], values[1:] * powers[:, :m]], axis=1)
    # The inverse times (m - 1)! has integer entries; rounding to them removes the error of the numerical inverse.
    whole = math.factorial(m - 1)
    inverse = np.rint(np.linalg.inv(ends) * whole) / whole
    with np.errstate(all="ignore"):  # Piecewise refuses what overflows
        coefficients = (inverse @ known) / powers
    return Piecewise(times, coefficients)


def accelerations(times: Array, q: Array, v: Array) -> Array:
    """Return the accelerations (K, n) that make the quintic Hermite spline through q and v continuous in its jerk.

    The jerk vanishes at both ends.

    Args:
        times: (K,) increasing [s].
        q, v: (K, n) positions and velocities at the times.

    Source: H. Spaeth, One Dimensional Spline Interpolation Algorithms, 5 (quintic splines with given slopes).
    """
    h = np.diff(times)[:, None]
    step = np.diff(q, axis=0)
    # jerk h^2 at the left and the right end of a piece, without its part from the accelerations
    left = (60.0 * step / h - (36.0 * v[:-1] + 24.0 * v[1:])) / h
    right = (60.0 * step / h - (24.0 * v[:-1] + 36.0 * v[1:])) / h
    count = len(times)
    diagonal, beside, known = np.zeros(count), -3.0 / h[:, 0], np.zeros_like(q)
    diagonal[:-1] += 9.0 / h[:, 0]
    diagonal[1:] += 9.0 / h[:, 0]
    known[:-1] += left / h
    known[1:] -= right / h
    i = np.arange(count)
    rows, columns = np.concatenate([i, i[1:], i[:-1]]), np.concatenate([i, i[:-1], i[1:]])
    entries = ca.DM(np.concatenate([diagonal, beside, beside]))
    matrix = ca.DM.triplet(rows.tolist(), columns.tolist(), entries, count, count)
    return np.array(ca.solve(matrix, ca.DM(known), "qr")).reshape(q.shape)
