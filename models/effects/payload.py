"""A load at the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import Entry, quantity, read_fields
from models.machines.body_metrics import point_metric, turning_metric
from models.machines.inertia import ROUNDING
from models.machines.manipulator import Body, Manipulator
from models.machines.parameters import Value
from models.machines.recursion import Load
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Terms
from ocp import checks


@dataclass(frozen=True)
class Payload:
    """A load fixed to the tool, T = 1/2 m |dr/dt|^2 + 1/2 omega' Theta omega; gravity acts on it if there is gravity.

    A point mass at the tool point unless it has an offset or an inertia. The axes of the tool are those of the last
    body of the machine, its origin is the tool point: axis 3 along the arm of the sphere, axis 2 along that of the
    cylinder, axis 1 along the last link of the torus; a machine of links has tool axes of its own.

    Adds the inertia of the load to that of the last link (its metric for a point, and where that is shorter), and a
    mass; no states, no controls, the parameters `payload.mass`, `payload.offset_1`, `payload.inertia_1`, ... if they
    are Parameters.

    Args:
        mass: m >= 0 [kg].
        offset: (3,) mass centre from the tool point, in the axes of the tool [m].
        inertia: tensor Theta about the mass centre in the axes of the tool: three principal moments (11, 22, 33), or
            six components (11, 22, 33, 12, 13, 23), products as tensor components (minus the integrals) [kg m^2].

    Raises:
        ValueError: a value is no finite number, mass < 0, or an inertia that no body has.
    """

    mass: Value = quantity("kg", at_least=0.0, scalar=True)
    offset: Sequence[Value] = quantity("m", (0.0, 0.0, 0.0))
    inertia: Sequence[Value] = quantity("kg m^2", (0.0, 0.0, 0.0))

    def __post_init__(self) -> None:
        fields = read_fields(self)
        for name, sizes in (("offset", (3,)), ("inertia", (3, 6))):
            value = fields[name]
            if not isinstance(value, tuple) or len(value) not in sizes or None in value:
                more = " (11, 22, 33) or six (and 12, 13, 23)" if name == "inertia" else ""
                raise checks.refused(f"payload.{name}", getattr(self, name), f"three numbers{more}")
        numbers = [fields.nominal.get(f"payload.inertia_{i + 1}", e) for i, e in enumerate(fields["inertia"])]
        moments = np.linalg.eigvalsh(np.array(ca.DM(_tensor(numbers))))
        slack = ROUNDING * max(abs(moments[2]), abs(moments[0]))
        if moments[0] < -slack or moments[2] > moments[0] + moments[1] + slack:
            listed = ", ".join(f"{moment:g}" for moment in moments)
            raise ValueError(
                f"payload.inertia: principal moments {listed} kg m^2, expected all >= 0 and the largest at most the "
                "sum of the others; no rigid body has them"
            )

    @classmethod
    def typical(cls, sizes: Sizes) -> Payload:
        """Return a load of a tenth of the mass of the machine."""
        return cls(0.1 * sizes.mass)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the metric and the mass of the load."""
        fields = read_fields(self)
        mass, axes = fields["mass"], machine.tool_orientation
        offset, inertia = ca.sparsify(ca.SX(ca.vertcat(*fields["offset"]))), ca.sparsify(_tensor(fields["inertia"]))
        own = Load("payload", mass, offset, inertia)
        if machine.recursion is not None:
            return Terms(loads=(own,), symbols=fields.symbols, nominal=fields.nominal)
        centre, metric = machine.tool, mass * machine.tool_metric
        if offset.nnz():
            centre = machine.tool + axes @ offset
            metric = mass * point_metric(centre, axes, machine.q)
        if inertia.nnz():
            metric = metric + turning_metric(axes, inertia, machine.q)
        load = Body("payload", mass, centre, axes, inertia)
        nothing = isinstance(mass, float) and mass == 0.0 and not inertia.nnz()
        loads = () if nothing else (own,)
        return Terms(
            metric=ca.sparsify(metric), bodies=(load,), loads=loads, symbols=fields.symbols, nominal=fields.nominal
        )


def _tensor(entries: Sequence[Entry]) -> ca.SX:
    if len(entries) == 3:
        return ca.diag(ca.vertcat(*map(ca.SX, entries)))
    xx, yy, zz, xy, xz, yz = map(ca.SX, entries)
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
