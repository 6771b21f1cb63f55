"""From joints as the user gives them to a tree: parents first, fixed joints merged, Parameters as symbols, checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from models.machines.inertia import ROUNDING
from models.machines.parameters import Parameter, Value
from models.rigid_bodies.inertia import LinkInertia
from models.rigid_bodies.joint import Capsule, Joint, Kind
from models.rigid_bodies.scalars import (
    Entry,
    Matrix,
    apply,
    identity,
    mul,
    numeric,
    plus,
    product,
    snapped,
    transposed,
)
from models.rigid_bodies.tree import Pose, Tree, TreeJoint, turned_to
from ocp import checks
from ocp.checks import Array

# Published inertias break the triangle inequality: those of link 3 of the PUMA 560 by 10 %.
PUBLISHED = 1.25
NEGATIVE = 1e-9  # a moment above minus this multiple of the largest entry is zero with rounding


@dataclass(eq=False)
class Assembly:
    """A tree with everything that does not enter the equations: joints of the user, limits, shapes."""

    joints: tuple[Joint, ...]  # that move, in the order of the coordinates
    tree: Tree  # in the frames of the user
    symbols: dict[str, ca.SX]
    nominal: dict[str, float]
    shapes: list[list[Capsule]] = field(default_factory=list)  # of every joint, in the frame of its link
    notes: list[str] = field(default_factory=list)


def assemble_tree(
    joints: Sequence[Joint], tip: str | None, tool: Sequence[float], tool_rotation: Array | None = None
) -> Assembly:
    """Return the tree of joints.

    Args:
        joints: in any order, each with the name of its parent.
        tip: name of the joint whose link carries the tool, the last one if None.
        tool: (3,) tool point in the frame of that joint [m].
        tool_rotation: (3, 3) axes of the tool in the frame of that joint; None for its own axes.

    Raises:
        ValueError: a name twice, an unknown parent, a loop, no joint that moves, an inertia that no body has.
    """
    given: list[Joint] = list(checks.several("joints", joints, "a list of Joints"))
    for joint in given:
        checks.instance("joints, each", joint, Joint, "a Joint")
    ordered = _parents_first(given)
    end = ordered[-1].name if tip is None else tip
    if end not in {joint.name for joint in ordered}:
        raise ValueError(f"tip: no joint {end!r}; there are {', '.join(joint.name for joint in ordered)}")
    assembly = Assembly((), Tree((), ()), {}, {})
    frames: dict[str, tuple[int, Matrix, Sequence[Entry]]] = {"": (-1, identity(), [0.0] * 3)}
    moving: list[Joint] = []
    links: list[TreeJoint] = []
    poses: list[Pose] = []
    base = LinkInertia.zero()
    for joint in ordered:
        entry = _symbols_of(joint, assembly)
        parent, rotation, origin = frames[joint.parent]
        turned = snapped(numeric(rotation) @ joint.turned())
        at = plus(apply(rotation, entry("origin", joint.origin)), origin)
        body = _inertia(joint, entry)
        if joint.kind is Kind.FIXED:
            frames[joint.name] = (parent, turned, at)
            carried = body.moved(turned, at)
            if parent < 0:
                base = base + carried
            else:
                links[parent] = replace(links[parent], inertia=links[parent].inertia + carried)
                assembly.shapes[parent] += [_moved(c, turned, at) for c in joint.link.capsules]
            continue
        to_axis = turned_to(joint.axis)
        own = transposed(snapped(to_axis))
        (rotor,), (gear,) = entry("rotor", (joint.rotor,)), entry("gear", (joint.gear,))
        spin = mul(gear, rotor) if joint.carried and parent >= 0 else 0.0
        revolute = joint.kind is Kind.REVOLUTE
        frame = snapped(numeric(turned) @ to_axis)
        reflected = mul(mul(gear, gear), rotor)
        links.append(TreeJoint(joint.name, parent, revolute, frame, at, body.moved(own, [0.0] * 3), reflected, spin))
        poses.append(Pose(len(links) - 1, own, [0.0] * 3))
        frames[joint.name] = (len(links) - 1, own, [0.0] * 3)
        moving.append(joint)
        assembly.shapes.append(list(joint.link.capsules))
    if not moving:
        raise ValueError("joints: none of them moves; give at least one Kind.REVOLUTE or Kind.PRISMATIC")
    link, rotation, origin = frames[end]
    point = [float(x) for x in checks.column("tool", tool, 3, "three numbers in m")]
    axes = rotation if tool_rotation is None else product(rotation, snapped(tool_rotation))
    pose = Pose(link, axes, plus(apply(rotation, point), origin))
    assembly.joints = tuple(moving)
    assembly.tree = Tree(tuple(links), (pose, *poses), None, base)
    check_inertias(assembly)
    return assembly


def _parents_first(joints: Sequence[Joint]) -> list[Joint]:
    """Return the joints with every parent before its children, otherwise in the order given."""
    if not joints:
        raise checks.refused("joints", joints, "at least one Joint")
    names = [joint.name for joint in joints]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"joints: two joints are called {name!r}; rename one of them")
    for joint in joints:
        if joint.parent and joint.parent not in names:
            raise ValueError(
                f"joint {joint.name!r}: no joint {joint.parent!r} to be its parent; there are {', '.join(names)}"
            )
    done, left = {""}, list(joints)
    ordered: list[Joint] = []
    while left:
        ready = [joint for joint in left if joint.parent in done]
        if not ready:
            stuck = ", ".join(joint.name for joint in left)
            raise ValueError(f"joints: {stuck} form a loop of parents; a tree has none")
        # One at a time, so that the order of the user is kept as far as it can be.
        ordered.append(ready[0])
        done.add(ready[0].name)
        left.remove(ready[0])
    return ordered


def _symbols_of(joint: Joint, assembly: Assembly) -> _Entries:
    for name, value in joint.symbols().items():
        assembly.symbols[name] = ca.SX.sym(name)
        assembly.nominal[name] = float(value.value)
    return _Entries(joint.name, assembly.symbols)


@dataclass(frozen=True, eq=False)
class _Entries:
    """Numbers and symbols of the fields of one joint."""

    joint: str
    symbols: dict[str, ca.SX]

    def __call__(self, name: str, values: Sequence[Value]) -> list[Entry]:
        """Return the entries of a field; components of several are numbered."""
        result: list[Entry] = []
        for i, value in enumerate(values):
            if isinstance(value, Parameter):
                key = f"{self.joint}.{name}" if len(values) == 1 else f"{self.joint}.{name}_{i + 1}"
                result.append(self.symbols[key])
            else:
                result.append(float(value))
        return result


def _inertia(joint: Joint, entry: _Entries) -> LinkInertia:
    xx, yy, zz, xy, xz, yz = (*entry("inertia", joint.link.inertia), 0.0, 0.0, 0.0)[:6]
    tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    (mass,) = entry("mass", (joint.link.mass,))
    return LinkInertia.of(mass, entry("centre", joint.link.centre), tensor)


def _moved(capsule: Capsule, rotation: Matrix, origin: Sequence[Entry]) -> Capsule:
    offset = np.array([float(x) for x in origin])
    turn = numeric(rotation)
    return Capsule(
        tuple(turn @ np.array(capsule.start) + offset), tuple(turn @ np.array(capsule.end) + offset), capsule.radius
    )


def check_inertias(assembly: Assembly) -> None:
    """Refuse inertias that no rigid body has, as far as the motion of a link feels them.

    A link that only turns about one direction feels its moment about it, one that never turns nothing.

    Raises:
        ValueError: a principal moment < 0, or larger than the sum of the others; the message names the joint.
    """
    tree = assembly.tree
    for i, joint in enumerate(assembly.joints):
        inertia = tree.joints[i].inertia
        numbers = [inertia.mass, *inertia.moment, *(x for row in inertia.tensor for x in row)]
        if not all(isinstance(x, int | float) for x in numbers):
            continue
        axes, rotation = [], np.eye(3)
        for k in tree.path(i):
            if tree.joints[k].revolute:
                axes.append(rotation[:, 2])
            rotation = rotation @ numeric(tree.joints[k].rotation).T
        moment = np.array(inertia.moment, dtype=float)
        mass = float(inertia.mass)  # type: ignore[arg-type]
        centre = moment / mass if mass > 0.0 else np.zeros(3)
        tensor = numeric(inertia.tensor) - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        note = _check_felt(joint.name, tensor, axes)
        assembly.notes += [note] if note else []


def _check_felt(name: str, tensor: Array, axes: Sequence[Array]) -> str:
    """Return a note on an inertia that is slightly wrong; empty for a good one."""
    if not axes:
        return ""
    slack = NEGATIVE * max(float(np.max(np.abs(tensor))), 1e-300)
    if all(np.linalg.norm(np.cross(axes[0], axis)) < 1e-9 for axis in axes):
        moment = float(axes[0] @ tensor @ axes[0])
        if moment < -slack:
            raise ValueError(
                f"joint {name!r}: the inertia of its link about the axis is {moment:g} kg m^2, expected >= 0"
            )
        return ""
    moments = np.linalg.eigvalsh(tensor)
    listed = ", ".join(f"{moment:g}" for moment in moments)
    if moments[0] < -slack or moments[2] > PUBLISHED * (moments[0] + moments[1]) + slack:
        raise ValueError(
            f"joint {name!r}: the inertia of its link has the principal moments {listed} kg m^2, expected all >= 0 and "
            "the largest at most the sum of the others; no rigid body has them"
        )
    if moments[2] > (1.0 + ROUNDING) * (moments[0] + moments[1]) + slack:
        return f"joint {name!r}: the principal moments {listed} kg m^2 of its link are those of no rigid body; kept"
    return ""
