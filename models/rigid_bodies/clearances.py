"""Distances of the links of an arm from obstacles, from a floor and from each other, in metres."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.shapes import Shape
from models.rigid_bodies.region_distances import segment_distance, signed_distance
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.regions import HalfSpace, Region

SAMPLES = 41  # points of a capsule among which the one nearest to an obstacle is looked for
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
STEPS = 40  # of the search between them
FLOOR = "floor"


@dataclass(frozen=True)
class Distance:
    """How near a body comes to something along a motion."""

    body: str
    other: str  # an obstacle, the floor, or another body
    least: float  # [m]; negative where they overlap
    row: int  # of the positions at which they are nearest

    def __str__(self) -> str:
        if self.least < 0.0:
            return f"{self.body} is {-self.least:.4g} m deep in {self.other}"
        return f"{self.body} is {self.least:.4g} m away from {self.other}"


def least_clearance(
    machine: Manipulator,
    q: Array,
    obstacles: Sequence[Region] | Mapping[str, Region] = (),
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
    result: dict[str, float] = {}
    for one in distances(machine, q, named_regions(obstacles), pairs, floor):
        pair = (one.body, one.other) in [(str(a), str(b)) for a, b in pairs]
        name = f"{one.body}, {one.other}" if pair else one.other
        result[name] = min(result.get(name, np.inf), one.least)
    return result


def named_regions(obstacles: Sequence[Region] | Mapping[str, Region]) -> dict[str, Region]:
    """Return obstacles by the names that messages use: their own, or Ball_1, Box_2."""
    if isinstance(obstacles, Mapping):
        return dict(obstacles)
    several = checks.several("obstacles", obstacles, "a list of regions such as Ball(...)")
    return {f"{type(region).__name__}_{number}": region for number, region in enumerate(several, 1)}


def distances(
    machine: Manipulator, q: Array, obstacles: Mapping[str, Region], pairs: Sequence[tuple[str, str]] = (),
    floor: float | None = None,
) -> list[Distance]:  # fmt: skip
    """Return how near every body comes to every obstacle, to the floor and to the other body of its pairs.

    Args:
        machine: with capsules; parameters that stay symbols have their nominal values.
        q: (K, n) positions along the motion [rad or m].
        obstacles: by name.
        pairs, floor: as for `keep_clear`.
    """
    shapes = shapes_of(machine)
    moving = movable(machine)
    points = np.atleast_2d(checks.numbers("q", q, "positions (K, n)"))
    lines = capsule_ends(machine, points)
    number = {id(shape): k for k, shape in enumerate(shapes)}
    result = []
    for name, region in obstacles.items():
        signed = signed_distance(region)
        apart: dict[str, list[Array]] = {shape.body: [] for shape in moving}
        for shape in moving:
            ends = lines[:, number[id(shape)]]
            if isinstance(region, HalfSpace):
                nearest = np.min([signed(ends[:, k]) for k in _moved_ends(machine, shape)], axis=0)
            else:
                nearest = _from_line(signed, ends)
            apart[shape.body].append(nearest - shape.radius)
        result += [_nearest(body, name, several) for body, several in apart.items()]
    if floor is not None:
        apart = {shape.body: [] for shape in moving}
        for shape in moving:
            heights = lines[:, number[id(shape)], _moved_ends(machine, shape), 2]
            apart[shape.body].append(np.min(heights, axis=1) - shape.radius - floor)
        result += [_nearest(body, FLOOR, several) for body, several in apart.items()]
    for first, second in named_pairs(pairs, {shape.body for shape in shapes}):
        several = [
            segment_distance(lines[:, number[id(one)]], lines[:, number[id(other)]]) - one.radius - other.radius
            for one in shapes if one.body == first for other in shapes if other.body == second
        ]  # fmt: skip
        result.append(_nearest(first, second, several))
    return result


def _nearest(body: str, other: str, several: Sequence[Array]) -> Distance:
    apart = np.min(several, axis=0)
    row = int(np.argmin(apart))
    return Distance(body, other, float(apart[row]), row)


def _from_line(signed: Callable[[Array], Array], ends: Array) -> Array:
    """Return the least signed distances (K,) of lines with ends (K, 2, 3) from a convex region.

    The distance from a convex region is convex along a line: the least of some points, and a search between its
    neighbours by golden sections.
    """
    begin, way = ends[:, 0], ends[:, 1] - ends[:, 0]

    def at(share: Array) -> Array:
        return signed(begin + share[:, None] * way)

    shares = np.linspace(0.0, 1.0, SAMPLES)
    sampled = np.stack([at(np.full(len(begin), share)) for share in shares])
    best = np.argmin(sampled, axis=0)
    low, high = shares[np.maximum(best - 1, 0)], shares[np.minimum(best + 1, SAMPLES - 1)]
    for _ in range(STEPS):
        one, other = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = at(one) < at(other)
        low, high = np.where(left, low, one), np.where(left, other, high)
    return np.asarray(np.minimum(sampled.min(axis=0), at((low + high) / 2.0)))


def capsule_ends(machine: Manipulator, q: Array) -> Array:
    """Return both ends of all capsules at positions (K, n), as (K, shapes, 2, 3) [m]."""
    points = ca.densify(ca.vertcat(*(point for shape in machine.shapes for point in (shape.start, shape.end))))
    symbols = ca.vertcat(machine.q, *machine.symbols.values())
    numbers = np.tile([machine.nominal[name] for name in machine.symbols], (len(q), 1))
    return np.asarray(evaluate(ca.Function("ends", [symbols], [points]), np.hstack([q, numbers]))[0].reshape(
        len(q), -1, 2, 3))  # fmt: skip


def shapes_of(machine: Manipulator) -> tuple[Shape, ...]:
    """Return the capsules of a machine.

    Raises:
        ValueError: it has none.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator with capsules")
    if not machine.shapes:
        raise ValueError(
            f"machine: {machine.name} has no capsules; give them in its Links, or one along every line of its "
            "skeleton by with_shapes(machine, skeleton_shapes(machine, radius))"
        )
    return machine.shapes


