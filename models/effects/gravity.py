"""Weight of the bodies."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.manipulator import Manipulator
from models.parameters import Parameters, Value, number, read
from models.terms import Terms


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

    g: Value = 9.81
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    def __post_init__(self) -> None:
        self._read()
        try:
            components = [number("gravity.direction", d, "m/m") for d in self.direction]
        except TypeError:
            components = []
        if len(components) != 3 or not any(components):
            raise ValueError(f"gravity.direction: got {self.direction!r}, expected three numbers, not all zero")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the field; it acts on all masses, those that other effects attach included."""
        parameters = self._read()
        unit = np.array(self.direction, dtype=float) / np.linalg.norm(self.direction)
        nominal = dict.fromkeys(parameters.symbols, parameters.nominal["g"])
        field = parameters["g"] * ca.sparsify(ca.SX(ca.DM(unit)))
        return Terms(acceleration=field, symbols=parameters.symbols, nominal=nominal)

    def _read(self) -> Parameters:
        return read({"g": self.g}, lambda _: "m/s^2", prefix="gravity.")
