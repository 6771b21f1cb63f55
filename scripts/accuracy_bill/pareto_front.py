"""Curves of error against seconds: the Pareto front, the seconds to a tolerance, and a recommendation in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    """One run: what it costs and how far it is from the truth."""

    label: str
    error: float  # >= 0, in the unit of the bill
    seconds: float
    valid: bool = True  # False: not to be taken, because it breaks a limit


@dataclass(frozen=True)
class Curve:
    """The points of one contender, cheapest settings first."""

    name: str
    points: tuple[Point, ...]
    continuous: bool = False  # settings between two points exist, such as a grid of any number of elements

    @property
    def lasting(self) -> tuple[Point, ...]:
        """The valid points, each with the largest error of itself and all finer ones.

        An error that changes its sign along the curve is small by luck at one point; such luck is no accuracy.
        """
        results: list[Point] = []
        worst = 0.0
        for point in reversed([p for p in self.points if p.valid]):
            worst = max(worst, point.error) if math.isfinite(point.error) else math.inf
            results.append(Point(point.label, worst, point.seconds))
        return tuple(reversed(results))


def front(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the Pareto front of the valid points, fastest first: none is both as fast and as accurate as another."""
    best: list[Point] = []
    usable = [p for p in points if p.valid and math.isfinite(p.error) and math.isfinite(p.seconds)]
    for point in sorted(usable, key=lambda p: (p.seconds, p.error)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return tuple(best)


def seconds_to(curve: Curve, tolerance: float) -> float:
    """Return the seconds that an error of at most `tolerance` costs on one curve; inf if it does not reach it.

    On a continuous curve log(seconds) is interpolated linearly in log(error) between two neighbours; on others the
    cheapest point that is accurate enough is paid in full.
    """
    if not tolerance > 0.0:
        raise ValueError(f"seconds_to: tolerance is {tolerance}, expected a number > 0")
    points = [p for p in curve.lasting if math.isfinite(p.error) and math.isfinite(p.seconds)]
    enough = [k for k, point in enumerate(points) if point.error <= tolerance]
    if not enough:
        return math.inf
    paid = min(points[k].seconds for k in enough)
    if not curve.continuous or enough[0] == 0:
        return paid
    before, after = points[enough[0] - 1], points[enough[0]]
    if after.error <= 0.0:
        return paid
    share = math.log(before.error / tolerance) / math.log(before.error / after.error)
    return min(paid, float(before.seconds * (after.seconds / before.seconds) ** share))


def cheapest(curves: Sequence[Curve], tolerance: float) -> tuple[Curve, Point] | None:
    """Return the run with the fewest seconds whose lasting error is at most `tolerance`; None if there is none."""
    results = [
        (curve, point)
        for curve in curves
        for point in curve.lasting
        if point.error <= tolerance and math.isfinite(point.seconds)
    ]
    return min(results, key=lambda pair: pair[1].seconds, default=None)


def recommend(curves: Sequence[Curve], tolerance: float, unit: str, what: str) -> str:
    """Return one recommendation: what to take for an error of at most `tolerance`, and what ten times more costs.

    Args:
        curves: of all contenders that count.
        tolerance: in `unit`.
        unit: of the error, "s" or that of the cost.
        what: the quantity that is wanted, such as "t_f".
    """
    wanted = f"{tolerance:.0e} {unit}".rstrip()
    result = cheapest(curves, tolerance)
    if result is None:
        everything = [(curve, point) for curve in curves for point in curve.lasting if math.isfinite(point.error)]
        if not everything:
            return f"For {wanted} in {what} there is nothing to recommend: no run succeeded."
        curve, point = min(everything, key=lambda pair: (pair[1].error, pair[1].seconds))
        return (
            f"For {wanted} in {what} there is nothing to recommend: the most accurate run, {_named(curve, point)}, "
            f"is at {point.error:.1e}{f' {unit}' if unit else ''} after {_seconds(point.seconds)}."
        )
    curve, point = result
    text = f"For {wanted} in {what} take {_named(curve, point)}, {_seconds(point.seconds)}"
    further = cheapest(curves, tolerance / 10.0)
    if further is None:
        return f"{text}; none of those tried is ten times more accurate."
    if further[1].label == point.label and further[0].name == curve.name:
        reached = f"{point.error:.1e} {unit}".rstrip()
        return f"{text}; ten times more accuracy costs nothing more: the same run is at {reached}."
    ratio = min(seconds_to(c, tolerance / 10.0) for c in curves) / min(seconds_to(c, tolerance) for c in curves)
    by = f" ({_named(*further)})" if further[0].name != curve.name else ""
    return f"{text}; ten times more accuracy costs {ratio:.1f} times the time{by}."


def _named(curve: Curve, point: Point) -> str:
    return f"{curve.name}, {point.label}"


def _seconds(value: float) -> str:
    return f"{value:.2g} s" if value < 10.0 else f"{value:.0f} s"
