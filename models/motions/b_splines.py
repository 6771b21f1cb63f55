"""B-splines: values, interpolation by collocation, conversion to piecewise polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import casadi as ca
import numpy as np

from models.motions.piecewise import Piecewise
from ocp.checks import Array

Rows = tuple[Array, Array]  # columns (K, m) and values (K, m) of the entries of K rows


def interpolate(
    times: Array, points: Array, degree: int, conditions: list[tuple[int, int, Array]] | None, periodic: bool
) -> Piecewise | None:
    """Return the spline with knots at the given times, through the points; None if they do not fix it.

    Args:
        times: (K,) increasing [s].
        points: (K, n) [rad or m].
        degree: d.
        conditions: end (0 or -1), order and value (n,) of d - 1 end conditions [per s^order]; None: the pieces at
            each end are one polynomial.
        periodic: the derivatives of order 1 .. d - 1 agree at both ends.

    Source: C. de Boor, A Practical Guide to Splines, XIII (collocation in the B-spline basis).
    """
    n = points.shape[1]
    # Time in units of the mean step, or high degrees lose digits in powers of small steps.
    unit = (times[-1] - times[0]) / (len(times) - 1)
    s = (times - times[0]) / unit
    skipped = (degree + 1) // 2 if conditions is None else 1
    # An even degree is that of one polynomial through all points.
    inner = slice(skipped, len(s) - skipped) if degree % 2 else slice(0, 0)
    knots = np.concatenate([np.repeat(s[0], degree + 1), s[inner], np.repeat(s[-1], degree + 1)])
    rows, right = [basis_rows(knots, degree, s, 0)], [points]
    if periodic:
        for order in range(1, degree):
            first, last = (basis_rows(knots, degree, s[[k]], order) for k in (0, -1))
            rows.append(_scaled((np.hstack([first[0], last[0]]), np.hstack([first[1], -last[1]])))[0])
            right.append(np.zeros((1, n)))
    for end, order, value in conditions or ():
        row, scale = _scaled(basis_rows(knots, degree, s[[end]], order))
        rows.append(row)
        right.append(value[None] * unit**order / scale)
    try:
        matrix = _sparse(rows, len(knots) - degree - 1)
        solved = ca.solve(matrix, ca.DM(np.vstack(right)), "qr")
    except RuntimeError:
        return None
    spline = as_piecewise(knots, degree, np.array(solved).reshape(-1, n))
    powers = unit ** np.arange(degree + 1)
    breaks = np.concatenate([times[:1], times[inner], times[-1:]])
    return Piecewise(breaks, spline.coefficients / powers[:, None])


def basis_rows(knots: Array, degree: int, t: Array, order: int) -> Rows:
    """Return the derivative of the d + 1 B-splines that do not vanish at each t.

    Args:
        knots: (m,) not decreasing, the ends d + 1 times.
        degree: d.
        t: (K,) within the knots.
        order: of the derivative, <= d.

    Returns:
        columns (K, d + 1): their numbers; values (K, d + 1).

    Source: C. de Boor, A Practical Guide to Splines, X (recurrence and derivative).
    """
    span = np.clip(np.searchsorted(knots, t, side="right") - 1, degree, len(knots) - degree - 2)
    values = np.ones((len(t), 1))
    for d in range(1, degree + 1):
        new = np.zeros((len(t), d + 1))
        for i in range(d):
            left, right = knots[span + i + 1 - d], knots[span + i + 1]
            width = right - left
            if d <= degree - order:
                new[:, i] += (right - t) / width * values[:, i]
                new[:, i + 1] += (t - left) / width * values[:, i]
            else:
                new[:, i] -= d / width * values[:, i]
                new[:, i + 1] += d / width * values[:, i]
        values = new
    return span[:, None] + np.arange(-degree, 1), values


def as_piecewise(knots: Array, degree: int, coefficients: Array) -> Piecewise:
    """Return a B-spline as a piecewise polynomial in powers of t - t_k.

    Args:
        knots: (m,) not decreasing, the ends d + 1 times.
        degree: d.
        coefficients: (m - d - 1, n).
    """
    breaks = np.unique(knots)
    taylor = np.zeros((len(breaks) - 1, degree + 1, coefficients.shape[1]))
    for order in range(degree + 1):
        columns, values = basis_rows(knots, degree, breaks[:-1], order)
        taylor[:, order] = np.einsum("kd,kdn->kn", values, coefficients[columns]) / factorial(order)
    return Piecewise(breaks, taylor)


def _scaled(row: Rows) -> tuple[Rows, float]:
    """Return a row divided by its largest entry, and that entry: unscaled rows of high derivatives cost digits."""
    columns, values = row
    scale = float(np.max(np.abs(values)))
    return (columns, values / scale), scale


def _sparse(rows: Sequence[Rows], size: int) -> ca.DM:
    """Return a sparse matrix of `size` columns from blocks of rows."""
    entries: list[tuple[Array, Array, Array]] = []
    count = 0
    for columns, values in rows:
        at = np.repeat(np.arange(count, count + len(columns)), columns.shape[1])
        entries.append((at, columns.ravel(), values.ravel()))
        count += len(columns)
    at, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    # ca.DM.triplet keeps the first of two entries at the same index instead of their sum.
    index, inverse = np.unique(at * size + columns, return_inverse=True)
    total = np.bincount(inverse.ravel(), values)
    return ca.DM.triplet((index // size).tolist(), (index % size).tolist(), ca.DM(total), count, size)
