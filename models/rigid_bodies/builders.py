"""Arms of any shape from joints: serial arms, trees, tables of Denavit and Hartenberg."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter, Value
from models.rigid_bodies.assembly import assemble_tree
from models.rigid_bodies.joint import Joint, Kind, Link, nominal, rotation_of
from models.rigid_bodies.tree_manipulator import manipulator
from ocp import checks
from ocp.checks import Array


def serial(
    joints: Sequence[Joint],
    *,
    tool: Sequence[float] = (0.0, 0.0, 0.0),
    tool_rotation: Sequence[float] | Sequence[Sequence[float]] | Array | None = None,
    name: str = "serial",
) -> Manipulator:
    """Return an arm whose joints follow one another, the first one on the base.

    Args:
        joints: from the base to the tool; their `parent` is filled in.
        tool: (3,) tool point in the frame of the last joint [m].
        tool_rotation: axes of the tool in that frame: roll, pitch, yaw [rad], or a matrix (3, 3).
        name: of the machine.

    Raises:
        ValueError: no joint that moves, a name twice, an inertia that no body has.
    """
    given = checks.several("joints", joints, "a list of Joints")
    chained: list[Joint] = []
    for joint in given:
        checks.instance("joints, each", joint, Joint, "a Joint")
        parent = chained[-1].name if chained else ""
        if joint.parent not in ("", parent):
            raise ValueError(
                f"joint {joint.name!r}: its parent is {joint.parent!r}, but it follows {parent!r}; use tree(joints)"
            )
        chained.append(replace(joint, parent=parent))
    return tree(chained, tool=tool, tool_rotation=tool_rotation, name=name)


def tree(
    joints: Sequence[Joint],
    *,
    tip: str | None = None,
    tool: Sequence[float] = (0.0, 0.0, 0.0),
    tool_rotation: Sequence[float] | Sequence[Sequence[float]] | Array | None = None,
    name: str = "tree",
) -> Manipulator:
    """Return a machine whose joints form a tree.

    Args:
        joints: in any order, each with the name of its parent; coordinates are in this order, parents first.
        tip: name of the joint whose link carries the tool; None is the last one.
        tool: (3,) tool point in the frame of that joint [m].
        tool_rotation: axes of the tool in that frame: roll, pitch, yaw [rad], or a matrix (3, 3).
        name: of the machine.

    Raises:
        ValueError: an unknown parent, a loop, no joint that moves, a name twice, an inertia that no body has.
    """
    checks.text("name", name, "a name")
    if tip is not None:
        checks.text("tip", tip, "the name of a joint, or None")
    turned = None if tool_rotation is None else rotation_of("tool_rotation", tool_rotation)
    return manipulator(name, assemble_tree(joints, tip, tool, turned))


@dataclass(frozen=True)
class DhRow:
    """One row of a table of Denavit and Hartenberg with the link of its joint.

    Standard: Rz(theta) Tz(d) Tx(a) Rx(alpha) from frame i - 1 to frame i; the joint turns about (moves along) z of
    frame i - 1, and the link is given in frame i. Modified (Craig): Rx(alpha) Tx(a) Rz(theta) Tz(d), the joint acts on
    z of frame i.

    Args:
        theta: angle, offset of a revolute joint [rad].
        d: distance along z, offset of a prismatic joint [m].
        a: length along x [m].
        alpha: twist about x [rad].
        kind: Kind.REVOLUTE or Kind.PRISMATIC.
        link: in frame i.
        joint: a Joint with name, limits and rotor; its geometry and link are those of the row. None: q1, q2, ...
    """

    theta: float = 0.0
    d: Value = 0.0
    a: Value = 0.0
    alpha: float = 0.0
    kind: Kind = Kind.REVOLUTE
    link: Link = field(default_factory=Link)
    joint: Joint | None = None

    def __post_init__(self) -> None:
        for name in ("theta", "alpha"):
            if isinstance(getattr(self, name), Parameter):
                raise checks.refused(
                    f"dh row: {name}", getattr(self, name), "a number in rad; angles cannot be Parameters"
                )
            checks.number(f"dh row: {name}", getattr(self, name), "a number in rad")
        for name in ("d", "a"):
            nominal(f"dh row: {name}", getattr(self, name), "m")
        checks.instance("dh row: kind", self.kind, Kind, "Kind.REVOLUTE or Kind.PRISMATIC")
        checks.instance("dh row: link", self.link, Link, "a Link")
        checks.instance("dh row: joint", self.joint, Joint | None, "a Joint, or None")
        if self.kind is Kind.FIXED:
            raise checks.refused("dh row: kind", self.kind, "Kind.REVOLUTE or Kind.PRISMATIC")


def dh(
    table: Sequence[DhRow | Sequence[float]],
    modified: bool = False,
    *,
    tool: Sequence[float] = (0.0, 0.0, 0.0),
    tool_rotation: Sequence[float] | Sequence[Sequence[float]] | Array | None = None,
    name: str = "dh",
) -> Manipulator:
    """Return a serial arm of a table of Denavit and Hartenberg.

    Args:
        table: rows as DhRow, or as (theta, d, a, alpha) of a revolute joint whose link has no mass.
        modified: whether the table follows Craig's convention (a and alpha of the link before).
        tool: (3,) tool point in the last frame [m].
        tool_rotation: axes of the tool in the last frame.
        name: of the machine.

    Raises:
        ValueError: a row that is none, and as `serial`.

    Source: J. Denavit, R. S. Hartenberg, ASME J. Applied Mechanics 22 (1955); J. J. Craig, Introduction to Robotics,
        1986.
    """
    checks.truth("modified", modified)
    joints: list[Joint] = []
    rows = checks.several("table", table, "a list of DhRows")
    if not rows:
        raise checks.refused("table", table, "at least one DhRow")
    for i, given in enumerate(rows):
        row = given if isinstance(given, DhRow) else _four(i, given)
        base = row.joint or Joint(f"q{i + 1}")
        joints += _modified(row, base) if modified else _standard(row, base)
    return serial(joints, tool=tool, tool_rotation=tool_rotation, name=name)


def _four(i: int, given: object) -> DhRow:
    values = checks.numbers(f"table, row {i + 1}", given, "(theta, d, a, alpha) or a DhRow")
    if values.shape != (4,):
        raise checks.refused(f"table, row {i + 1}", given, "(theta, d, a, alpha) or a DhRow")
    theta, d, a, alpha = (float(x) for x in values)
    return DhRow(theta, d, a, alpha)


def _modified(row: DhRow, base: Joint) -> list[Joint]:
    """Return a fixed step Tx(a) Rx(alpha) and a joint at Tz(d) Rz(theta) beyond it."""
    tilt = Joint(f"{base.name} frame", Kind.FIXED, origin=(row.a, 0.0, 0.0), rotation=(row.alpha, 0.0, 0.0))
    placed = replace(
        base, kind=row.kind, parent="", origin=(0.0, 0.0, row.d), rotation=(0.0, 0.0, row.theta),
        axis=(0.0, 0.0, 1.0), link=row.link,
    )  # fmt: skip
    return [tilt, placed]


def _standard(row: DhRow, base: Joint) -> list[Joint]:
    """Return a joint about z of the frame before, and the fixed step to frame i that carries the link."""
    turning = replace(
        base, kind=row.kind, parent="", origin=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, row.theta),
        axis=(0.0, 0.0, 1.0), link=Link(),
    )  # fmt: skip
    step = Joint(
        f"{base.name} link", Kind.FIXED, origin=(row.a, 0.0, row.d), rotation=(row.alpha, 0.0, 0.0), link=row.link
    )
    return [turning, step]
