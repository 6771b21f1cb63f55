"""A load at the tool."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.manipulator import Body, Manipulator
from models.parameters import Parameters, Value, read
from models.terms import Terms


@dataclass(frozen=True)
class Payload:
    """A point mass at the tool point, T = 1/2 m |d r_tool/dt|^2; gravity acts on it if there is gravity.

    Adds m times the metric of the tool, and a mass; no states, no controls, the parameter `payload.mass` if the mass is
    a Parameter.

    Args:
        mass: [kg], >= 0.

    Raises:
        ValueError: not a finite number >= 0.
    """

    mass: Value

    def __post_init__(self) -> None:
        nominal = self._read().nominal["mass"]
        if nominal < 0.0:
            raise ValueError(f"payload.mass: got {nominal:g} kg, expected a mass >= 0")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the metric and the mass of the load."""
        parameters = self._read()
        mass = parameters["mass"]
        load = Body("payload", mass, machine.tool, ca.SX.eye(3), ca.SX(3, 3))
        nominal = dict.fromkeys(parameters.symbols, parameters.nominal["mass"])
        metric = ca.sparsify(mass * machine.tool_metric)
        return Terms(metric=metric, bodies=(load,), symbols=parameters.symbols, nominal=nominal)

    def _read(self) -> Parameters:
        return read({"mass": self.mass}, lambda _: "kg", prefix="payload.")
