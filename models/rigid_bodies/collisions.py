"""Constraints that keep the links of an arm away from obstacles, from a floor and from each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.shapes import Shape
from models.rigid_bodies.joint import Capsule
from models.rigid_bodies.region_distances import grown, segment_distance, share_of, signed_distance, squared
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Constraint, along
from ocp.problem.regions import Region, outside

COVER = 0.02  # spheres along a capsule stick out by at most this [m]
OVERLAPS = 0.3  # share of random positions at which bodies that overlap by construction touch
MARGIN = 1e-3  # kept at the nodes beyond the clearance, for what lies between them [m]


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


def skeleton_shapes(machine: Manipulator, radius: float) -> tuple[Shape, ...]:
    """Return a capsule along every line of the skeleton of a machine, for `with_shapes`, where none are published.

    Args:
        machine: such as spherical().
        radius: > 0 [m].
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    thick = checks.number("radius", radius, "a radius > 0 in m", above=0.0)
    corners, shapes = ca.densify(machine.skeleton), list[Shape]()
    for k in range(corners.shape[1] - 1):
        start, end = corners[:, k], corners[:, k + 1]
        if not (end - start).is_zero():
            shapes.append(Shape(f"line {k + 1}", start, end, thick, _longest(machine, start, end)))
    return tuple(shapes)


def _longest(machine: Manipulator, start: ca.SX, end: ca.SX) -> float:
    """Return the length of a line at many positions of a machine at most, for lines that a joint extends [m]."""
    symbols = ca.vertcat(machine.q, *machine.symbols.values())
    low, high = machine.limits.get("q", ((-np.inf,) * machine.q.numel(), (np.inf,) * machine.q.numel()))
    lower, upper = (np.where(np.isfinite(side), side, own) for side, own in ((low, -2.0), (high, 2.0)))
    q = np.random.default_rng(1).uniform(lower, upper, (64, len(low)))
    values = np.hstack([q, np.tile([machine.nominal[name] for name in machine.symbols], (64, 1))])
    function = ca.Function("length", [symbols], [ca.norm_2(end - start)])
    return float(np.max(evaluate(function, values)[0]))


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
    margin: float = MARGIN,
) -> tuple[Constraint, ...]:
    """Return path constraints that keep the capsules of a machine clear of obstacles, of a floor and of each other.

    Every capsule is covered by spheres that stick out by at most 2 cm; obstacles are enlarged by their radius. At the
    nodes the motion keeps the clearance and a margin; where it uses up more than the margin between them, `solve`
    refines the grid, so that the clearance holds everywhere (its message says so, or that it did not succeed).
    `least_clearance` measures a motion in metres.

    Args:
        machine: with capsules (of its Links, of a URDF file, or by `with_shapes`), the one that the system is made of.
        obstacles: Ball, Box, Cylinder or HalfSpace, for all capsules but those of the first body.
        pairs: names of two bodies that must not touch.
        floor: height below which no capsule but those of the first body may be [m].
        clearance: distance that is kept along the whole motion >= 0 [m].
        margin: additional distance at the nodes > 0; a smaller one needs more elements, a larger one costs way [m].

    Raises:
        ValueError: the machine has no capsules, or a pair has a body without one.
    """
    spheres = _spheres(machine)
    distance = checks.number("clearance", clearance, "a distance >= 0 in m")
    if distance < 0.0:
        raise checks.refused("clearance", clearance, "a distance >= 0 in m")
    spare = checks.number("margin", margin, "a distance > 0 in m", above=0.0)
    distance += spare
    moving = [sphere for sphere in spheres if sphere.body != machine.bodies[0].name] or list(spheres)
    result: list[Constraint] = []
    for region in checks.several("obstacles", obstacles, "a list of regions such as Ball(...)"):
        for sphere in moving:
            wide = grown(region, sphere.radius + distance)
            result.append(replace(outside(wide, sphere.centre), between=share_of(wide, spare)))
    if floor is not None:
        height = checks.number("floor", floor, "a height in m")
        lowest = ca.vertcat(*(sphere.centre[2] - sphere.radius for sphere in moving))
        result.append(along(lowest, lower=height + distance, name="height of the links above the floor", between=spare))
    for first, second in _pairs(pairs, {sphere.body for sphere in spheres}):
        both = [(one, other) for one in spheres if one.body == first for other in spheres if other.body == second]
        apart = [one.radius + other.radius + distance for one, other in both]
        shares = [
            ca.sumsqr(one.centre - other.centre) / least**2 for (one, other), least in zip(both, apart, strict=True)
        ]
        name = f"distance of {first} and {second} (1 where they are too near)"
        result.append(along(ca.vertcat(*shares), lower=1.0, name=name, between=squared(spare / max(apart))))
    return tuple(result)


def self_pairs(machine: Manipulator) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that may touch within the limits of the joints, for `keep_clear`.

    Of all pairs with capsules those that touch at some of 2000 random positions and are apart at most of them;
    neighbours whose capsules overlap by construction are none.

    Args:
        machine: with capsules.
    """
    shapes, n = _shapes(machine), machine.q.numel()
    names = list(dict.fromkeys(shape.body for shape in shapes))
    low, high = machine.limits.get("q", ((-np.inf,) * n, (np.inf,) * n))
    lower, upper = (np.where(np.isfinite(side), side, own) for side, own in ((low, -np.pi), (high, np.pi)))
    q = np.random.default_rng(0).uniform(lower, upper, (2000, n))
    ends = _ends(machine, q)
    result = []
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            apart = np.min([
                segment_distance(ends[:, a], ends[:, b]) - shapes[a].radius - shapes[b].radius
                for a in range(len(shapes)) if shapes[a].body == first
                for b in range(len(shapes)) if shapes[b].body == second
            ], axis=0)  # fmt: skip
            if np.min(apart) < 0.0 and np.mean(apart < 0.0) < OVERLAPS:
                result.append((first, second))
    return tuple(result)


def _ends(machine: Manipulator, q: Array) -> Array:
    """Return both ends of all capsules at positions, (K, shapes, 2, 3)."""
    points = ca.densify(ca.vertcat(*(point for shape in machine.shapes for point in (shape.start, shape.end))))
    return np.asarray(evaluate(ca.Function("ends", [machine.q], [points]), q)[0].reshape(len(q), -1, 2, 3))


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
    lines = _ends(machine, points)
    share = np.linspace(0.0, 1.0, 41)[:, None]
    along_it = {
        id(shape): lines[:, k, None, 0] + share * (lines[:, k, None, 1] - lines[:, k, None, 0])
        for k, shape in enumerate(shapes)
    }
    result: dict[str, float] = {}
    for number, region in enumerate(obstacles, 1):
        signed = signed_distance(region)
        result[f"{type(region).__name__}_{number}"] = min(
            float(np.min(signed(along_it[id(shape)].reshape(-1, 3)))) - shape.radius for shape in moving
        )
    if floor is not None:
        result["floor"] = min(float(np.min(along_it[id(s)][..., 2])) - s.radius for s in moving) - floor
    for first, second in _pairs(pairs, {shape.body for shape in shapes}):
        result[f"{first}, {second}"] = min(
            float(np.min(segment_distance(*(along_it[id(s)][:, (0, -1)] for s in (one, other)))))
            - one.radius
            - other.radius
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
