"""Weight of the bodies."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from models.effects.effect_fields import quantity, read_fields
from models.machines.manipulator import Manipulator
from models.machines.parameters import Value
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Terms
from ocp import checks


@dataclass(frozen=True)
class Gravity:
    """A homogeneous gravity field, U = -g d . sum_k m_k r_k with the unit vector d of its direction.

    Adds a potential; no states, no controls, the parameter `gravity.g` if g is a Parameter.

    Args:
        g: acceleration [m/s^2].
        direction: (3,) of the field in the inertial frame, e_3 upwards; its length does not matter.

    Raises:
        ValueError: g is not finite, or the direction is not a finite vector of three numbers other than zero.
    """

    g: Value = quantity("m/s^2", 9.81, scalar=True)
    direction: tuple[float, float, float] = field(default=(0.0, 0.0, -1.0), metadata={"unit": "m/m"})

    def __post_init__(self) -> None:
        read_fields(self, "g")
        wanted = "three numbers, not all zero"
        if not np.any(checks.column("gravity.direction", self.direction, 3, wanted)):
            raise checks.refused("gravity.direction", self.direction, wanted)

    @classmethod
    def typical(cls, sizes: Sizes) -> Gravity:
        """Return gravity of 9.81 m/s^2."""
        return cls()

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the field; it acts on all masses, those that other effects attach included."""
        fields = read_fields(self, "g")
        unit = np.array(self.direction, dtype=float) / np.linalg.norm(self.direction)
        acceleration = fields["g"] * ca.sparsify(ca.SX(ca.DM(unit)))
        return Terms(acceleration=acceleration, symbols=fields.symbols, nominal=fields.nominal)
