"""A tree of joints and links as a Manipulator, so that forms, effects, tasks and pictures work as for the others."""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca

from models.machines.frames import coordinate, ldl, udu
from models.machines.manipulator import Body, Coordinate, Drive, Ends, Manipulator
from models.machines.manipulator import symbols as symbols_of
from models.machines.shapes import Shape
from models.rigid_bodies.assembly import Assembly
from models.rigid_bodies.joint import Joint, Kind
from models.rigid_bodies.placements import Placements
from models.rigid_bodies.recursions import Recursions
from models.rigid_bodies.scalars import column, is_zero, matrix_of
from models.rigid_bodies.tree_recursion import TreeRecursion


def manipulator(name: str, assembly: Assembly, notes: Sequence[str] = ()) -> Manipulator:
    """Return the Manipulator of a tree.

    Args:
        name: of the machine.
        assembly: made by `assemble_tree`.
        notes: sentences about how the tree was read.
    """
    joints = assembly.joints
    coordinates = tuple(Coordinate(joint.name, _unit(joint)) for joint in joints)
    q, v, tau = (symbols_of(letter, coordinates) for letter in ("q", "v", "tau"))
    recursion = TreeRecursion(assembly.tree, q, tuple(joint.name for joint in joints))
    posed = Placements(Recursions(assembly.tree.compact(), q))
    axes, tool = posed.pose(0)
    bodies = tuple(_body(recursion, posed, i, joint) for i, joint in enumerate(joints))
    metric = recursion.metric
    slope = ca.jacobian(column(tool), q)
    return Manipulator(
        name=name,
        coordinates=coordinates,
        q=q,
        v=v,
        tau=tau,
        metric=metric,
        bodies=bodies,
        tool=ca.densify(column(tool)),
        tool_metric=ca.sparsify(slope.T @ slope),
        skeleton=_skeleton(assembly, posed, tool, bodies),
        drives=tuple(Drive(f"{'M' if c.unit == 'rad' else 'F'}_{c.name}", 1) for c in coordinates),
        frames={
            "coordinate": coordinate(q, metric),
            "innovations": udu(q, metric, "innovations"),
            "ldl": ldl(q, metric),
            "udu": udu(q, metric),
        },
        nominal=dict(assembly.nominal),
        symbols=dict(assembly.symbols),
        inertia={joint.name: f"the link of {joint.name} or those beyond it" for joint in joints},
        default_frame="coordinate",
        tool_axes=matrix_of(axes),
        recursion=recursion,
        limits=_limits(joints),
        damping=tuple(joint.damping for joint in joints),
        friction=tuple(joint.friction for joint in joints),
        shapes=_shapes(assembly, posed),
        notes=(*notes, *assembly.notes),
        rotors=_unless_zero([joint.rotor for joint in assembly.tree.joints]),
        spins=_unless_zero([joint.spin for joint in assembly.tree.joints]),
    )


def _unless_zero(entries: Sequence[ca.SX | float]) -> tuple[ca.SX | float, ...]:
    return () if all(is_zero(entry) for entry in entries) else tuple(entries)


def _limits(joints: Sequence[Joint]) -> dict[str, tuple[Ends, Ends]]:
    """Return lower and upper ends of the signals q, v and tau, of those for which anything is known."""
    columns = {
        "q": [(joint.lower, joint.upper) for joint in joints],
        "v": [(_negative(joint.speed), joint.speed) for joint in joints],
        "tau": [(_negative(joint.effort), joint.effort) for joint in joints],
    }
    return {
        name: (
            tuple(-math.inf if low is None else float(low) for low, _ in pairs),
            tuple(math.inf if high is None else float(high) for _, high in pairs),
        )
        for name, pairs in columns.items()
        if any(end is not None for pair in pairs for end in pair)
    }


def _negative(size: float | None) -> float | None:
    return None if size is None else -size


def _unit(joint: Joint) -> str:
    return "rad" if joint.kind is Kind.REVOLUTE else "m"


def _body(recursion: TreeRecursion, posed: Placements, i: int, joint: Joint) -> Body:
    """Return the body of a link with everything fixed to it, in the axes of the user."""
    pose = recursion.tree.poses[1 + i]
    own = recursion.tree.joints[i].inertia
    rotation, origin = posed.pose(1 + i)
    turn = matrix_of(rotation)
    to_user = matrix_of(pose.rotation).T
    centre = column(recursion.centre(i))
    shifted = ca.densify(centre)
    about = matrix_of(own.tensor) - own.mass * (ca.dot(shifted, shifted) * ca.SX.eye(3) - shifted @ shifted.T)
    position = column(origin) + turn @ (to_user @ centre)
    return Body(joint.name, own.mass, position, turn, ca.sparsify(to_user @ about @ to_user.T))


def _shapes(assembly: Assembly, posed: Placements) -> tuple[Shape, ...]:
    """Return the capsules of all links in the base."""
    result = []
    for i, (joint, capsules) in enumerate(zip(assembly.joints, assembly.shapes, strict=True)):
        rotation, origin = posed.pose(1 + i)
        for capsule in capsules:
            start, end = (
                ca.densify(column(origin) + matrix_of(rotation) @ ca.DM([float(x) for x in point]))
                for point in (capsule.start, capsule.end)
            )
            length = math.dist([float(x) for x in capsule.start], [float(x) for x in capsule.end])
            result.append(Shape(joint.name, start, end, float(capsule.radius), length))
    return tuple(result)


def _skeleton(assembly: Assembly, posed: Placements, tool: Sequence[ca.SX | float], bodies: Sequence[Body]) -> ca.SX:
    """Return the corners (3, k) of a line from the base to the tool.

    It goes into every side branch, to the mass centre of its last link, and back.
    """
    tree, base = posed.recursions.tree, ca.SX(3, 1)
    way = list(reversed(tree.path(assembly.tree.poses[0].link)))
    corners = [column(posed.pose(1 + i)[1]) for i in range(len(tree.joints))]

    def aside(i: int) -> list[ca.SX]:
        beyond = [[*aside(k), corners[i]] for k in tree.children(i)] or [[bodies[i].centre, corners[i]]]
        return [corners[i], *(corner for part in beyond for corner in part)]

    line = [base]
    for i, at in zip([-1, *way], [base, *(corners[k] for k in way)], strict=True):
        line += [at] if i >= 0 else []
        for k in tree.children(i):
            line += [*aside(k), at] if k not in way else []
    return ca.densify(ca.horzcat(*line, column(tool)))
