"""Constraints that keep the links of an arm away from obstacles, from a floor and from each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.shapes import Shape
from models.rigid_bodies.clearances import (
    capsule_ends,
    movable,
    named_pairs,
    named_regions,
    shapes_of,
)
from models.rigid_bodies.joint import Capsule
from models.rigid_bodies.region_distances import TINY, nearness, segment_distance
from ocp import checks
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Constraint, along
from ocp.problem.regions import HalfSpace, Region

COVER = 0.02  # spheres along a capsule stick out by at most this [m]
THINNEST = 1e-3  # smallest such distance; the number of spheres grows with the root of its inverse [m]
OVERLAPS = 0.3  # share of random positions at which bodies that overlap by construction touch
SHARPNESS = 16  # p of the smooth least distance, which is below the true one by 4 to 9 % for two to four near spheres
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


def skeleton_shapes(
    machine: Manipulator, radius: float, within: tuple[Sequence[float], Sequence[float]] | None = None
) -> tuple[Shape, ...]:
    """Return a capsule along every line of the skeleton of a machine, for `with_shapes`, where none are published.

    Args:
        machine: such as spherical().
        radius: > 0 [m].
        within: lower and upper limits (n,) of the coordinates, which lines are how long at most; None: those of the
            machine, 2 rad or m where it has none.

    Raises:
        ValueError: the length of a line depends on a parameter that stays a symbol.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    thick = checks.number("radius", radius, "a radius > 0 in m", above=0.0)
    corners, shapes = ca.densify(machine.skeleton), list[Shape]()
    lines = [(corners[:, k], corners[:, k + 1]) for k in range(corners.shape[1] - 1)]
    lines = [(start, end) for start, end in lines if not (end - start).is_zero()]
    # The skeleton of a tree goes back along its side branches.
    lines = [line for k, line in enumerate(lines) if not any(_back(line, other) for other in lines[:k])]
    for start, end in lines:
        length = _longest(machine, start, end, within)
        if length > 1e-9:
            shapes.append(Shape(f"line {len(shapes) + 1}", start, end, thick, length))
    return tuple(shapes)


def _back(line: tuple[ca.SX, ca.SX], other: tuple[ca.SX, ca.SX]) -> bool:
    """Return whether a line is another one in the opposite direction."""
    return all(ca.is_equal(ca.densify(a), ca.densify(b), 9) for a, b in zip(line, reversed(other), strict=True))


def _longest(
    machine: Manipulator, start: ca.SX, end: ca.SX, within: tuple[Sequence[float], Sequence[float]] | None
) -> float:
    """Return the length of a line within limits at most, for lines that a joint extends [m]."""
    n = machine.q.numel()
    low, high = machine.limits.get("q", ((-np.inf,) * n, (np.inf,) * n)) if within is None else within
    lower, upper = (np.where(np.isfinite(side), side, own) for side, own in ((low, -2.0), (high, 2.0)))
    square = ca.simplify(ca.sumsqr(end - start))
    known = ca.vertcat(machine.q, *machine.symbols.values())
    random = np.random.default_rng(1)
    # The distance of two points that a slide moves apart is convex, and largest at an end of its travel.
    ends = np.where(random.integers(0, 2, (1024, n)) == 0, lower, upper)
    q = np.vstack([ends, random.uniform(lower, upper, (64, n))])
    values = np.hstack([q, np.tile([machine.nominal[name] for name in machine.symbols], (len(q), 1))])
    by_symbol = ca.jacobian(square, ca.vertcat(*machine.symbols.values())) if machine.symbols else ca.SX(1, 0)
    found, slopes = evaluate(ca.Function("length", [known], [square, ca.densify(by_symbol)]), values)
    varying = np.max(np.abs(slopes), axis=0, initial=0.0) > 1e-12 * np.max(found, initial=1.0)
    names = [name for name, varies in zip(machine.symbols, varying, strict=True) if varies]
    if names:
        raise ValueError(f"{names[0]}: stays a symbol, and the length of a link depends on it; give a number")
    return float(np.sqrt(np.max(found)))


