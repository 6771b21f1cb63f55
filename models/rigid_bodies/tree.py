"""A kinematic tree in link frames that make its recursions short: modified Denavit-Hartenberg, base parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from models.rigid_bodies.inertia import LinkInertia
from models.rigid_bodies.scalars import (
    Entry,
    Matrix,
    Vector,
    apply,
    identity,
    minus,
    numeric,
    plus,
    snapped,
    transposed,
    without_rounding,
)
from ocp.checks import Array

PARALLEL = 1e-9  # sine of the angle below which two axes are parallel


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A joint that moves, its axis z of its own frame, and the inertia of its link in that frame."""

    name: str
    parent: int  # index of the joint whose link carries it, always smaller than its own; -1 is the base
    revolute: bool  # turns about z, otherwise it moves along z
    rotation: Matrix  # (3, 3) numbers, frame of the link at q = 0 -> frame of the parent
    origin: Vector  # (3,) of the frame in the parent [m]
    inertia: LinkInertia
    rotor: Entry = 0.0  # reflected rotor inertia, gear^2 J [kg m^2 or kg]
    spin: Entry = 0.0  # gear J of a rotor parallel to z that the parent link carries [kg m^2 or kg m]


@dataclass(frozen=True, eq=False)
class Pose:
    """A frame fixed to a link: of the tool, of a body, of a corner."""

    link: int  # -1 is the base
    rotation: Matrix  # (3, 3) numbers
    origin: Vector  # (3,) [m]


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints in an order in which parents come first, and frames that move along."""

    joints: tuple[TreeJoint, ...]
    poses: tuple[Pose, ...]
    coupling: Matrix | None = None  # (n, n) constant added to the metric by rotors of effects
    base: LinkInertia = field(default_factory=LinkInertia.zero)  # inertia that no joint moves

    def children(self, i: int) -> list[int]:
        """Return the indices of the joints that the link i carries."""
        return [k for k, joint in enumerate(self.joints) if joint.parent == i]

    def path(self, i: int) -> list[int]:
        """Return the joints from link i to the base, i first."""
        indices = []
        while i >= 0:
            indices.append(i)
            i = self.joints[i].parent
        return indices

    def compact(self) -> Tree:
        """Return the same tree in modified Denavit-Hartenberg frames with the smallest set of inertial parameters."""
        return _regrouped(_reframed(self))


def _reframed(tree: Tree) -> Tree:
    """Return the tree with x of every link along the common normal to the next axis and its origin at the foot.

    Sliding the origin along z and turning the frame about z commute with the motion of the joint.

    Source: W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, chapter 3.
    """
    turns = [_normal(tree, i) for i in range(len(tree.joints))]
    joints = []
    for i, joint in enumerate(tree.joints):
        turn, foot = turns[i]
        before, start = (np.eye(3), [0.0] * 3) if joint.parent < 0 else turns[joint.parent]
        rotation, back = numeric(joint.rotation), [[float(x) for x in row] for row in before.T]
        shifted = minus(plus(apply(joint.rotation, foot), joint.origin), start)
        joints.append(
            replace(
                joint,
                rotation=snapped(before.T @ rotation @ turn),
                origin=without_rounding(apply(back, shifted), 10.0),
                inertia=joint.inertia.moved(transposed(snapped(turn)), apply(transposed(snapped(turn)), _minus(foot))),
            )
        )
    poses = []
    for pose in tree.poses:
        if pose.link >= 0:
            turn, foot = turns[pose.link]
            rows = transposed(snapped(turn))
            origin = without_rounding(apply(rows, minus(pose.origin, foot)), 10.0)
            pose = Pose(pose.link, snapped(turn.T @ numeric(pose.rotation)), origin)
        poses.append(pose)
    return replace(tree, joints=tuple(joints), poses=tuple(poses))


def _normal(tree: Tree, i: int) -> tuple[Array, list[Entry]]:
    """Return the turn about z and the shift along z of the frame of link i; the first child decides."""
    children = tree.children(i)
    if not children:
        return np.eye(3), [0.0] * 3
    child = tree.joints[children[0]]
    own, axis, origin = np.array([0.0, 0.0, 1.0]), numeric(child.rotation)[:, 2], child.origin
    normal = np.cross(own, axis)
    size = float(np.linalg.norm(normal))
    if size > PARALLEL:
        normal = normal / size
        # origin + t axis - s own lies along the normal.
        row = np.linalg.inv(np.column_stack([own, -axis, normal]))[0]
        shift = apply([[float(x) for x in row]], origin)
        foot: list[Entry] = [0.0, 0.0, *without_rounding(shift, 10.0)]
    else:
        foot = [0.0, 0.0, origin[2]]
        across = [x for x in origin[:2] if isinstance(x, int | float)]
        normal = np.array([1.0, 0.0, 0.0])
        # A symbolic distance fixes the direction only where it is the only component.
        if len(across) == 2 and np.hypot(across[0], across[1]) > PARALLEL:
            normal = np.array([*across, 0.0]) / np.hypot(across[0], across[1])
        elif across == [0.0] and isinstance(origin[0], int | float):
            normal = np.array([0.0, 1.0, 0.0])
    return np.array(snapped(np.column_stack([normal, np.cross(own, normal), own]))), foot


def _regrouped(tree: Tree) -> Tree:
    """Return the tree with the inertia that a joint does not feel moved to the link before; M and dU/dq stay."""
    inertias, base = [joint.inertia for joint in tree.joints], tree.base
    for i in reversed(range(len(tree.joints))):
        joint = tree.joints[i]
        felt, rest = inertias[i].split(joint.revolute)
        inertias[i] = _clean(felt, inertias[i])
        carried = rest.moved(joint.rotation, joint.origin)
        if joint.parent >= 0:
            inertias[joint.parent] = inertias[joint.parent] + carried
        else:
            base = base + carried
    joints = tuple(replace(joint, inertia=inertia) for joint, inertia in zip(tree.joints, inertias, strict=True))
    return replace(tree, joints=joints, base=base)


def _clean(inertia: LinkInertia, whole: LinkInertia) -> LinkInertia:
    """Return an inertia without the rounding errors of numbers that cancel in it."""
    every = [*whole.moment, *(x for row in whole.tensor for x in row)]
    scale = max((abs(x) for x in every if isinstance(x, int | float)), default=0.0)
    rows = [without_rounding(row, scale) for row in inertia.tensor]
    return LinkInertia(inertia.mass, without_rounding(inertia.moment, scale), rows)


def _minus(a: Vector) -> list[Entry]:
    return minus([0.0] * 3, a)


def turned_to(axis: Sequence[float] | Array) -> Array:
    """Return a rotation whose third column is an axis; a permutation if the axis is one of the frame."""
    a = np.array(axis, dtype=float)
    a = np.array([snapped(np.array([a / np.linalg.norm(a)]))[0]], dtype=float)[0]
    a = a / np.linalg.norm(a)
    if np.array_equal(a, [0.0, 0.0, 1.0]):
        return np.array(identity(), dtype=float)
    x = np.eye(3)[(int(np.argmax(np.abs(a))) + 1) % 3]
    x = x - a * (a @ x)
    x = x / np.linalg.norm(x)
    return np.array(snapped(np.column_stack([x, np.cross(a, x), a])), dtype=float)
