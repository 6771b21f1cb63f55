"""Joints and links as the user gives them: frozen values with checks; any number may be a Parameter."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.machines.parameters import Parameter, Value, number
from ocp import checks
from ocp.checks import Array

Three = Sequence[Value]


class Kind(enum.Enum):
    """How a joint moves its link."""

    REVOLUTE = "revolute"  # turns about the axis [rad]
    PRISMATIC = "prismatic"  # moves along the axis [m]
    FIXED = "fixed"  # not at all; the link becomes part of the one before


@dataclass(frozen=True)
class Capsule:
    """A straight line between two points of a link with a radius around it; a sphere if they are equal."""

    start: Sequence[float]  # (3,) in the frame of the link [m]
    end: Sequence[float]  # (3,)
    radius: float  # > 0 [m]

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            checks.column(f"capsule.{name}", getattr(self, name), 3, "three numbers in m")
        if checks.number("capsule.radius", self.radius, "one finite number in m") <= 0.0:
            raise checks.refused("capsule.radius", self.radius, "a radius > 0 in m")


@dataclass(frozen=True)
class Link:
    """A rigid body that a joint moves.

    Args:
        mass: m >= 0 [kg].
        centre: (3,) mass centre in the frame of the joint [m].
        inertia: tensor about the mass centre, axes of the frame of the joint: three principal moments (11, 22, 33) or
            six components (11, 22, 33, 12, 13, 23), products as tensor components (minus the integrals) [kg m^2].
        capsules: shapes for collisions.

    Raises:
        ValueError: a value is no finite number, or mass < 0.
    """

    mass: Value = 0.0
    centre: Three = (0.0, 0.0, 0.0)
    inertia: Three = (0.0, 0.0, 0.0)
    capsules: tuple[Capsule, ...] = ()

    def __post_init__(self) -> None:
        if nominal("link.mass", self.mass, "kg") < 0.0:
            raise checks.refused("link.mass", self.mass, "a mass >= 0 in kg")
        values_of("link.centre", self.centre, (3,), "m")
        values_of("link.inertia", self.inertia, (3, 6), "kg m^2")
        for capsule in checks.several("link.capsules", self.capsules, "a tuple of Capsules"):
            checks.instance("link.capsules, each", capsule, Capsule, "a Capsule")

    @property
    def empty(self) -> bool:
        """Whether the link has neither mass nor inertia, not even as a Parameter."""
        return not any(isinstance(x, Parameter) or x for x in (self.mass, *self.inertia))


@dataclass(frozen=True)
class Joint:
    """A joint with the link that it moves.

    The frame of the joint lies at `origin` in the frame of the parent joint, turned by `rotation`; at q = 0 the frame
    of the link coincides with it. The link turns about `axis`, or moves along it, by q.

    Args:
        name: of the joint and its coordinate.
        kind: Kind.REVOLUTE, Kind.PRISMATIC or Kind.FIXED.
        parent: name of the joint whose link carries this one; "" is the base. `serial` fills it in.
        origin: (3,) in the frame of the parent [m].
        rotation: (3,) roll, pitch and yaw, R = Rz(yaw) Ry(pitch) Rx(roll) [rad], or a rotation matrix (3, 3).
        axis: (3,) in the frame of the joint; its length does not matter.
        link: the body that the joint moves.
        lower, upper: ends of the coordinate; None for no limit [rad or m].
        speed: largest |dq/dt| > 0; None where it is not known [rad/s or m/s].
        effort: largest drive force > 0; None where it is not known [N m or N].
        rotor: inertia of the rotor of the drive about its own axis >= 0 [kg m^2].
        gear: rotor speed over joint speed; its reflected inertia is gear^2 rotor [rad/rad or rad/m].
        carried: whether the rotor, parallel to the axis, turns with the link before as well; this adds the coupling
            gear rotor (axis . omega) dq/dt to the kinetic energy. Its own rotor (axis . omega)^2 / 2 is part of that
            link.
        damping: coefficient of viscous friction >= 0 [N m s/rad or N s/m].
        friction: dry friction >= 0 [N m or N].

    Raises:
        ValueError: a value is no finite number in its range, a zero axis, lower > upper; the message names the joint.
    """

    name: str
    kind: Kind = Kind.REVOLUTE
    parent: str = ""
    origin: Three = (0.0, 0.0, 0.0)
    rotation: Sequence[float] | Sequence[Sequence[float]] | Array = (0.0, 0.0, 0.0)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    link: Link = field(default_factory=Link)
    lower: float | None = None
    upper: float | None = None
    speed: float | None = None
    effort: float | None = None
    rotor: Value = 0.0
    gear: Value = 1.0
    carried: bool = False
    damping: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        checks.text("joint.name", self.name, "a name")
        if not self.name:
            raise checks.refused("joint.name", self.name, "a name that is not empty")
        said, unit = f"joint {self.name!r}", "rad" if self.kind is Kind.REVOLUTE else "m"
        checks.instance(f"{said}: kind", self.kind, Kind, "Kind.REVOLUTE, Kind.PRISMATIC or Kind.FIXED")
        checks.instance(f"{said}: parent", self.parent, str, "the name of a joint, or '' for the base")
        checks.instance(f"{said}: link", self.link, Link, "a Link")
        checks.truth(f"{said}: carried", self.carried)
        values_of(f"{said}: origin", self.origin, (3,), "m")
        axis = checks.column(f"{said}: axis", self.axis, 3, "three numbers")
        if not np.linalg.norm(axis) > 1e-9:
            raise checks.refused(f"{said}: axis", self.axis, "a vector other than zero")
        self.turned()
        for name in ("speed", "effort"):
            value = getattr(self, name)
            if value is not None and checks.number(f"{said}: {name}", value, "one finite number or None") <= 0.0:
                raise checks.refused(f"{said}: {name}", value, "a number > 0, or None where it is not known")
        for name in ("damping", "friction"):
            if checks.number(f"{said}: {name}", getattr(self, name), "one finite number") < 0.0:
                raise checks.refused(f"{said}: {name}", getattr(self, name), "a number >= 0")
        if nominal(f"{said}: rotor", self.rotor, "kg m^2") < 0.0:
            raise checks.refused(f"{said}: rotor", self.rotor, "an inertia >= 0 in kg m^2")
        nominal(f"{said}: gear", self.gear, "1")
        ends = [checks.number(f"{said}: limits", end, f"a number in {unit}, or None")
                for end in (self.lower, self.upper) if end is not None]  # fmt: skip
        if len(ends) == 2 and ends[0] > ends[1]:
            raise ValueError(f"{said}: lower {ends[0]:g} is above upper {ends[1]:g} [{unit}]; exchange them")

    def turned(self) -> Array:
        """Return the rotation matrix (3, 3) from the frame of the joint to that of its parent."""
        return rotation_of(f"joint {self.name!r}: rotation", self.rotation)

    def symbols(self) -> Mapping[str, Parameter]:
        """Return the values of the joint that are Parameters, by the names that their symbols get."""
        named: dict[str, Value] = {"mass": self.link.mass, "rotor": self.rotor, "gear": self.gear}
        for name, values in (("origin", self.origin), ("centre", self.link.centre), ("inertia", self.link.inertia)):
            named |= {f"{name}_{i + 1}": value for i, value in enumerate(values)}
        return {f"{self.name}.{name}": value for name, value in named.items() if isinstance(value, Parameter)}


def rotation_of(name: str, rotation: object) -> Array:
    """Return the matrix (3, 3) of roll, pitch, yaw [rad] or of a matrix.

    Args:
        name: of the argument, for the message.
        rotation: what the user gave.

    Raises:
        ValueError: it is neither.
    """
    wanted = "roll, pitch, yaw in rad, or a rotation matrix"
    given = checks.numbers(name, rotation, wanted)
    if given.shape == (3,):
        return roll_pitch_yaw(given)
    if given.shape != (3, 3):
        raise checks.refused(name, rotation, wanted)
    if np.max(np.abs(given.T @ given - np.eye(3))) > 1e-6 or np.linalg.det(given) < 0.0:
        raise checks.refused(name, rotation, "a right-handed orthonormal matrix")
    # The nearest rotation, so that rounded entries do not stretch the links.
    left, _, right = np.linalg.svd(given)
    return given if np.max(np.abs(given.T @ given - np.eye(3))) < 1e-15 else np.asarray(left @ right)


def roll_pitch_yaw(angles: Sequence[float] | Array) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll), exact for multiples of pi/2."""
    (cr, sr), (cp, sp), (cy, sy) = (cosine_sine(float(angle)) for angle in angles)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(yaw @ pitch @ roll)


def cosine_sine(angle: float) -> tuple[float, float]:
    """Return cos and sin of an angle [rad]; exact for multiples of pi/2."""
    quarters = angle / (np.pi / 2)
    if abs(quarters - round(quarters)) < 4.0 * np.finfo(float).eps * max(1.0, abs(quarters)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    return float(np.cos(angle)), float(np.sin(angle))


def nominal(name: str, value: Value, unit: str) -> float:
    """Return the number of a value that may be a Parameter, or raise ValueError with its name."""
    return number(name, value.value if isinstance(value, Parameter) else value, unit)


def values_of(name: str, values: object, sizes: tuple[int, ...], unit: str) -> list[float]:
    """Return the numbers of a sequence whose items may be Parameters, or raise ValueError with its name."""
    wanted = f"{' or '.join(map(str, sizes))} numbers in {unit}"
    if not isinstance(values, list | tuple | np.ndarray) or len(values) not in sizes:
        raise checks.refused(name, values, wanted)
    return [nominal(f"{name}_{i + 1}", value, unit) for i, value in enumerate(values)]


def about_axis(axis: Array, angle: float) -> Array:
    """Return the rotation about an axis by an angle [rad]."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
