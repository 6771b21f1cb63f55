"""Surfaces of regions as triangles, for pictures of obstacles and walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp.checks import Array
from ocp.problem.regions import Ball, Box, Cylinder, HalfSpace, Region

ROUND = 24  # corners of a circle
COARSE = 10  # of one that moves with an arm
Mesh = tuple[Array, Array]  # vertices (V, 3) [m], corners of the triangles (F, 3) as indices of vertices


def mesh(region: Region, around: Array, reach: float) -> Mesh | None:
    """Return the surface of a region, or None for a region without a known shape.

    Args:
        region: Ball, Box, Cylinder or HalfSpace in three dimensions.
        around: (3,) middle of the picture, near which unbounded surfaces are cut off [m].
        reach: half the width of the picture [m].
    """
    if isinstance(region, Ball):
        return _ball(np.asarray(region.centre, dtype=float), region.radius)
    if isinstance(region, Box):
        return _box(np.asarray(region.lower, dtype=float), np.asarray(region.upper, dtype=float))
    if isinstance(region, Cylinder):
        return _cylinder(region, around, reach)
    return _plane(region, around, reach) if isinstance(region, HalfSpace) else None


def capsule(start: Array, end: Array, radius: float) -> Mesh:
    """Return the surface of a capsule: everything within a radius of a straight line.

    Args:
        start, end: (3,) of the line [m]; equal points make a ball.
        radius: > 0 [m].
    """
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    one, other = _across(axis)
    turn = np.linspace(0.0, 2.0 * np.pi, COARSE + 1)
    ring = np.outer(np.cos(turn), one) + np.outer(np.sin(turn), other)
    half = np.linspace(0.0, np.pi / 2.0, 4)
    below = [start - radius * (np.cos(a) * axis - np.sin(a) * ring) for a in half]
    above = [end + radius * (np.cos(a) * axis + np.sin(a) * ring) for a in half[::-1]]
    return np.vstack([*below, *above]), _sheet(2 * len(half), len(turn))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several surfaces as one."""
    begins = np.cumsum([0, *(len(points) for points, _ in meshes[:-1])])
    triangles = [corners + begin for (_, corners), begin in zip(meshes, begins, strict=True)]
    return np.vstack([points for points, _ in meshes]), np.vstack(triangles)


def _ball(centre: Array, radius: float) -> Mesh:
    polar = np.linspace(0.0, np.pi, ROUND // 2 + 1)
    round_ = np.linspace(0.0, 2.0 * np.pi, ROUND + 1)
    s, t = (grid.ravel() for grid in np.meshgrid(polar, round_, indexing="ij"))
    points = centre + radius * np.stack([np.sin(s) * np.cos(t), np.sin(s) * np.sin(t), np.cos(s)], axis=1)
    return points, _sheet(len(polar), len(round_))


def _box(low: Array, high: Array) -> Mesh:
    corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    quads = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    return corners, np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])


def _cylinder(region: Cylinder, around: Array, reach: float) -> Mesh:
    axis = np.asarray(region.axis, dtype=float)
    axis = axis / np.linalg.norm(axis)
    across, second = _across(axis)
    middle, length = np.asarray(region.centre, dtype=float), region.length
    if not np.isfinite(length):
        middle, length = middle + axis * (axis @ (around - middle)), 2.5 * reach
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND + 1)
    ring = region.radius * (np.outer(np.cos(turn), across) + np.outer(np.sin(turn), second))
    ends = [middle + sign * length / 2.0 * axis for sign in (-1.0, 1.0)]
    points = np.vstack([ends[0] + ring, ends[1] + ring, ends])
    n = len(turn)
    caps = [(2 * n + e, e * n + k, e * n + k + 1) for e in (0, 1) for k in range(n - 1)]
    return points, np.vstack([_sheet(2, n), caps])


def _plane(region: HalfSpace, around: Array, reach: float) -> Mesh:
    normal = np.asarray(region.normal, dtype=float)
    normal = normal / np.linalg.norm(normal)
    foot = around - normal * (normal @ (around - np.asarray(region.point, dtype=float)))
    one, other = _across(normal)
    points = np.array([foot + 1.2 * reach * (a * one + b * other) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return points, np.array([(0, 1, 2), (0, 2, 3)])


def _across(axis: Array) -> tuple[Array, Array]:
    """Return two directions that make a right-handed triple with a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    one = np.cross(axis, helper)
    one = one / np.linalg.norm(one)
    return one, np.cross(axis, one)


def _sheet(rows: int, columns: int) -> Array:
    """Return the triangles of a grid of vertices."""
    k = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([k, k + 1, k + columns + 1, k + columns], axis=1)
    return np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