def with_shapes(machine: Manipulator, shapes: Sequence[Shape]) -> Manipulator:
    """Return the machine with capsules of `body_capsule` beside those that it has.

    Raises:
        ValueError: a capsule was made for another machine.
    """
    given = checks.several("shapes", shapes, "a list of Shapes")
    known = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(machine.q, *machine.symbols.values()))}
    for shape in given:
        checks.instance("shapes, each", shape, Shape, "a Shape of body_capsule(...) or skeleton_shapes(...)")
        if any(symbol.element_hash() not in known for symbol in ca.symvar(ca.vertcat(shape.start, shape.end))):
            raise ValueError(f"shapes: {shape.body!r} was made for another machine than this {machine.name}")
    return replace(machine, shapes=(*machine.shapes, *given))


def keep_clear(
    machine: Manipulator,
    obstacles: Sequence[Region] | Mapping[str, Region] = (),
    *,
    pairs: Sequence[tuple[str, str]] = (),
    floor: float | None = None,
    clearance: float = 0.0,
    margin: float = MARGIN,
    cover: float = COVER,
) -> tuple[Constraint, ...]:
    """Return path constraints that keep the capsules of a machine clear of obstacles, of a floor and of each other.

    Spheres that stick out by at most `cover` contain every capsule; obstacles are enlarged by their radius (for half
    spaces and the floor the ends of the capsules are enough). At the nodes the motion keeps the clearance and a margin;
    where it uses up more than the margin between them, `solve` refines the grid, so that the clearance holds everywhere
    (its message says so, or that it did not succeed).
    `least_clearance` measures a motion in metres.

    Args:
        machine: with capsules (of its Links, of a URDF file, or by `with_shapes`), the one that the system is made of.
        obstacles: Ball, Box, Cylinder or HalfSpace, by name or as a list, for all capsules but those that do not move
            and those of the first body; points that no joint moves, where the arm stands on its base, are left out.
        pairs: names of two bodies that must not touch.
        floor: height below which none of these capsules may be [m].
        clearance: distance that is kept along the whole motion >= 0 [m].
        margin: additional distance at the nodes > 0; a smaller one needs more elements, a larger one costs way [m].
        cover: how far the spheres stick out of the capsules at most >= 1 mm, those of pairs half as far each; a smaller
            one takes more of them [m].

    Raises:
        ValueError: the machine has no capsules, or a pair has a body without one.
    """
    stuck_out = _covering(cover)
    distance = checks.number("clearance", clearance, "a distance >= 0 in m")
    if distance < 0.0:
        raise checks.refused("clearance", clearance, "a distance >= 0 in m")
    spare = checks.number("margin", margin, "a distance > 0 in m", above=0.0)
    distance += spare
    shapes = movable(machine)
    moving, ends = (
        # A point that no joint moves is where it is, and may stand on the floor.
        [one for one in spheres if ca.depends_on(one.centre, machine.q)] or spheres
        # Half spaces meet a capsule at one of its ends first.
        for spheres in (_spheres(shapes, stuck_out), _ends(shapes))
    )
    result: list[Constraint] = []
    for called, region in named_regions(obstacles).items():
        kept = ends if isinstance(region, HalfSpace) else moving
        for body in dict.fromkeys(sphere.body for sphere in kept):
            name = f"clearance of {body} from {called} (1 at its surface)"
            if isinstance(region, HalfSpace):
                own = [sphere for sphere in ends if sphere.body == body]
                rows = ca.vertcat(*(nearness(region, sphere.radius + distance, sphere.centre)[0] for sphere in own))
                result.append(along(rows, lower=1.0, name=name, between=spare))
            else:
                own = [sphere for sphere in moving if sphere.body == body]
                shares = [nearness(region, sphere.radius + distance, sphere.centre) for sphere in own]
                widest = max(half for _, half in shares)
                least = smooth_least([ratio for ratio, _ in shares])
                result.append(along(least, lower=1.0, name=name, between=spare / widest))
    if floor is not None:
        height = checks.number("floor", floor, "a height in m")
        lowest = ca.vertcat(*(sphere.centre[2] - sphere.radius for sphere in ends))
        result.append(along(lowest, lower=height + distance, name="height of the links above the floor", between=spare))
    spheres = _spheres(shapes_of(machine), cover / 2.0)
    for first, second in named_pairs(pairs, {sphere.body for sphere in spheres}):
        both = [(one, other) for one in spheres if one.body == first for other in spheres if other.body == second]
        apart = [one.radius + other.radius + distance for one, other in both]
        ratios = [
            ca.sqrt(ca.sumsqr(one.centre - other.centre) / least**2 + TINY)
            for (one, other), least in zip(both, apart, strict=True)
        ]
        name = f"distance of {first} and {second} (1 where they are too near)"
        result.append(along(smooth_least(ratios), lower=1.0, name=name, between=spare / max(apart)))
    return tuple(result)


