"""The arm in space: poses, path of the tool, obstacles, via points, start and goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from models.plots.style import ACCENT, CLEAR, FAINT, LIMIT, MOTION, OBSTACLE
from models.plots.surfaces import Mesh, mesh
from models.scenes.task import Obstacle
from ocp.checks import Array
from ocp.problem.regions import Region, inside

POSES = 7


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of an obstacle in a picture."""

    mesh: Mesh
    inside: bool  # whether the motion stays inside of it
    name: str


def bounds(corners: Array) -> tuple[Array, float]:
    """Return the middle (3,) and half the width [m] of a cube around all points (..., 3)."""
    points = corners.reshape(-1, 3)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    return middle, max(float(np.ptp(points, axis=0).max()) / 2.0, 1e-6) * 1.05


def surfaces(obstacles: Sequence[Obstacle | Region], middle: Array, half: float) -> list[Surface]:
    """Return the surfaces of obstacles of three dimensions.

    Args:
        obstacles: of a task, or regions that the motion stays out of.
        middle: (3,) of the picture [m].
        half: half its width [m].
    """
    results = []
    for one in obstacles:
        region, within = (one.region, one.keep is inside) if isinstance(one, Obstacle) else (one, False)
        made = mesh(region, middle, half)
        if made is not None:
            name = one.name if isinstance(one, Obstacle) else ""
            results.append(Surface(made, within, name or type(region).__name__))
    return results


def draw_space(
    axes: Axes3D, corners: Array, obstacles: Sequence[Obstacle | Region] = (), via: Array | None = None,
    links: Sequence[Mesh] = (),
) -> None:  # fmt: skip
    """Draw a motion in space.

    Args:
        axes: with the projection "3d".
        corners: (K, k, 3) of the arm at equal times, from the base to the tool [m].
        obstacles: of the task.
        via: (m, 3) points that the tool passes [m], or None.
        links: surfaces of the links at the start and at the goal.
    """
    middle, half = bounds(np.vstack([corners.reshape(-1, 3), *(points for points, _ in links)]))
    for points, triangles in links:
        hull = Poly3DCollection(points[triangles], alpha=0.08, linewidths=0.0)
        hull.set_facecolor(MOTION)
        axes.add_collection3d(hull)
    for surface in surfaces(obstacles, middle, half):
        points, triangles = surface.mesh
        faces = Poly3DCollection(points[triangles], alpha=0.12 if surface.inside else 0.35, linewidths=0.0)
        faces.set_facecolor(OBSTACLE)
        axes.add_collection3d(faces)
        near = np.abs(points - middle).max()
        half = max(half, min(float(near), 1.5 * half))
    for number, k in enumerate(np.linspace(0, len(corners) - 1, POSES).round().astype(int)):
        edge = number in (0, POSES - 1)
        colour = MOTION if edge else FAINT
        axes.plot(*corners[k].T, "-o", color=colour, linewidth=2.6 if edge else 1.1, markersize=3.5 if edge else 1.5)
    tool = corners[:, -1]
    axes.plot(*tool.T, color=ACCENT, linewidth=2.2)
    axes.plot(*tool[:1].T, "o", color=MOTION, markersize=6)
    axes.plot(*tool[-1:].T, "s", color=MOTION, markersize=7)
    closed = np.linalg.norm(tool[-1] - tool[0]) < 0.02 * half
    _word(axes, tool[0], half, "start, goal" if closed else "start")
    if not closed:
        _word(axes, tool[-1], half, "goal")
    if via is not None and len(via):
        axes.plot(*via.T, "D", color=LIMIT, markersize=6)
        _word(axes, via[0], half, "via")
    frame_of(axes, middle, half)


def _word(axes: Axes3D, point: Array, half: float, word: str) -> None:
    """Write a word above a point."""
    axes.text(*(point + 0.08 * half * np.eye(3)[2]), word, fontsize=9, ha="center", va="bottom", bbox=CLEAR)


def frame_of(axes: Axes3D, middle: Array, half: float, zoom: float = 0.92) -> None:
    """Set equal scales, limits and labels of axes in space; `zoom` enlarges the view."""
    for axis, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{axis}lim")(centre - half, centre + half)
        getattr(axes, f"set_{axis}label")(f"{axis} [m]", fontsize=9, labelpad=2)
        getattr(axes, f"{axis}axis").set_major_locator(_ticks())
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)
    axes.tick_params(labelsize=8, pad=1)


def _ticks() -> object:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)
