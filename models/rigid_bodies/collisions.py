"""Constraints that keep the links of an arm away from obstacles, from a floor and from each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.shapes import Shape
from models.rigid_bodies.joint import Capsule
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Constraint, along
from ocp.problem.regions import Ball, Box, Cylinder, HalfSpace, Region, outside

COVER = 0.02  # spheres along a capsule stick out by at most this [m]


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball that moves with a body; those of a capsule together contain it."""

    body: str
    centre: ca.SX  # (3,) [m]
    radius: float  # [m]


def body_capsule(machine: Manipulator, body: str, capsule: Capsule) -> Shape:
    """Return a capsule on a body of any machine, such as the arm of the spherical one.

    Args:
        machine: such as spherical().
        body: name of one of its bodies.
        capsule: its points from the mass centre of the body, in its axes.

    Raises:
        ValueError: no such body.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    checks.instance("capsule", capsule, Capsule, "a Capsule")
    bodies = {one.name: one for one in machine.bodies}
    if not isinstance(body, str) or body not in bodies:
        raise ValueError(f"body: {machine.name} has no body {checks.shown(body)}; it has {', '.join(bodies)}")
    own = bodies[body]
    start, end = (
        own.centre + own.orientation @ ca.DM([float(x) for x in point]) for point in (capsule.start, capsule.end)
    )
    length = float(np.linalg.norm(np.array(capsule.end, dtype=float) - np.array(capsule.start, dtype=float)))
    return Shape(body, start, end, float(capsule.radius), length)


def with_shapes(machine: Manipulator, shapes: Sequence[Shape]) -> Manipulator:
    """Return the machine with capsules of `body_capsule` beside those that it has."""
    return replace(machine, shapes=(*machine.shapes, *checks.several("shapes", shapes, "a list of Shapes")))


def keep_clear(
    machine: Manipulator,
    obstacles: Sequence[Region] = (),
    *,
    pairs: Sequence[tuple[str, str]] = (),
    floor: float | None = None,
    clearance: float = 0.0,
) -> tuple[Constraint, ...]:
    """Return path constraints that keep the capsules of a machine clear of obstacles, of a floor and of each other.

    Every capsule is covered by spheres that stick out by at most 2 cm; obstacles are enlarged by their radius. The
    constraints hold at the points of the grid; `least_clearance` measures a solution between them, in metres.

    Args:
        machine: with capsules (of its Links, of a URDF file, or by `with_shapes`), the one that the system is made of.
        obstacles: Ball, Box, Cylinder or HalfSpace, for all capsules but those of the first body.
        pairs: names of two bodies that must not touch.
        floor: height below which no capsule but those of the first body may be [m].
        clearance: distance that is kept >= 0 [m].

    Raises:
        ValueError: the machine has no capsules, or a pair has a body without one.
    """
    spheres = _spheres(machine)
    distance = checks.number("clearance", clearance, "a distance >= 0 in m")
    if distance < 0.0:
        raise checks.refused("clearance", clearance, "a distance >= 0 in m")
    moving = [sphere for sphere in spheres if sphere.body != machine.bodies[0].name] or list(spheres)
    result: list[Constraint] = []
    for region in checks.several("obstacles", obstacles, "a list of regions such as Ball(...)"):
        result += [outside(_grown(region, sphere.radius + distance), sphere.centre) for sphere in moving]
    if floor is not None:
        height = checks.number("floor", floor, "a height in m")
        lowest = ca.vertcat(*(sphere.centre[2] - sphere.radius for sphere in moving))
        result.append(along(lowest, lower=height + distance, name="height of the links above the floor"))
    for first, second in _pairs(pairs, {sphere.body for sphere in spheres}):
        shares = [
            ca.sumsqr(one.centre - other.centre) / (one.radius + other.radius + distance) ** 2
            for one in spheres
            if one.body == first
            for other in spheres
            if other.body == second
        ]
        result.append(
            along(ca.vertcat(*shares), lower=1.0, name=f"distance of {first} and {second} (1 where they touch)")
        )
    return tuple(result)


def least_clearance(
    machine: Manipulator,
    q: Array,
    obstacles: Sequence[Region] = (),
    *,
    pairs: Sequence[tuple[str, str]] = (),
    floor: float | None = None,
) -> dict[str, float]:
    """Return the least distances of the capsules along a motion, in metres; negative where they overlap.

    Args:
        machine: with capsules.
        q: (K, n) positions along the motion, such as solution.signal("q", t) at many times.
        obstacles, pairs, floor: as for `keep_clear`.

    Returns:
        Name of an obstacle, pair or the floor -> least distance [m].
    """
    shapes = _shapes(machine)
    moving = [shape for shape in shapes if shape.body != machine.bodies[0].name] or list(shapes)
    points = np.atleast_2d(checks.numbers("q", q, "positions (K, n)"))
    ends = ca.Function("ends", [machine.q], [ca.densify(ca.vertcat(*(p for s in shapes for p in (s.start, s.end))))])
    lines = evaluate(ends, points)[0].reshape(len(points), len(shapes), 2, 3)
    share = np.linspace(0.0, 1.0, 41)[:, None]
    along_it = {
        id(shape): lines[:, k, None, 0] + share * (lines[:, k, None, 1] - lines[:, k, None, 0])
        for k, shape in enumerate(shapes)
    }
    result: dict[str, float] = {}
    for number, region in enumerate(obstacles, 1):
        signed = _distance(region)
        result[f"{type(region).__name__}_{number}"] = min(
            float(np.min(signed(along_it[id(shape)].reshape(-1, 3)))) - shape.radius for shape in moving
        )
    if floor is not None:
        result["floor"] = min(float(np.min(along_it[id(s)][..., 2])) - s.radius for s in moving) - floor
    for first, second in _pairs(pairs, {shape.body for shape in shapes}):
        result[f"{first}, {second}"] = min(
            float(np.min(_segments(*(along_it[id(s)][:, (0, -1)] for s in (one, other))))) - one.radius - other.radius
            for one in shapes
            if one.body == first
            for other in shapes
            if other.body == second
        )
    return result


def _shapes(machine: Manipulator) -> tuple[Shape, ...]:
    checks.instance("machine", machine, Manipulator, "a Manipulator with capsules")
    if not machine.shapes:
        raise ValueError(f"machine: {machine.name} has no capsules; give them in its Links, or by with_shapes(...)")
    return machine.shapes


def _spheres(machine: Manipulator) -> list[Sphere]:
    result = []
    for shape in _shapes(machine):
        # Balls of radius R at distances d contain the capsule where R^2 = r^2 + (d / 2)^2.
        widest = 2.0 * np.sqrt((shape.radius + COVER) ** 2 - shape.radius**2)
        count = int(np.ceil(shape.length / widest)) + 1 if shape.length > 0.0 else 1
        apart = shape.length / max(count - 1, 1)
        radius = float(np.hypot(shape.radius, apart / 2.0)) if count > 1 else shape.radius
        for k in range(count):
            share = k / max(count - 1, 1)
            result.append(Sphere(shape.body, shape.start + share * (shape.end - shape.start), radius))
    return result


def _pairs(pairs: Sequence[tuple[str, str]], bodies: set[str]) -> list[tuple[str, str]]:
    given = checks.several("pairs", pairs, "a list of pairs of bodies")
    for pair in given:
        if not isinstance(pair, tuple | list) or len(pair) != 2 or not set(map(str, pair)) <= bodies:
            raise ValueError(
                f"pairs: got {checks.shown(pair)}, expected two bodies with capsules of {', '.join(sorted(bodies))}"
            )
    return [(str(first), str(second)) for first, second in given]


def _grown(region: Region, by: float) -> Region:
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


def _distance(region: Region) -> Callable[[Array], Array]:
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


def _segments(one: Array, other: Array) -> Array:
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