def _covering(cover: float) -> float:
    value = checks.number("cover", cover, "a distance >= 0.001 in m")
    if value < THINNEST:
        raise checks.refused("cover", cover, "a distance >= 0.001 in m")
    return value


def smooth_least(ratios: Sequence[ca.SX]) -> ca.SX:
    """Return a smooth function below the least of positive ratios: (sum r_i^-p)^(-1/p).

    One row for all spheres of a body instead of one for each, most of which are far from active: on an arm of six axes
    with self-collision IPOPT takes 35 iterations instead of more than 500.
    """
    return ca.sum1(ca.vertcat(*ratios) ** -SHARPNESS) ** (-1.0 / SHARPNESS) if len(ratios) > 1 else ratios[0]


def self_pairs(machine: Manipulator) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that may touch within the limits of the joints, for `keep_clear`.

    Of all pairs with capsules those that touch at some of 2000 random positions and are apart at most of them;
    neighbours whose capsules overlap by construction are none.

    Args:
        machine: with capsules.
    """
    shapes, n = shapes_of(machine), machine.q.numel()
    names = list(dict.fromkeys(shape.body for shape in shapes))
    low, high = machine.limits.get("q", ((-np.inf,) * n, (np.inf,) * n))
    lower, upper = (np.where(np.isfinite(side), side, own) for side, own in ((low, -np.pi), (high, np.pi)))
    q = np.random.default_rng(0).uniform(lower, upper, (2000, n))
    ends = capsule_ends(machine, q)
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


def _ends(shapes: Sequence[Shape]) -> list[Sphere]:
    """Return the balls at both ends of every capsule, each point once."""
    result: list[Sphere] = []
    for shape in shapes:
        for centre in (shape.start, shape.end):
            same = (one for one in result if one.body == shape.body and one.radius == shape.radius)
            if not any(ca.is_equal(one.centre, centre, 4) for one in same):
                result.append(Sphere(shape.body, centre, shape.radius))
    return result


def _spheres(shapes: Sequence[Shape], cover: float) -> list[Sphere]:
    result = []
    for shape in shapes:
        # Balls of radius R at distances d contain the capsule where R^2 = r^2 + (d / 2)^2.
        widest = 2.0 * np.sqrt((shape.radius + cover) ** 2 - shape.radius**2)
        count = int(np.ceil(shape.length / widest)) + 1 if shape.length > 0.0 else 1
        apart = shape.length / max(count - 1, 1)
        radius = float(np.hypot(shape.radius, apart / 2.0)) if count > 1 else shape.radius
        for k in range(count):
            share = k / max(count - 1, 1)
            result.append(Sphere(shape.body, shape.start + share * (shape.end - shape.start), radius))
    return result
