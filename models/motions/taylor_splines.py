"""Interpolating splines for steps of very different lengths: derivatives at the knots as unknowns.

In the B-spline basis, and in SciPy's, the equations of a quintic spline lose all digits when one step is 1e-5 of
another. Here the unknowns are the derivatives z_k = (q', q'', ..., q^(d-1)) at every knot and the change c_k of
q^(d-1) over every step h_k, with the equations

    (q_k+1 - q_k) / h_k = q'_k + h_k/2 q''_k + ... + h_k^(d-2)/d! c_k
    z_k+1 = (Taylor series of degree d at t_k)

All entries stay of order one as a step vanishes: in the limit it prescribes q'.
"""

from __future__ import annotations

from math import factorial

import casadi as ca
import numpy as np

from models.motions.piecewise import Piecewise
from ocp.checks import Array

# CasADi's QR takes a matrix for singular below this pivot.
PIVOT = 1e-13


def interpolate(
    times: Array, points: Array, degree: int, conditions: list[tuple[int, int, Array]] | None, periodic: bool
) -> Piecewise | None:
    """Return the spline with knots at the given times, through the points; None if they do not fix it.

    Args:
        times: (K,) increasing [s].
        points: (K, n) [rad or m].
        degree: d.
        conditions: end (0 or -1), order and value (n,) of d - 1 end conditions [per s^order]; None: the (d + 1)/2
            pieces at each end are one polynomial.
        periodic: the derivatives of order 1 .. d - 1 agree at both ends.
    """
    count, n = points.shape
    unit = (times[-1] - times[0]) / (count - 1)
    h = np.diff(times) / unit
    size = degree * (count - 1) + degree - 1
    right = np.zeros((size, n))
    right[np.arange(count - 1) * degree] = np.diff(points, axis=0) / h[:, None]
    entries = _steps(h, degree)
    row = degree * (count - 1)
    for end, order, value in conditions or ():
        entries.append((row, (count - 1 if end else 0) * degree + order - 1, 1.0))
        right[row] = value * unit**order
        row += 1
    if periodic:
        for order in range(1, degree):
            entries += [(row, order - 1, 1.0), (row, (count - 1) * degree + order - 1, -1.0)]
            row += 1
    if conditions is None:
        for k in _continued(count, degree):
            longest = max(h[k], h[k + 1])
            entries += [(row, k * degree + degree - 1, h[k + 1] / longest)]
            entries += [(row, (k + 1) * degree + degree - 1, -h[k] / longest)]
            row += 1
    if row != size:
        return None
    rows, columns, values = (np.concatenate([np.ravel(part) for part in parts]) for parts in zip(*entries, strict=True))
    matrix = ca.DM.triplet(rows.astype(int).tolist(), columns.astype(int).tolist(), ca.DM(values), size, size)
    try:
        solved = np.array(ca.solve(matrix, ca.DM(right), "qr", {"eps": PIVOT})).reshape(size, n)
    except RuntimeError:
        return None
    return Piecewise(times, _coefficients(solved, points, h, degree) / (unit ** np.arange(degree + 1))[:, None])


def _steps(h: Array, degree: int) -> list[tuple[Array | int, Array | int, Array | float]]:
    """Return rows, columns and values of the Taylor equations of all steps."""
    k = np.arange(len(h))
    entries: list[tuple[Array | int, Array | int, Array | float]] = []
    for order in range(degree):
        row, scale = k * degree + order, h if order == 0 else np.ones_like(h)
        for higher in range(max(order, 1), degree):
            entries.append((row, k * degree + higher - 1, h ** (higher - order) / factorial(higher - order) / scale))
        entries.append((row, k * degree + degree - 1, h ** (degree - order - 1) / factorial(degree - order) / scale))
        if order > 0:
            entries.append((row, (k + 1) * degree + order - 1, np.full(len(h), -1.0)))
    return entries


def _continued(count: int, degree: int) -> list[int]:
    """Return the steps whose polynomial goes on in the next one: the first and the last (d - 1)/2."""
    half = (degree - 1) // 2
    first = range(min(half + (degree - 1) % 2, count - 2))
    last = range(max(count - 2 - half, len(first)), count - 2)
    return [*first, *last]


def _coefficients(solved: Array, points: Array, h: Array, degree: int) -> Array:
    """Return the coefficients (K - 1, d + 1, n) of the powers of the time, in units of the mean step."""
    count, n = points.shape
    unknowns = solved[: degree * (count - 1)].reshape(count - 1, degree, n)
    coefficients = np.empty((count - 1, degree + 1, n))
    coefficients[:, 0] = points[:-1]
    for order in range(1, degree):
        coefficients[:, order] = unknowns[:, order - 1] / factorial(order)
    coefficients[:, degree] = unknowns[:, degree - 1] / h[:, None] / factorial(degree)
    return coefficients
