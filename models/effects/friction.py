"""Friction in the joints."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.effects.effect_fields import Each, present, quantity, read_fields
from models.machines.manipulator import Manipulator
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Terms

FORCE, SPEED = "N m or N", "rad/s or m/s"


@dataclass(frozen=True)
class Viscous:
    """Friction proportional to the speed of each joint, Q = -c v.

    Adds a force, and c v^2 to the signal "loss"; no states, no controls, the parameters `viscous.c` or `viscous.c_1`
    ... if they are Parameters.

    Args:
        c: coefficient >= 0, one for all joints or one for each (None: none) [N m s/rad or N s/m].

    Raises:
        ValueError: a coefficient is no finite number >= 0.

    Source: B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation
        methods for the control of machines with friction, Automatica 30 (1994).
    """

    c: Each = quantity("N m s/rad or N s/m", at_least=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> Viscous:
        """Return friction that takes 5 % of the peak torque at the peak speed."""
        return cls(tuple(0.05 * f / w for f, w in zip(sizes.torque, sizes.speed, strict=True)))

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the forces."""
        fields = read_fields(self)
        force = [-c * v if c is not None else 0.0 for c, v in _with_speeds(machine, fields.each("c", machine))]
        return Terms(
            force=ca.vertcat(*map(ca.SX, force)),
            symbols=fields.symbols,
            nominal=fields.nominal,
            defines={"viscous friction": fields.prefix},
        )


@dataclass(frozen=True)
class Coulomb:
    """Dry friction of constant absolute value against the motion of each joint, smoothed, Q = -f tanh(v / width).

    The force is within 1 % of f from |v| = 2.65 width on, |Q| / f = 1 - 2 exp(-2 |v| / width); below, the joint
    creeps instead of sticking: under a force F < f it drifts with v = width artanh(F / f). A stop from the speed v0
    takes m v0^2 / (2 f) + (pi^2 / 12) m width^2 / f, an error of second order in the width.

    Adds a force, and f v tanh(v / width) to the signal "loss"; no states, no controls, the parameters `coulomb.f`,
    `coulomb.width` (`coulomb.f_1` ...) if they are Parameters.

    Args:
        f: size of the force >= 0, one for all joints or one for each (None: none) [N m or N].
        width: speed of smoothing > 0, one for all joints or one for each [rad/s or m/s].

    Raises:
        ValueError: a value is no finite number in its range.

    Source: S. Andersson, A. Soederberg, S. Bjoerklund, Friction models for sliding dry, boundary and mixed lubricated
        contacts, Tribology International 40 (2007) (the smoothing by tanh).
    """

    f: Each = quantity(FORCE, at_least=0.0)
    width: Each = quantity(SPEED, 0.02, above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> Coulomb:
        """Return friction of 5 % of the peak torque."""
        return cls(tuple(0.05 * f for f in sizes.torque))

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the forces."""
        fields = read_fields(self)
        widths = fields.each("width", machine)
        force = [
            -f * ca.tanh(v / present(fields, "width", i, widths[i])) if f is not None else 0.0
            for i, (f, v) in enumerate(_with_speeds(machine, fields.each("f", machine)))
        ]
        return Terms(
            force=ca.vertcat(*map(ca.SX, force)),
            symbols=fields.symbols,
            nominal=fields.nominal,
            defines={"dry friction": fields.prefix},
        )


@dataclass(frozen=True)
class Stribeck:
    """Dry friction that falls from breakaway to sliding, Q = -(f + (f_static - f) exp(-(v / speed)^2)) tanh(v / width).

    The smoothing is that of `Coulomb`; it keeps the breakaway force from being reached unless width is well below
    speed: at width = speed / 10 the largest force is 0.97 f_static for f_static = 1.5 f.

    Adds a force, and -Q v to the signal "loss"; no states, no controls, the parameters `stribeck.f`,
    `stribeck.f_static`, `stribeck.speed`, `stribeck.width` if they are Parameters. Viscous friction is another effect.

    Args:
        f: force at higher speeds >= 0, one for all joints or one for each (None: no friction) [N m or N].
        f_static: breakaway force >= 0 [N m or N].
        speed: Stribeck velocity > 0 [rad/s or m/s].
        width: speed of smoothing > 0 [rad/s or m/s].

    Raises:
        ValueError: a value is no finite number in its range.

    Source: L. C. Bo, D. Pavelescu, The friction-speed relation and its influence on the critical velocity of
        stick-slip motion, Wear 82 (1982); survey of Armstrong-Helouvry et al., Automatica 30 (1994).
    """

    f: Each = quantity(FORCE, at_least=0.0)
    f_static: Each = quantity(FORCE, at_least=0.0)
    speed: Each = quantity(SPEED, 0.1, above=0.0)
    width: Each = quantity(SPEED, 0.01, above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> Stribeck:
        """Return friction of 5 % of the peak torque, with a breakaway force of 7.5 %."""
        return cls(tuple(0.05 * f for f in sizes.torque), tuple(0.075 * f for f in sizes.torque))

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the forces."""
        fields = read_fields(self)
        columns = (fields.each(name, machine) for name in ("f", "f_static", "speed", "width"))
        force = []
        for i, ((f, static, speed, width), v) in enumerate(
            zip(zip(*columns, strict=True), ca.vertsplit(machine.v), strict=True)
        ):
            if f is None or static is None:
                force.append(0.0)
            else:
                speed, width = present(fields, "speed", i, speed), present(fields, "width", i, width)
                force.append(-(f + (static - f) * ca.exp(-((v / speed) ** 2))) * ca.tanh(v / width))
        return Terms(
            force=ca.vertcat(*map(ca.SX, force)),
            symbols=fields.symbols,
            nominal=fields.nominal,
            defines={"dry friction": fields.prefix},
        )


def _with_speeds(machine: Manipulator, values: tuple) -> list[tuple]:  # type: ignore[type-arg]
    return list(zip(values, ca.vertsplit(machine.v), strict=True))
