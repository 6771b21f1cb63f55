"""Counterweights and springs that balance part of the weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from models.effects.effect_fields import quantity, read_fields
from models.machines.body_metrics import point_metric, simplified
from models.machines.manipulator import Body, Manipulator
from models.machines.parameters import Value
from models.machines.recursion import Load
from models.mechanics.terms import Terms
from ocp import checks


@dataclass(frozen=True)
class Counterbalance:
    """A counterweight m at a point of a body, a spring between it and the column, U = 1/2 k (length - free)^2, or both.

    A spring of free length zero from a point b along a link that turns about a horizontal axis to a point a above
    the axis balances m g l = k a b at every angle.

    Adds the metric of the weight, and a mass that gravity acts on if there is gravity; the potential of the spring; no
    states, no controls, the parameters `counterbalance.mass`, `counterbalance.stiffness`, ... if they are Parameters.

    Args:
        mass: m >= 0 of the counterweight, a point [kg].
        stiffness: k >= 0 of the spring [N/m].
        at: (3,) the point, from the mass centre of the body, in its axes [m].
        anchor: (3,) other end of the spring, from the origin, in the axes of the column [m].
        free_length: of the spring >= 0 [m].
        body: name of the body; None is the one next to the column.

    Raises:
        ValueError: a value is no finite number in its range, or no such body.

    Source: N. Ulrich, V. Kumar, Passive mechanical gravity compensation for robot manipulators, ICRA 1991.
    """

    mass: Value = quantity("kg", 0.0, at_least=0.0, scalar=True)
    stiffness: Value = quantity("N/m", 0.0, at_least=0.0, scalar=True)
    at: Sequence[Value] = quantity("m", (0.0, 0.0, 0.0))
    anchor: Sequence[Value] = quantity("m", (0.0, 0.0, 0.0))
    free_length: Value = quantity("m", 0.0, at_least=0.0, scalar=True)
    body: str | None = None

    def __post_init__(self) -> None:
        fields = read_fields(self)
        checks.instance("counterbalance.body", self.body, str | None, "the name of a body, or None")
        for name in ("at", "anchor"):
            if not isinstance(fields[name], tuple) or len(fields[name]) != 3 or None in fields[name]:
                raise checks.refused(f"counterbalance.{name}", getattr(self, name), "three numbers")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the mass and the potential."""
        fields, bodies = read_fields(self), {body.name: body for body in machine.bodies}
        if self.body is not None and self.body not in bodies:
            raise ValueError(
                f"counterbalance.body: {machine.name} has no body {self.body!r}; it has {', '.join(bodies)}"
            )
        chosen = next(iter(bodies)) if len(bodies) == 1 else machine.bodies[1].name
        body = bodies[chosen if self.body is None else self.body]
        column = machine.bodies[0].orientation
        arm, mass, stiffness = ca.sparsify(ca.SX(ca.vertcat(*fields["at"]))), fields["mass"], fields["stiffness"]
        point = body.centre + body.orientation @ arm
        own = Terms(symbols=fields.symbols, nominal=fields.nominal)
        if isinstance(mass, ca.SX) or mass > 0.0:
            own += Terms(loads=(Load("counterweight", mass, arm, ca.SX(3, 3), body.name),))
            if machine.recursion is None:
                metric = ca.sparsify(mass * point_metric(point, body.orientation, machine.q))
                own += Terms(metric=metric, bodies=(Body("counterweight", mass, point, body.orientation, ca.SX(3, 3)),))
        if isinstance(stiffness, ca.SX) or stiffness > 0.0:
            spring_vector = simplified(column.T @ point, machine.q) - ca.vertcat(*fields["anchor"])
            squared, free = ca.sumsqr(spring_vector), fields["free_length"]
            slack = isinstance(free, float) and free == 0.0
            own += Terms(potential=stiffness * (squared if slack else (ca.sqrt(squared) - free) ** 2) / 2)
        return own
