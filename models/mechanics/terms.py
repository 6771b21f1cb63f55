"""Terms: the contributions of an effect to the equations of a machine. They are summed; nothing overrides."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import casadi as ca

from ocp import checks
from ocp.system import Side

if TYPE_CHECKING:
    from models.machines.manipulator import Body, Manipulator
    from models.machines.recursion import Load

Single = TypeVar("Single")
OF_MOTION = ("acceleration", "jerk")  # first and second rate of v, known only when the equations are
Rate = Callable[[ca.SX], ca.SX]  # time derivative along a motion


@dataclass(frozen=True, eq=False)
class Quantity:
    """A named scalar or column that an effect publishes, with its unit."""

    expression: ca.SX
    unit: str | tuple[str, ...]  # one for all components, or one for each
    components: tuple[str, ...] = ()  # their names, for a column

    def labelled(self, name: str) -> tuple[tuple[str, str], ...]:
        """Return name and unit of every component."""
        size = self.expression.numel()
        units = (self.unit,) * size if isinstance(self.unit, str) else self.unit
        names = self.components or ((name,) * size if size == 1 else tuple(f"{name}_{i + 1}" for i in range(size)))
        return tuple(zip(names, units, strict=True))


@dataclass(frozen=True, eq=False)
class State:
    """A state of an effect: its symbol z, its rate dz/dt, its unit, and its value at t = 0 if it has one of its own."""

    symbol: ca.SX
    rate: ca.SX
    unit: str
    initial: float | None = None


@dataclass(frozen=True, eq=False)
class Read:
    """A signal that an effect reads; the effect that defines it may come earlier or later in the list.

    Signals are those of other effects, and q, v, tau (on the joints), tool, tool_v, motor_q, motor_v, motor_tau (in
    units of the joints) and time, which every machine has; signals may read acceleration and jerk, too.
    """

    name: str
    symbol: ca.SX  # placeholder for it in the terms of the effect
    reader: str  # name of the effect, for the message
    cure: str  # effect that defines it, for the message


@dataclass(frozen=True, eq=False)
class Source:
    """Map from control to motor torque (a drive with a lag, a motor with a voltage); without one they are equal."""

    control: Quantity  # (n,) symbols
    torque: ca.SX  # (n,) of the motors, in units of the joints
    # (motor torque, motor velocity, d/dt) -> the control and other signals that produce this torque
    invert: Callable[[ca.SX, ca.SX, Rate], Mapping[str, Quantity]]


@dataclass(frozen=True, eq=False)
class Transmission:
    """Elastic connection of motors and joints; without one the motors turn with the joints."""

    motor_tau: ca.SX  # (n,) symbols of the torque of the motors
    motor_q: ca.SX  # (n,) position of the motors, in units of the joints
    motor_v: ca.SX  # (n,)
    torque: ca.SX  # (n,) on the joints
    invert: Callable[[ca.SX, Rate], tuple[ca.SX, ca.SX, ca.SX]]  # (torque, d/dt) -> motor_q, motor_v, motor_tau


@dataclass(frozen=True, eq=False)
class Terms:
    """Contributions, written in the symbols q, v and tau of the machine; tau is the force on the joints."""

    metric: ca.SX | None = None  # (n, n) added to g(q)
    potential: ca.SX = field(default_factory=lambda: ca.SX(0))  # U(q) [J]
    acceleration: ca.SX | None = None  # (3,) of a homogeneous field that acts on every mass [m/s^2]
    bodies: tuple[Body, ...] = ()  # attached by the effect; their inertia is part of `metric`
    # Rigid bodies fixed to links; on a machine of links not in `metric`, on others in `metric` and `bodies` as well,
    # and nothing else is.
    loads: tuple[Load, ...] = ()
    # (n,) N J of rotors, parallel to the axes of their joints, that turn with the link before: they add N J (axis .
    # omega) v to the kinetic energy; on a machine of links not in `metric` [kg m^2 or kg m].
    spins: ca.SX | None = None
    force: ca.SX | None = None  # (n,) generalised force beside the drives, along +q [N m or N]
    states: Mapping[str, State] = field(default_factory=dict)
    signals: Mapping[str, Quantity] = field(default_factory=dict)
    symbols: Mapping[str, ca.SX] = field(default_factory=dict)  # parameters that stay symbols
    nominal: Mapping[str, float] = field(default_factory=dict)  # their values
    limits: Mapping[str, tuple[Side, Side]] = field(default_factory=dict)  # signal -> lower, upper along every motion
    reads: tuple[Read, ...] = ()
    source: Source | None = None
    transmission: Transmission | None = None
    energy: ca.SX = field(default_factory=lambda: ca.SX(0))  # stored in states of the effect [J]
    # Potential of a part of `force` [J], for forces with a shorter graph than the gradient of their potential.
    spring: ca.SX = field(default_factory=lambda: ca.SX(0))
    dissipation: ca.SX = field(default_factory=lambda: ca.SX(0))  # power lost beside -force . v [W]
    defines: Mapping[str, str] = field(default_factory=dict)  # role that only one effect may have -> name of the effect

    def __add__(self, other: Terms) -> Terms:
        for thing, name in other.defines.items():
            if thing in self.defines:
                both = f"{self.defines[thing]} and {name}" if self.defines[thing] != name else f"{name}, twice"
                raise ValueError(f"two effects define the {thing}: {both}; keep one of them")
        return Terms(
            metric=_sum(self.metric, other.metric),
            potential=self.potential + other.potential,
            acceleration=_sum(self.acceleration, other.acceleration),
            bodies=self.bodies + other.bodies,
            loads=self.loads + other.loads,
            spins=_sum(self.spins, other.spins),
            force=_sum(self.force, other.force),
            states=_union("state", self.states, other.states),
            signals=_union("signal", self.signals, other.signals),
            symbols=_union("parameter", self.symbols, other.symbols),
            nominal={**self.nominal, **other.nominal},
            limits=_union("limit", self.limits, other.limits),
            reads=self.reads + other.reads,
            source=_one("drive", self.source, other.source),
            transmission=_one("transmission", self.transmission, other.transmission),
            energy=self.energy + other.energy,
            spring=self.spring + other.spring,
            dissipation=self.dissipation + other.dissipation,
            defines={**self.defines, **other.defines},
        )


# Called with the machine and the sum of the terms of the effects before it; returns its own terms. A signal of another
# effect is better obtained by a `Read`, which does not depend on the order of the list.
Effect = Callable[["Manipulator", Terms], Terms]


@dataclass(frozen=True, eq=False)
class Part:
    """An effect of a list: its name and its terms."""

    name: str
    terms: Terms


def gather(machine: Manipulator, effects: Sequence[Effect]) -> tuple[Part, ...]:
    """Call every effect with the terms of those before it and return their parts.

    A clock, the state `time`, is added if an effect reads the time.

    Raises:
        TypeError: an item of the list is not an effect.
        ValueError: two effects define the same state, signal, parameter, drive, ...
    """
    checks.instance("effects", effects, list | tuple, "a list of effects such as [Gravity()]")
    total, parts = Terms(), list[Part]()
    for effect in effects:
        if isinstance(effect, type) or not callable(effect):
            raise TypeError(f"effects: got {checks.shown(effect)}, expected an effect such as Gravity()")
        terms = effect(machine, total)
        checks.instance(f"effects: {name_of(effect)} returned a value that", terms, Terms, "its Terms")
        total = total + terms
        same = sum(part.name.rstrip("_0123456789") == name_of(effect) for part in parts)
        parts.append(Part(f"{name_of(effect)}_{same + 1}" if same else name_of(effect), terms))
    if "time" not in total.states and any(read.name == "time" for read in total.reads):
        parts.append(Part("clock", Terms(states={"time": State(ca.SX.sym("time"), ca.SX(1), "s", 0.0)})))
    return tuple(parts)


def name_of(effect: Effect) -> str:
    """Return the name of an effect: its class name in snake_case, such as rotor_inertia."""
    name = getattr(effect, "__name__", type(effect).__name__)
    return snake(name) if name.isidentifier() else "effect"


def snake(name: str) -> str:
    """Return CamelCase as camel_case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def _sum(one: ca.SX | None, other: ca.SX | None) -> ca.SX | None:
    if one is None or other is None:
        return other if one is None else one
    return one + other


def _one(kind: str, one: Single | None, other: Single | None) -> Single | None:
    if one is not None and other is not None:
        raise ValueError(f"two effects define the {kind}; keep one of them")
    return one if other is None else other


def _union(kind: str, one: Mapping[str, Single], other: Mapping[str, Single]) -> dict[str, Single]:
    for name in other:
        if name in one:
            raise ValueError(f"two effects define the {kind} {name!r}; keep one of them")
    return {**one, **other}
