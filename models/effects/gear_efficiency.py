"""Friction of gears that is proportional to their load."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.effects.effect_fields import Some, names_of, present, quantity, read_fields
from models.machines.manipulator import Manipulator
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Rate, Terms, Transmission


@dataclass(frozen=True)
class GearEfficiency:
    """Gears that lose power: tau = eta tau_motor when the motor drives, tau = tau_motor / eta when the load does.

    tau = c tau_motor + d (sqrt(tau_motor^2 + w^2) - w),  c = cosh(s ln eta),  d = sinh(s ln eta),  s = tanh(v / width)

    which is tau_motor eta^s for tau_motor >> w > 0 and tau_motor eta^-s for tau_motor << -w: smooth where speed or
    torque change their sign. Torque and speed of the motors are in units of the joints.

    Adds no states, and makes the control the torque of the motors, the signal "motor_tau"; "tau" is the force on the
    joint, "power" that of the motors, "loss" has (tau_motor - tau) v; the parameters `gear_efficiency.efficiency`, ...
    if they are Parameters. A lag or an electric motor may stand before it; elastic joints have a transmission of their
    own.

    Args:
        efficiency: eta, 0 < eta <= 1, one for all drives or one for each (None: no loss) [1].
        width: speed of smoothing > 0 [rad/s or m/s].
        torque: w, torque of smoothing > 0 [N m or N].

    Raises:
        ValueError: a value is no finite number in its range.

    Source: F. Roos, H. Johansson, J. Wikander, Optimal selection of motor and gearhead in mechatronic applications,
        Mechatronics 16 (2006) (efficiency by the direction of power); the smoothing is that of `Coulomb`.
    """

    efficiency: Some = quantity("1", above=0.0)
    width: Some = quantity("rad/s or m/s", 0.02, above=0.0)
    torque: Some = quantity("N m or N", 0.1, above=0.0)

    def __post_init__(self) -> None:
        fields = read_fields(self)
        for name, value in fields.nominal.items():
            if name.startswith("gear_efficiency.efficiency"):
                _check(name, value)
        several = self.efficiency if isinstance(self.efficiency, tuple | list) else (self.efficiency,)
        for i, value in enumerate(several):
            if isinstance(value, int | float):
                _check(f"gear_efficiency.efficiency_{i + 1}", float(value))

    @classmethod
    def typical(cls, sizes: Sizes) -> GearEfficiency:
        """Return gears that lose 15 % of the power."""
        return cls(0.85)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the transmission."""
        fields, n = read_fields(self), machine.q.numel()
        efficiency, width, smooth = (fields.each(name, machine) for name in ("efficiency", "width", "torque"))
        motor_tau = ca.vertcat(*map(ca.SX.sym, names_of(machine, "motor_tau")))
        geared = [i for i in range(n) if efficiency[i] is not None]
        torque = ca.SX(motor_tau)
        shares = {}
        for i in geared:
            exponent = ca.tanh(machine.v[i] / present(fields, "width", i, width[i])) * ca.log(efficiency[i])
            shares[i] = ca.cosh(exponent), ca.sinh(exponent), present(fields, "torque", i, smooth[i])
            c, d, w = shares[i]
            torque[i] = c * motor_tau[i] + d * (ca.sqrt(motor_tau[i] ** 2 + w**2) - w)

        def invert(tau: ca.SX, rate: Rate) -> tuple[ca.SX, ca.SX, ca.SX]:
            needed = ca.SX(tau)
            for i, (c, d, w) in shares.items():
                # With c^2 - d^2 = 1 the equation above has this one solution.
                moved = tau[i] + d * w
                needed[i] = c * moved - d * ca.sqrt(moved**2 + w**2)
            return machine.q, machine.v, needed

        lost = sum(((motor_tau[i] - torque[i]) * machine.v[i] for i in geared), ca.SX(0))
        return Terms(
            transmission=Transmission(motor_tau, machine.q, machine.v, torque, invert), dissipation=lost,
            symbols=fields.symbols, nominal=fields.nominal, defines={"transmission": fields.prefix},
        )  # fmt: skip


def _check(name: str, value: float) -> None:
    if value > 1.0:
        raise ValueError(f"{name}: got {value:g}, expected an efficiency of at most 1")
