"""Interpolating splines of odd degree with chosen end conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.motions import b_splines, taylor_splines
from models.motions.piecewise import Piecewise
from ocp import checks
from ocp.checks import Array

# Steps that differ by no more than this ratio are interpolated in the B-spline basis, which is faster; others need
# the Taylor form, which stays well conditioned.
EVEN = 10.0
# A spline must pass its points within this share of their range.
MISSED = 1e-9
# Two times nearer to each other than this share of the usual step are a doubled stamp, not a motion.
DOUBLED = 1e-6


@dataclass(frozen=True, eq=False)
class Ends:
    """Conditions at the ends of a spline of degree d: d - 1 in all.

    Args:
        start, end: order of a derivative -> its value, (n,) or scalar [rad or m, per s^order].
        periodic: the derivatives of order 1 .. d - 1 agree at both ends instead.
        continued: the (d + 1)/2 pieces at each end are one polynomial instead ("not a knot").
    """

    start: Mapping[int, float | Sequence[float] | Array] = field(default_factory=dict)
    end: Mapping[int, float | Sequence[float] | Array] = field(default_factory=dict)
    periodic: bool = False
    continued: bool = False


def check_degree(degree: object) -> None:
    """Raise ValueError unless the degree of a spline is an odd number from 3 to 99."""
    whole = isinstance(degree, int | np.integer) and not isinstance(degree, bool)
    if not whole or not 3 <= degree <= 99 or degree % 2 == 0:  # type: ignore[operator]
        raise checks.refused("degree", degree, "an odd number >= 3, such as 5")


def at_rest(degree: int) -> Ends:
    """Return the ends of a motion that starts and stops: the derivatives of order 1 .. (d - 1)/2 are zero."""
    check_degree(degree)
    orders = range(1, (degree - 1) // 2 + 1)
    return Ends(dict.fromkeys(orders, 0.0), dict.fromkeys(orders, 0.0))


def natural(degree: int) -> Ends:
    """Return the ends of the smoothest spline: the derivatives of order (d + 1)/2 .. d - 1 are zero."""
    check_degree(degree)
    orders = range((degree + 1) // 2, degree)
    return Ends(dict.fromkeys(orders, 0.0), dict.fromkeys(orders, 0.0))


def not_a_knot() -> Ends:
    """Return the ends for samples of a motion that goes on: no derivative is prescribed, polynomials are exact."""
    return Ends(continued=True)


def interpolate(times: Array, points: Array, degree: int, ends: Ends) -> Piecewise:
    """Return the spline of odd degree with knots at the given times, through the points.

    Args:
        times: (K,) increasing [s].
        points: (K, n) [rad or m].
        degree: 3, 5, 7 ...; d - 1 derivatives are continuous.
        ends: d - 1 conditions, such as at_rest(d), natural(d) or not_a_knot(); with fewer than d + 1 points
            not_a_knot() gives the polynomial of degree K - 1.

    Raises:
        ValueError: an even degree, another number of conditions, periodic ends of different positions, times so close
            that no motion can be meant, or points that the spline misses because of rounding.
    """
    check_degree(degree)
    checks.instance("ends", ends, Ends, "Ends, such as at_rest(5) or natural(5), or None")
    check_spacing(times)
    step = np.diff(times)
    if ends.continued:
        if ends.start or ends.end or ends.periodic:
            raise ValueError("ends: continued polynomials leave no room for other conditions")
        degree = min(degree, len(times) - 1)
    elif ends.periodic and not np.allclose(points[0], points[-1], rtol=0.0, atol=1e-9):
        raise ValueError("ends: periodic, but the first and the last waypoint differ")
    conditions = _conditions(ends, degree, points.shape[1])
    fewest = (degree + 1) // 2 + 1
    bases = [b_splines.interpolate, taylor_splines.interpolate]
    if np.max(step) > EVEN * np.min(step):
        bases.reverse()  # each basis loses digits for some steps that the other one bears
    spline, missed = None, np.inf
    for basis in bases:
        if basis is taylor_splines.interpolate and ends.continued and len(times) < fewest:
            continue
        tried = basis(times, points, degree, conditions, ends.periodic)
        apart = np.inf if tried is None else _missed(tried, times, points)
        if spline is None or apart < missed:
            spline, missed = tried, apart
        if spline is not None and missed <= MISSED:
            return spline
    if spline is None:
        raise ValueError(
            f"{len(times)} points and these end conditions do not fix a spline of degree {degree}; take a lower degree "
            "or other ends"
        )
    if not missed <= MISSED:
        raise ValueError(
            f"a spline of degree {degree} through {len(times)} points misses them by {missed:.1e} of their range, as "
            f"the times are from {np.min(step):.3g} to {np.max(step):.3g} s apart; take a lower degree or other times"
        )
    return spline


def check_spacing(times: Array) -> None:
    """Raise ValueError for two times that are too close for a motion between them."""
    step = np.diff(times)
    k, usual = int(np.argmin(step)), float(np.median(step))
    if step[k] < DOUBLED * usual:
        raise ValueError(
            f"times {k + 1} and {k + 2} are {step[k]:.3g} s apart, at {times[k]:.9g} s, the others about {usual:.3g} "
            "s: a doubled time stamp? Leave one of the two points out"
        )


def _conditions(ends: Ends, degree: int, n: int) -> list[tuple[int, int, Array]] | None:
    """Return end (0 or -1), order and value (n,) of the conditions; None for continued polynomials."""
    if ends.continued:
        return None
    conditions = []
    for end, side in ((0, ends.start), (-1, ends.end)):
        for order, value in side.items():
            if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order < degree:
                raise ValueError(f"ends: a condition on derivative {order}, expected 1 .. {degree - 1}")
            given = checks.numbers(f"ends: derivative {order}", value)
            if given.size not in (1, n):
                raise ValueError(f"ends: derivative {order} has {given.size} components, expected 1 or {n}")
            conditions.append((end, order, np.broadcast_to(given, (n,))))
    count = len(conditions) + (degree - 1 if ends.periodic else 0)
    if count != degree - 1:
        raise ValueError(
            f"ends: {count} conditions, a spline of degree {degree} needs {degree - 1}; "
            f"use at_rest({degree}) or natural({degree})"
        )
    return conditions


def _missed(spline: Piecewise, times: Array, points: Array) -> float:
    """Return the largest distance of a spline from its points, from both sides, as a share of their range."""
    before = spline(np.nextafter(times, times[0]))
    largest = max(float(np.max(np.abs(values - points))) for values in (spline(times), before))
    # A step of one unit in the last digit moves q by v times that step.
    return largest / max(float(np.max(np.ptp(points, axis=0))), 1e-6 * float(np.max(np.abs(points))), 1e-300)
