"""Regions of space that a point of the motion keeps inside of, or out of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.problem.constraints import Constraint, along

# Exponent of the norm that rounds the edges of boxes and finite cylinders when a point stays outside.
ROUNDING = 8
TINY = 1e-6
Vector = Sequence[float] | np.ndarray


class Region(Protocol):
    """A closed region given by smooth functions of a point."""

    def within(self, point: ca.SX) -> ca.SX:
        """Return expressions that are all <= 1 exactly inside the region, one for each face or surface."""
        ...


@dataclass(frozen=True)
class Ball:
    """All points within `radius` of `centre`: |r - c|^2 / R^2 <= 1.

    Args:
        centre: (d,) [m].
        radius: > 0 [m].
    """

    centre: Vector
    radius: float

    def __post_init__(self) -> None:
        _numbers("Ball: centre", self.centre)
        _positive("Ball: radius", self.radius)

    def within(self, point: ca.SX) -> ca.SX:
        """Return |r - c|^2 / R^2."""
        return ca.sumsqr(_from(point, self.centre, "Ball")) / self.radius**2


@dataclass(frozen=True)
class Box:
    """All points between two corners: lower <= r <= upper.

    Args:
        lower, upper: (d,) corners [m], lower < upper.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        low, high = _numbers("Box: lower", self.lower), _numbers("Box: upper", self.upper)
        if len(low) != len(high) or not np.all(low < high):
            raise ValueError(f"Box: lower {low.tolist()}, upper {high.tolist()}, expected lower < upper of one size")

    def within(self, point: ca.SX) -> ca.SX:
        """Return ((r - centre) / half width)^2, one for each direction."""
        low, high = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        return (_from(point, (low + high) / 2.0, "Box") / ca.DM((high - low) / 2.0)) ** 2


@dataclass(frozen=True)
class Cylinder:
    """All points within `radius` of a line, and between its ends if it has a length.

    Args:
        centre: (3,) middle of the axis [m].
        axis: (3,) direction; its length does not matter.
        radius: > 0 [m].
        length: > 0 [m], or inf for no ends.
    """

    centre: Vector
    axis: Vector
    radius: float
    length: float = float("inf")

    def __post_init__(self) -> None:
        _numbers("Cylinder: centre", self.centre, 3)
        if not np.linalg.norm(_numbers("Cylinder: axis", self.axis, 3)) > 0.0:
            raise ValueError(f"Cylinder: axis {self.axis}, expected a direction, not all zero")
        _positive("Cylinder: radius", self.radius)
        checks.number("Cylinder: length", self.length, "a length > 0, or inf", above=0.0, finite=False)

    def within(self, point: ca.SX) -> ca.SX:
        """Return (distance from the axis / R)^2 and, with ends, (distance along it / half length)^2."""
        axis = np.array(self.axis, dtype=float)
        unit = ca.DM(axis / np.linalg.norm(axis))
        apart = _from(point, self.centre, "Cylinder")
        height = ca.dot(unit, apart)
        across = ca.sumsqr(apart - height * unit) / self.radius**2
        return across if np.isinf(self.length) else ca.vertcat(across, (2.0 * height / self.length) ** 2)


@dataclass(frozen=True)
class HalfSpace:
    """All points on the side of a plane that its normal points away from: n . (r - point) <= 0.

    Args:
        point: (d,) on the plane [m].
        normal: (d,) pointing out of the region; its length does not matter.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        size = len(_numbers("HalfSpace: point", self.point))
        if not np.linalg.norm(_numbers("HalfSpace: normal", self.normal, size)) > 0.0:
            raise ValueError(f"HalfSpace: normal {self.normal}, expected a direction, not all zero")

    def within(self, point: ca.SX) -> ca.SX:
        """Return 1 + n . (r - point), n of length one."""
        normal = np.array(self.normal, dtype=float)
        return 1.0 + ca.dot(ca.DM(normal / np.linalg.norm(normal)), _from(point, self.point, "HalfSpace"))


def inside(region: Region, point: ca.SX) -> Constraint:
    """Keep a point inside a region along the motion.

    Args:
        region: Ball, Box, Cylinder, HalfSpace, or anything with `within`.
        point: (d,) position as an expression, such as system["tool"] [m].
    """
    _region(region)
    return along(region.within(_column(point)), upper=1.0, name=f"place in {type(region).__name__} (1 at its surface)")


def outside(region: Region, point: ca.SX) -> Constraint:
    """Keep a point out of a region along the motion.

    A region of several faces f_i <= 1 is left by violating one of them; sum f_i^4 >= number of faces implies it and
    is smooth. The excluded region is a box (finite cylinder) with bulging sides that contains the true one, up to
    3^(1/8) = 1.15 times (2^(1/8) = 1.09 times) as wide in the middle of a side, and touches it at the corners.

    Args:
        region: Ball, Box, Cylinder, HalfSpace, or anything with `within`.
        point: (d,) position as an expression, such as system["tool"] [m].
    """
    _region(region)
    faces = ca.vec(region.within(_column(point)))
    if faces.numel() == 1:
        return along(faces, lower=1.0, name=f"clearance from {type(region).__name__} (1 at its surface)")
    # f is a square, so f^(ROUNDING / 2) is the ROUNDING-th power of a distance; the root makes it one again, with a
    # slope near one instead of one that vanishes inside. The last term keeps the root differentiable at the centre.
    mean = ca.sum1(faces ** (ROUNDING // 2)) / faces.numel()
    return along(
        (mean + TINY) ** (1.0 / ROUNDING), lower=1.0, name=f"clearance from {type(region).__name__} (1 at its surface)"
    )


def _region(region: Region) -> None:
    if isinstance(region, type) or not callable(getattr(region, "within", None)):
        raise TypeError(f"region: got {checks.shown(region)}, expected a region such as Ball(centre, radius)")


def _column(point: ca.SX) -> ca.SX:
    checks.expression("point", point, "an expression such as system['tool']")
    return ca.densify(ca.vec(point))


def _from(point: ca.SX, origin: Vector, name: str) -> ca.SX:
    point = _column(point)
    if point.numel() != len(origin):
        raise ValueError(f"{name}: has {len(origin)} dimensions, the point has {point.numel()}; give both as many")
    return point - ca.DM(np.array(origin, dtype=float))


def _numbers(name: str, value: Vector, size: int | None = None) -> np.ndarray:
    wanted = f"{'' if size is None else f'{size} '}finite numbers, one for each direction [m]"
    if np.ndim(checks.numbers(name, value, wanted)) == 0:
        raise checks.refused(name, value, wanted)
    return checks.column(name, value, size, wanted)


def _positive(name: str, value: float) -> None:
    checks.number(name, value, "a length > 0", above=0.0)
