"""Paths of the tool in space: lines, arcs, sampled curves; position and derivatives over the length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from models.motions.splines import interpolate, natural
from ocp import checks
from ocp.checks import Array

Point = Sequence[float] | Array

SEVERAL = 20  # points from which the first steps show whether a motion begins at rest


class ToolPath(Protocol):
    """A curve x(s), s from 0 to its length [m]."""

    @property
    def length(self) -> float:
        """[m]."""

    def __call__(self, s: Array, order: int) -> Array:
        """Return d^order x / ds^order (K, 3) at lengths (K,)."""


@dataclass(frozen=True, eq=False)
class Polynomial:
    """x(s) as a piecewise polynomial, or a straight line."""

    curve: object
    length: float

    def __call__(self, s: Array, order: int) -> Array:
        """Return d^order x / ds^order (K, 3)."""
        return np.asarray(self.curve(s, order))  # type: ignore[operator]


@dataclass(frozen=True, eq=False)
class Circle:
    """x(s) = c + R (cos(s/R) e + sin(s/R) f)."""

    centre: Array
    first: Array  # (3,) unit vector e to the start
    second: Array  # (3,) unit vector f along the start
    radius: float
    length: float

    def __call__(self, s: Array, order: int) -> Array:
        """Return d^order x / ds^order (K, 3)."""
        angle = s / self.radius + order * np.pi / 2.0
        turned = np.cos(angle)[:, None] * self.first + np.sin(angle)[:, None] * self.second
        return np.asarray(turned * self.radius ** (1 - order) + (self.centre if order == 0 else 0.0))


def line(start: Point, end: Point) -> Polynomial:
    """Return the straight line between two points [m].

    Raises:
        ValueError: no points in space, or start = end.
    """
    first, last = _point("start", start), _point("end", end)
    length = float(np.linalg.norm(last - first))
    if length == 0.0:
        raise ValueError("line: start and end are the same point")
    terms = (first, (last - first) / length)

    def curve(s: Array, order: int) -> Array:
        if order == 0:
            return np.asarray(terms[0] + s[:, None] * terms[1])
        return np.tile(terms[1] if order == 1 else np.zeros(3), (len(s), 1))

    return Polynomial(curve, length)


def arc(start: Point, via: Point, end: Point) -> Circle:
    """Return the arc of a circle from start through via to end [m].

    Raises:
        ValueError: the points lie on a line.
    """
    a, b, c = _point("start", start), _point("via", via), _point("end", end)
    u, w = b - a, c - a
    normal = np.cross(u, w)
    size = float(normal @ normal)
    if size <= 1e-20 * float(u @ u) * float(w @ w) or size == 0.0:
        raise ValueError("arc: the three points lie on a line; use line(start, end)")
    centre = a + (np.cross(normal, u) * (w @ w) + np.cross(w, normal) * (u @ u)) / (2.0 * size)
    radius = float(np.linalg.norm(a - centre))
    first = (a - centre) / radius
    second = np.cross(normal, first) / np.sqrt(size)
    angle = float(np.mod(np.arctan2((c - centre) @ second, (c - centre) @ first), 2.0 * np.pi))
    return Circle(centre, first, second, radius, radius * angle)


def sampled(points: Sequence[Point] | Array) -> Polynomial:
    """Return the quintic spline through points (K, 3) of the tool over the length of their chords [m].

    Raises:
        ValueError: fewer than three points, or two of them in succession are the same.
    """
    x = checks.numbers("sampled", points, "at least three finite points (K, 3)")
    if x.ndim != 2 or x.shape[1] != 3 or len(x) < 3 or not np.all(np.isfinite(x)):
        raise ValueError(f"sampled: got the shape {x.shape}, expected at least three finite points (K, 3)")
    chords = np.linalg.norm(np.diff(x, axis=0), axis=1)
    if np.any(chords == 0.0):
        raise ValueError(f"sampled: points {int(np.argmin(chords)) + 1} and {int(np.argmin(chords)) + 2} are the same")
    s = np.concatenate([[0.0], np.cumsum(chords)])
    return Polynomial(interpolate(s, x, 5, natural(5)), float(s[-1]))


def _point(name: str, value: Point) -> Array:
    return checks.column(name, value, 3, "a point (x, y, z) in m")


def is_moving_at_its_ends(t: Array, points: Array) -> bool:
    """Whether samples of a motion begin or end in full motion; never for a few points.

    Args:
        t: (K,) increasing [s].
        points: (K, m).
    """
    if len(t) < SEVERAL:
        return False
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(t)
    # From rest, the first step is a fraction of the second one.
    moving = [one > 0.6 * next_one and one > 0.02 * np.max(speed)
              for one, next_one in ((speed[0], speed[1]), (speed[-1], speed[-2]))]  # fmt: skip
    return any(moving)
