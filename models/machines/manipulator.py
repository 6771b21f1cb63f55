"""A manipulator as data: coordinates, metric, bodies, tool, drives, frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi as ca

from models.machines.frames import Frame
from models.machines.inverse_kinematics import Inverse
from models.machines.recursion import Recursion
from models.machines.shapes import Shape
from ocp import checks

Ends = tuple[float, ...]  # one for each joint, infinite where nothing is known


@dataclass(frozen=True)
class Coordinate:
    """One generalised coordinate."""

    name: str
    unit: str  # "rad" or "m"

    @property
    def force_unit(self) -> str:
        """Unit of the generalised force along this coordinate."""
        return "N m" if self.unit == "rad" else "N"


@dataclass(frozen=True)
class Drive:
    """A drive with its name in Maisser's paper: its moment or force is `sign` times tau along the coordinate."""

    name: str
    sign: int


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body; its placement depends on the coordinates q of the manipulator."""

    name: str
    mass: ca.SX | float  # [kg]; 0 for a body that only turns, whose mass has no effect
    centre: ca.SX  # (3,) mass centre in the inertial frame, e_3 upwards [m]
    orientation: ca.SX  # (3, 3) rotation matrix, columns = body axes
    inertia: ca.SX  # (3, 3) tensor about the mass centre, body axes [kg m^2]


@dataclass(frozen=True, eq=False)
class Manipulator:
    """A manipulator with kinetic energy T = 1/2 v' g(q) v: metric g in closed form, bodies, tool, drives, frames."""

    name: str
    coordinates: tuple[Coordinate, ...]
    q: ca.SX  # (n,) symbols of the coordinates [rad or m]
    v: ca.SX  # (n,) symbols of dq/dt
    tau: ca.SX  # (n,) symbols of the generalised drive forces along +q [N m or N]
    metric: ca.SX  # (n, n) g(q) [kg m^2, kg m, kg]
    bodies: tuple[Body, ...]
    tool: ca.SX  # (3,) position of the tool point [m]
    tool_metric: ca.SX  # (n, n) metric of a unit point mass at the tool, in closed form
    skeleton: ca.SX  # (3, k) corners of the arm as a line in space, from the base to the tool [m]
    drives: tuple[Drive, ...]  # in coordinate order
    frames: Mapping[str, Callable[[ca.SX], Frame]]  # name -> maker, called with the metric that effects add
    nominal: Mapping[str, float]  # every parameter, SI
    symbols: Mapping[str, ca.SX]  # the parameters that stay symbols
    inertia: Mapping[str, str] = field(default_factory=dict)  # coordinate -> parameters that give it inertia everywhere
    inverse: Inverse | None = None  # inverse kinematics of the tool point in closed form, for the nominal parameters
    default_frame: str = "regular"  # name of the frame that exists wherever the metric is regular
    tool_axes: ca.SX | None = None  # (3, 3) columns = axes of the tool; None: those of the last body
    recursion: Recursion | None = None  # shorter than the metric for machines of many links
    limits: Mapping[str, tuple[Ends, Ends]] = field(default_factory=dict)  # of a data sheet or a robot file: "q", ...
    damping: tuple[float, ...] = ()  # viscous friction that the file states [N m s/rad or N s/m]
    friction: tuple[float, ...] = ()  # dry friction that it states [N m or N]
    shapes: tuple[Shape, ...] = ()  # capsules for collisions
    notes: tuple[str, ...] = ()  # sentences about how the machine was read
    rotors: tuple[ca.SX | float, ...] = ()  # (n,) N^2 J of rotors that are part of the metric [kg m^2 or kg]
    spins: tuple[ca.SX | float, ...] = ()  # (n,) N J of those that turn with the link before, part of it too

    def __repr__(self) -> str:
        coordinates = ", ".join(f"{c.name} [{c.unit}]" for c in self.coordinates)
        return f"Manipulator {self.name}: q = ({coordinates}), frames {', '.join(self.frames)}"

    @property
    def tool_orientation(self) -> ca.SX:
        """(3, 3) rotation matrix, columns = axes of the tool."""
        return self.bodies[-1].orientation if self.tool_axes is None else self.tool_axes

    def frame(self, name: str, added: ca.SX | None = None) -> Frame:
        """Return the frame called `name`, with the metric `added` by effects pulled back to it.

        Args:
            name: one of `frames`.
            added: (n, n) metric in coordinates, or None.

        Raises:
            ValueError: no such frame, or the frame is singular for these parameters.
        """
        if not isinstance(name, str) or name not in self.frames:
            given = checks.shown(name)
            raise ValueError(f"{self.name} has no frame {given}; it has {', '.join(self.frames)}")
        n = len(self.coordinates)
        if added is not None:
            checks.expression("added", added, f"a metric ({n}, {n}) as an expression, or None")
            if added.shape != (n, n):
                raise ValueError(f"added: has shape {added.shape}, expected ({n}, {n})")
        return self.frames[name](ca.SX(n, n) if added is None else added)


def symbols(letter: str, coordinates: tuple[Coordinate, ...]) -> ca.SX:
    """Return one symbol for each coordinate as a column; `q` symbols bear the names of the coordinates."""
    prefix = "" if letter == "q" else f"{letter}_"
    return ca.vertcat(*(ca.SX.sym(prefix + coordinate.name) for coordinate in coordinates))


def rotation(axis: int, angle: ca.SX) -> ca.SX:
    """Return the elementary right-handed rotation (3, 3) about axis 0, 1 or 2 by an angle [rad]."""
    c, s = ca.cos(angle), ca.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = ca.SX.eye(3)
    matrix[i, i], matrix[j, j], matrix[i, j], matrix[j, i] = c, c, -s, s
    return matrix
