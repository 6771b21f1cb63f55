"""Choice of gear ratios and motors for a motion: torque, speed and power at the motor shaft for each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import quantity
from models.mechanics.mechanics import assemble
from models.torques.shaft import RPM
from models.torques.time_means import rms
from models.torques.torque_functions import inverse_dynamics, time_column
from models.torques.torque_table import TorqueTable, parameter_values
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate


@dataclass(frozen=True)
class Motor:
    """A motor by its data sheet, all at its own shaft.

    Args:
        name: for tables.
        inertia: of the rotor > 0 [kg m^2].
        rated: torque that it delivers for any time > 0 [N m].
        peak: highest torque > 0; infinite if not known [N m].
        speed: highest speed > 0; infinite if not known [rad/s].
        constant: torque of one ampere > 0; None if not known [N m/A].

    Raises:
        ValueError: a number that is not > 0, or a peak torque below the rated one.
    """

    name: str
    inertia: float = quantity("kg m^2", above=0.0)
    rated: float = quantity("N m", above=0.0)
    peak: float = quantity("N m", np.inf, above=0.0)
    speed: float = quantity("rad/s", np.inf, above=0.0)
    constant: float | None = quantity("N m/A", None, above=0.0)

    def __post_init__(self) -> None:
        checks.text("Motor: name", self.name, "a name")
        for name in ("inertia", "rated"):
            checks.number(f"Motor: {name}", getattr(self, name), "a finite number > 0", above=0.0)
        for name in ("peak", "speed"):
            checks.number(f"Motor: {name}", getattr(self, name), "a number > 0 or inf", above=0.0, finite=False)
        if self.constant is not None:
            checks.number("Motor: constant", self.constant, "a number > 0, or None", above=0.0)
        if self.peak < self.rated:
            wanted = f"at least the rated torque of {self.rated:g} N m"
            raise checks.refused("Motor: peak", self.peak, wanted)


@dataclass(frozen=True)
class Sizing:
    """Load of a motor behind a gear of some ratio, along a motion."""

    motor: Motor
    ratio: float  # motor speed over joint speed [rad/rad or rad/m]
    peak: float  # largest |torque| at the shaft [N m]
    rms: float  # root mean square of the torque at the shaft [N m]
    speed: float  # largest speed of the shaft [rad/s]
    power: float  # largest mechanical power of the motor [W]
    match: float  # inertia of the load, reflected to the shaft, over that of the rotor
    current: float  # root mean square; NaN without a torque constant [A]

    @property
    def rpm(self) -> float:
        """Largest speed of the shaft in revolutions per minute."""
        return self.speed * RPM

    @property
    def shares(self) -> tuple[float, float, float]:
        """Peak torque, rms torque and speed as shares of what the motor can do."""
        return self.peak / self.motor.peak, self.rms / self.motor.rated, self.speed / self.motor.speed

    @property
    def load(self) -> float:
        """The largest of the shares; the motor fits if it is at most 1."""
        return max(self.shares)


def size_gears(
    table: TorqueTable, drive: int, motors: Sequence[Motor], ratios: Sequence[float] | Array, efficiency: float = 1.0
) -> tuple[Sizing, ...]:
    """Return the load of every motor at every gear ratio for one drive of a motion, best first.

    torque = J N a + tau / (N eta) where the motor drives, J N a + tau eta / N where the load does;  speed = N v

    tau is the torque of the joint without the effects that depend on a gear ratio, as rotors and motors of the table.

    Args:
        table: of the motion; its resolved rows are used.
        drive: index of the coordinate.
        motors: candidates.
        ratios: N > 0 [rad/rad or rad/m].
        efficiency: eta of the gear, 0 < eta <= 1.

    Returns:
        Those that fit first, by the largest share of torque or speed that is used; then the others.

    Raises:
        ValueError: no motor, no ratio, or numbers out of range.

    Source: F. Roos, H. Johansson, J. Wikander, Optimal selection of motor and gearhead in mechatronic applications,
        Mechatronics 16 (2006).
    """
    checks.instance("table", table, TorqueTable, "a TorqueTable, as motion.torques(machine, effects) returns")
    drive = checks.whole("drive", drive, 0, len(table.machine.coordinates) - 1)
    column = checks.column("ratios", ratios, expected="gear ratios > 0")
    if np.any(column < checks.SMALLEST):
        raise checks.refused("ratios", ratios, f"gear ratios > 0, {checks.RANGE}")
    eta = checks.number("efficiency", efficiency, "a number in (0, 1]", above=0.0)
    if eta > 1.0:
        raise checks.refused("efficiency", efficiency, "a number in (0, 1]")
    candidates = checks.several("motors", motors, "a list of Motors, at least one")
    if not candidates or not all(isinstance(motor, Motor) for motor in candidates):
        raise checks.refused("motors", motors, "a list of Motors, at least one")
    t, v, a, tau, inertia = _load(table, drive)
    driving = np.where(tau * v >= 0.0, 1.0 / eta, eta)
    results = []
    for motor in candidates:
        for ratio in column:
            torque = motor.inertia * ratio * a + tau * driving / ratio
            power = torque * ratio * v
            mean = float(rms(t, torque[:, None])[0])
            results.append(Sizing(
                motor, float(ratio), float(np.max(np.abs(torque))), mean, float(ratio * np.max(np.abs(v))),
                max(float(np.max(power)), 0.0), float(np.max(inertia)) / (ratio**2 * motor.inertia),
                np.nan if motor.constant is None else mean / motor.constant,
            ))  # fmt: skip
    return tuple(sorted(results, key=lambda one: one.load))


def _load(table: TorqueTable, drive: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return t, v, a, tau and the inertia (K,) of one drive, without effects that depend on a gear ratio."""
    effects = [effect for effect in table.effects if not hasattr(effect, "ratio")]
    values = dict(zip(assemble(table.machine, table.effects).parameters, table.parameters.tolist(), strict=True))
    mechanics, rows = assemble(table.machine, effects), table.resolved
    known = {name: value for name, value in values.items() if name in mechanics.parameters}
    p = parameter_values(table.machine, effects, known)
    function = inverse_dynamics(table.machine, effects)
    (tau,) = evaluate(function, rows.q, rows.v, rows.a, p, *time_column(function, rows.t))
    symbols = ca.vertcat(*mechanics.parameters.values()) if len(p) else ca.SX(0, 1)
    metric = ca.Function("inertia", [table.machine.q, symbols], [ca.densify(mechanics.metric[drive, drive])])
    (inertia,) = evaluate(metric, rows.q, p)
    return rows.t, rows.v[:, drive], rows.a[:, drive], tau[:, drive], inertia[:, 0]
