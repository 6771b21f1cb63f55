"""Stops at the ends of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.effects.effect_fields import Each, Some, present, quantity, read_fields
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Terms


@dataclass(frozen=True)
class JointStop:
    """Smooth one-sided springs with dampers at the ends of a joint, Q = -k s(e) (1 + d de/dt) beyond the upper one.

    e = q - upper (lower - q at the other end) is the distance beyond the end, s(e) = (e + sqrt(e^2 + width^2)) / 2 a
    smooth max(e, 0): too large by width / 2 at the end and by width^2 / (4 |e|) away from it, on both sides. The spring
    has a potential; the damper grows with e, so that the force starts from zero and is hardly ever attractive.

    Adds a force, the energy of the springs, and k s d v^2 to the signal "loss"; no states, no controls, the parameters
    `joint_stop.lower_1`, ..., `joint_stop.stiffness`, ... if they are Parameters.

    Args:
        lower, upper: ends of the joints, one for each (None: no stop) [rad or m].
        stiffness: k > 0, one for all joints or one for each [N m/rad or N/m].
        damping: d >= 0, one for all joints or one for each [s/rad or s/m].
        width: distance of smoothing > 0, one for all joints or one for each [rad or m].

    Raises:
        ValueError: a value is no finite number in its range.

    Source: K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, ASME J.
        Appl. Mech. 42 (1975), with the exponent one.
    """

    lower: Some | None = quantity("rad or m", None)
    upper: Some | None = quantity("rad or m", None)
    stiffness: Each = quantity("N m/rad or N/m", 1e5, above=0.0)
    damping: Each = quantity("s/rad or s/m", 0.5, at_least=0.0)
    width: Each = quantity("rad or m", 1e-3, above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the forces, and the energy of the springs."""
        fields, n = read_fields(self), machine.q.numel()
        stiffness, damping, width = (fields.each(name, machine) for name in ("stiffness", "damping", "width"))
        columns = {"stiffness": stiffness, "damping": damping, "width": width}
        spring, force = ca.SX(0), ca.SX(n, 1)
        for name, sign in (("lower", -1.0), ("upper", 1.0)):
            for i, stop in enumerate(fields.each(name, machine)):
                if stop is None:
                    continue
                for other, column in columns.items():
                    present(fields, other, i, column[i])
                beyond = sign * (machine.q[i] - stop)
                root = ca.sqrt(beyond**2 + width[i] ** 2)
                force[i] -= stiffness[i] * (beyond + root) / 2 * (sign + damping[i] * machine.v[i])
                # The integral of s.
                spring += stiffness[i] * (beyond * (beyond + root) + width[i] ** 2 * ca.asinh(beyond / width[i])) / 4
        return Terms(
            spring=spring, force=force if force.nnz() else None,
            symbols=fields.symbols, nominal=fields.nominal, defines={"joint stops": fields.prefix},
        )  # fmt: skip
