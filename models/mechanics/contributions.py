"""What an effect may bring so that its contribution to a solved motion can be estimated without solving again.

Both methods are optional:

    typical(cls, sizes) -> Effect               a class method: the effect with parameters of the usual size
    contribution(self, sizes, motion, effects)  its torque along a motion, where inverse dynamics does not give it

An effect without the first is never proposed; one without the second is judged by inverse dynamics with and without
it, or by the use of its limits if it has nothing but limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter
from models.mechanics.terms import Effect
from ocp.checks import Array

ROTOR = 1e-4  # inertia of a rotor [kg m^2]
RATIO = {"rad": 100.0, "m": 300.0}  # gear ratio for a coordinate in this unit [rad/rad or rad/m]


@dataclass(frozen=True, eq=False)
class Sizes:
    """A machine with the largest torque and speed of its drives: what usual parameters are derived from."""

    machine: Manipulator
    torque: tuple[float, ...]  # (n,) > 0 [N m or N]
    speed: tuple[float, ...]  # (n,) > 0 [rad/s or m/s]

    @classmethod
    def of(cls, machine: Manipulator, tau: Array, v: Array) -> Sizes:
        """Return the sizes of a motion with torques and velocities (n, K); 1 for a drive that never moves or pulls."""
        largest = (np.max(np.abs(part), axis=1) for part in (tau, v))
        torque, speed = (tuple(float(value) or 1.0 for value in part) for part in largest)
        return cls(machine, torque, speed)

    @property
    def mass(self) -> float:
        """Sum of the masses of the machine [kg]."""
        machine = self.machine
        symbols = ca.vertcat(*machine.symbols.values()) if machine.symbols else ca.SX(0, 1)
        total = ca.sum1(ca.vertcat(*(ca.SX(body.mass) for body in machine.bodies)))
        return float(ca.Function("mass", [symbols], [total])([machine.nominal[name] for name in machine.symbols]))

    @property
    def ratio(self) -> tuple[float, ...]:
        """(n,) usual gear ratios [rad/rad or rad/m]."""
        return tuple(RATIO[c.unit] for c in self.machine.coordinates)


@dataclass(frozen=True, eq=False)
class SolvedMotion:
    """A motion with its torques at many times."""

    t: Array  # (K,) [s]
    q: Array  # (n, K)
    v: Array
    a: Array
    tau: Array  # [N m or N]
    values: Mapping[str, float]  # of parameters

    def rms(self, values: Array) -> Array:
        """Return the root mean square over time (n,) of values (n, K)."""
        return np.asarray(np.sqrt(np.trapezoid(values**2, self.t) / max(self.t[-1] - self.t[0], 1e-300)))


@dataclass(frozen=True, eq=False)
class Contribution:
    """Torque (n, K) that an effect adds along a motion, the largest share of its limit that is used, and a note."""

    torque: Array  # [N m or N]
    use: float = float("nan")  # NaN if the effect has no limit
    note: str = ""


def values_of(effect: Effect, name: str, machine: Manipulator) -> Array:
    """Return a field of an effect for every drive (n,), NaN where a drive has none."""
    value = getattr(effect, name)
    several = value if isinstance(value, Sequence) else (value,) * len(machine.coordinates)
    numbers = [item.value if isinstance(item, Parameter) else item for item in several]
    return np.array([np.nan if item is None else float(item) for item in numbers])