def movable(machine: Manipulator) -> tuple[Shape, ...]:
    """Return the capsules that are kept away from obstacles.

    All but those that no coordinate moves and those of the first body, with the lines of a skeleton that move as it
    does. A point that no coordinate moves may stand on the floor.
    """
    shapes, first = shapes_of(machine), machine.bodies[0]
    placed = ca.vertcat(first.centre, ca.vec(first.orientation))
    others = ca.vertcat(*(q for q in ca.vertsplit(machine.q) if not ca.depends_on(placed, q)))
    bodies = {body.name for body in machine.bodies}
    moved = [shape for shape in shapes if ca.depends_on(_places(shape), machine.q)]
    beyond = (
        shape
        for shape in moved
        if shape.body != first.name and (shape.body in bodies or ca.depends_on(_places(shape), others))
    )
    return tuple(beyond) or tuple(moved) or shapes


def _moved_ends(machine: Manipulator, shape: Shape) -> list[int]:
    """Return which ends of a capsule coordinates move; both if none."""
    moved = [k for k, end in enumerate((shape.start, shape.end)) if ca.depends_on(end, machine.q)]
    return moved or [0, 1]


def _places(shape: Shape) -> ca.SX:
    return ca.vertcat(shape.start, shape.end)


def without_capsules(machine: Manipulator) -> tuple[str, ...]:
    """Return the bodies that nothing is kept away from, as neither they nor the lines of the arm have capsules."""
    shaped = {shape.body for shape in machine.shapes}
    if "line 1" in shaped:
        return ()
    return tuple(body.name for body in machine.bodies[1:] if body.name not in shaped)


def named_pairs(pairs: Sequence[tuple[str, str]], bodies: set[str]) -> list[tuple[str, str]]:
    """Return pairs of bodies with capsules, checked."""
    given = checks.several("pairs", pairs, "a list of pairs of bodies")
    for pair in given:
        if not isinstance(pair, tuple | list) or len(pair) != 2 or not set(map(str, pair)) <= bodies:
            raise ValueError(
                f"pairs: got {checks.shown(pair)}, expected two bodies with capsules of {', '.join(sorted(bodies))}"
            )
        if str(pair[0]) == str(pair[1]):
            raise ValueError(f"pairs: got {checks.shown(pair)}, expected two different bodies")
    return [(str(first), str(second)) for first, second in given]
