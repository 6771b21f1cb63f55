"""Interpolating splines of any degree with chosen end conditions, by B-spline collocation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import factorial

import casadi as ca
import numpy as np

from models.motions.piecewise import Piecewise
from ocp import checks
from ocp.checks import Array


@dataclass(frozen=True, eq=False)
class Ends:
    """What a spline of degree d does at its ends: d - 1 conditions in all.

    Args:
        start, end: order of a derivative -> its value, (n,) or scalar [rad or m, per s^order].
        periodic: the derivatives of order 1 .. d - 1 agree at both ends instead.
    """

    start: Mapping[int, float | Sequence[float] | Array] = field(default_factory=dict)
    end: Mapping[int, float | Sequence[float] | Array] = field(default_factory=dict)
    periodic: bool = False


def check_degree(degree: object) -> None:
    """Refuse a degree of a spline that is not an odd number from 3 to 99."""
    whole = isinstance(degree, int | np.integer) and not isinstance(degree, bool)
    if not whole or not 3 <= degree <= 99 or degree % 2 == 0:  # type: ignore[operator]
        raise checks.refused("degree", degree, "an odd number >= 3, such as 5")


def at_rest(degree: int) -> Ends:
    """Return the ends of a motion that starts and stops: the derivatives of order 1 .. (d - 1)/2 are zero."""
    check_degree(degree)
    orders = range(1, (degree - 1) // 2 + 1)
    return Ends(dict.fromkeys(orders, 0.0), dict.fromkeys(orders, 0.0))


def natural(degree: int) -> Ends:
    """Return the ends that leave the motion free: the derivatives of order (d + 1)/2 .. d - 1 are zero."""
    check_degree(degree)
    orders = range((degree + 1) // 2, degree)
    return Ends(dict.fromkeys(orders, 0.0), dict.fromkeys(orders, 0.0))


def interpolate(times: Array, points: Array, degree: int, ends: Ends) -> Piecewise:
    """Return the spline of odd degree with knots at the given times, through the points.

    Args:
        times: (K,) increasing [s].
        points: (K, n) [rad or m].
        degree: 3, 5, 7 ...; d - 1 derivatives are continuous.
        ends: d - 1 conditions, such as at_rest(d) or natural(d).

    Raises:
        ValueError: an even degree, another number of conditions, or periodic ends of different positions.

    Source: C. de Boor, A Practical Guide to Splines, XIII (collocation in the B-spline basis).
    """
    check_degree(degree)
    checks.instance("ends", ends, Ends, "Ends, such as at_rest(5) or natural(5), or None")
    n = points.shape[1]
    # The unknowns are those of time in units of the mean step, or high degrees lose digits in powers of small steps.
    unit = (times[-1] - times[0]) / (len(times) - 1)
    s = (times - times[0]) / unit
    knots = np.concatenate([np.repeat(s[0], degree), s, np.repeat(s[-1], degree)])
    value_rows = basis_rows(knots, degree, s, 0)
    condition_rows, condition_values = [], []
    if ends.periodic:
        if not np.allclose(points[0], points[-1], rtol=0.0, atol=1e-9):
            raise ValueError("ends: periodic, but the first and the last waypoint differ")
        for order in range(1, degree):
            first, last = (basis_rows(knots, degree, s[[k]], order) for k in (0, -1))
            condition_rows.append(_difference(first, last))
            condition_values.append(np.zeros(n))
    for place, conditions in ((0, ends.start), (-1, ends.end)):
        for order, value in conditions.items():
            if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order < degree:
                raise ValueError(f"ends: a condition on derivative {order}, expected 1 .. {degree - 1}")
            given = checks.numbers(f"ends: derivative {order}", value) * unit**order
            if given.size not in (1, n):
                raise ValueError(f"ends: derivative {order} has {given.size} components, expected 1 or {n}")
            condition_rows.append(basis_rows(knots, degree, s[[place]], order))
            condition_values.append(np.broadcast_to(given, (n,)))
    if len(condition_rows) != degree - 1:
        raise ValueError(
            f"ends: {len(condition_rows)} conditions, a spline of degree {degree} needs {degree - 1}; "
            f"use at_rest({degree}) or natural({degree})"
        )
    rows = [value_rows, *condition_rows]
    matrix = _sparse(rows, len(knots) - degree - 1)
    right = np.vstack([points, *condition_values])
    try:
        solved = ca.solve(matrix, ca.DM(right), "qr")
    except RuntimeError:
        raise ValueError(
            f"{len(times)} points and these end conditions do not fix a spline of degree {degree}; take a lower degree "
            "or other ends"
        ) from None
    spline = as_piecewise(knots, degree, np.array(solved).reshape(len(right), n))
    powers = unit ** np.arange(degree + 1)
    return Piecewise(times, spline.coefficients / powers[:, None])


def basis_rows(knots: Array, degree: int, t: Array, order: int) -> tuple[Array, Array]:
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
    """Return the Taylor form of a B-spline with coefficients (m - d - 1, n)."""
    breaks = np.unique(knots)
    taylor = np.zeros((len(breaks) - 1, degree + 1, coefficients.shape[1]))
    for order in range(degree + 1):
        columns, values = basis_rows(knots, degree, breaks[:-1], order)
        taylor[:, order] = np.einsum("kd,kdn->kn", values, coefficients[columns]) / factorial(order)
    return Piecewise(breaks, taylor)


def _difference(one: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Array, Array]:
    return np.hstack([one[0], other[0]]), np.hstack([one[1], -other[1]])


def _sparse(rows: Sequence[tuple[Array, Array]], size: int) -> ca.DM:
    """Return a sparse matrix from blocks of rows (columns, values)."""
    entries: list[tuple[Array, Array, Array]] = []
    count = 0
    for columns, values in rows:
        at = np.repeat(np.arange(count, count + len(columns)), columns.shape[1])
        entries.append((at, columns.ravel(), values.ravel()))
        count += len(columns)
    at, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return ca.DM.triplet(at.tolist(), columns.tolist(), ca.DM(values), count, size)


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
