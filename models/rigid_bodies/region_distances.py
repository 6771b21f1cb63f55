"""Distances of points and straight lines from regions and from each other, in metres."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.regions import Ball, Box, Cylinder, HalfSpace, Region

NORM = 16  # exponent of the norm that rounds edges
CORNERS = 61  # angles at which the factor of the norm is looked for
TINY = 1e-6  # keeps roots differentiable in the middle of a region


def grown(region: Region, by: float) -> Region:
    """Return a region with everything within a distance of it (a box and a cylinder keep their sharp edges)."""
    if isinstance(region, Ball):
        return Ball(region.centre, region.radius + by)
    if isinstance(region, Box):
        lower, upper = (np.array(side, dtype=float) for side in (region.lower, region.upper))
        return Box(tuple(lower - by), tuple(upper + by))
    if isinstance(region, Cylinder):
        return Cylinder(region.centre, region.axis, region.radius + by, region.length + 2.0 * by)
    if isinstance(region, HalfSpace):
        normal = np.array(region.normal, dtype=float)
        return HalfSpace(tuple(np.array(region.point) + by * normal / np.linalg.norm(normal)), region.normal)
    raise TypeError(f"obstacles: got {checks.shown(region)}, expected a Ball, Box, Cylinder or HalfSpace")


def nearness(region: Region, by: float, point: ca.SX) -> tuple[ca.SX, float]:
    """Return an expression that is >= 1 only at a distance from a region, and what it is relative to [m].

    For boxes and finite cylinders with half widths h the norm (sum_i (d_i / (h_i + by))^p / c)^(1/p), whose factor c is
    the least one with which it is <= 1 everywhere within the distance, edges and corners rounded by it.

    Args:
        region: Ball, Box, Cylinder or HalfSpace.
        by: distance > 0 [m].
        point: (3,) expression [m].
    """
    wide = grown(region, by)
    faces = ca.vec(wide.within(point))
    if isinstance(wide, Ball | Cylinder) and faces.numel() == 1:
        return ca.sqrt(faces + TINY), float(wide.radius)
    if faces.numel() == 1:
        return faces, 1.0
    halves = _halves(region)
    turn = np.linspace(0.0, np.pi / 2.0, CORNERS)
    if len(halves) == 2:
        normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    else:
        up, round_ = (grid.ravel() for grid in np.meshgrid(turn, turn, indexing="ij"))
        normals = np.stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)], axis=1)
    factor = 1.001 * float(np.max(np.sum(((halves + by * normals) / (halves + by)) ** NORM, axis=1)))
    norm = (ca.sum1(faces ** (NORM // 2)) / factor + TINY) ** (1.0 / NORM)
    return norm, float(np.linalg.norm(halves + by))


def _halves(region: Region) -> Array:
    """Return the half widths of a box, or radius and half the length of a cylinder [m]."""
    if isinstance(region, Box):
        return np.asarray((np.array(region.upper, dtype=float) - np.array(region.lower, dtype=float)) / 2.0)
    assert isinstance(region, Cylinder)
    return np.array([region.radius, region.length / 2.0])


def signed_distance(region: Region) -> Callable[[Array], Array]:
    """Return the signed distance (K,) of points (K, 3) from a region [m]."""
    if isinstance(region, Ball):
        return lambda points: np.asarray(np.linalg.norm(points - np.array(region.centre), axis=1) - region.radius)
    if isinstance(region, HalfSpace):
        normal = np.array(region.normal, dtype=float) / np.linalg.norm(region.normal)
        return lambda points: np.asarray((points - np.array(region.point)) @ normal)
    if isinstance(region, Box):
        low, high = np.array(region.lower, dtype=float), np.array(region.upper, dtype=float)
        return lambda points: _of_box(np.abs(points - (low + high) / 2.0) - (high - low) / 2.0)
    if isinstance(region, Cylinder):
        axis = np.array(region.axis, dtype=float) / np.linalg.norm(region.axis)

        def from_cylinder(points: Array) -> Array:
            apart = points - np.array(region.centre)
            height = apart @ axis
            across = np.linalg.norm(apart - height[:, None] * axis, axis=1) - region.radius
            beyond = np.abs(height) - region.length / 2.0
            return across if np.isinf(region.length) else _of_box(np.stack([across, beyond], axis=1))

        return from_cylinder
    raise TypeError(f"obstacles: got {checks.shown(region)}, expected a Ball, Box, Cylinder or HalfSpace")


def _of_box(beyond: Array) -> Array:
    outside_of_it = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside_of_it + np.minimum(np.max(beyond, axis=1), 0.0))


def segment_distance(one: Array, other: Array) -> Array:
    """Return the least distances (K,) of two straight lines with ends, (K, 2, 3) each."""
    a, b = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0]
    between = one[:, 0] - other[:, 0]
    aa, bb, ab = (np.sum(x * y, axis=1) for x, y in ((a, a), (b, b), (a, b)))
    ad, bd = np.sum(a * between, axis=1), np.sum(b * between, axis=1)
    tiny = 1e-300
    s = np.clip((ab * bd - bb * ad) / np.maximum(aa * bb - ab**2, tiny), 0.0, 1.0)
    # Alternate projections end in the nearest points of two segments.
    for _ in range(3):
        t = np.clip((ab * s + bd) / np.maximum(bb, tiny), 0.0, 1.0)
        s = np.clip((ab * t - ad) / np.maximum(aa, tiny), 0.0, 1.0)
    return np.asarray(np.linalg.norm(between + s[:, None] * a - t[:, None] * b, axis=1))
