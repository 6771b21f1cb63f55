"""Limits of drives that combine torque and speed, kept along every motion."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.effects.effect_fields import Some, bounded, names_of, quantity, read_fields, units_of
from models.machines.manipulator import Manipulator
from models.machines.parameters import Value
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Quantity, Read, Terms
from ocp.system import Side

MACHINE = "a machine"


@dataclass(frozen=True)
class TorqueSpeed:
    """A torque that falls linearly with speed, |tau / stall + v / no_load| <= 1, and a highest torque |tau| <= peak.

    tau and v are those of the motors in units of the joints: of the joints themselves unless these are elastic. In all
    four quadrants: with the speed, the driving torque falls and the braking torque rises, up to the peak.

    Adds the signal "torque_speed" of all limited drives, limited to -1 .. 1 along every motion, and "peak_torque",
    limited to the peak; no states, no controls, the parameters `torque_speed.stall`, ... if they are Parameters (a
    peak that is one limits "peak_torque_share" to -1 .. 1 instead).

    Args:
        stall: torque at rest > 0, one for all drives or one for each (None: no limit) [N m or N].
        no_load: speed without torque > 0 [rad/s or m/s].
        peak: highest torque > 0; None for none [N m or N].

    Raises:
        ValueError: a value is no finite number > 0.

    Source: L. Sciavicco, B. Siciliano, Modelling and Control of Robot Manipulators, chapter 8 (a direct-current motor
        at its highest voltage: stall = k N U / R, no_load = U / (k N)).
    """

    stall: Some = quantity("N m or N", above=0.0)
    no_load: Some = quantity("rad/s or m/s", above=0.0)
    peak: Some | None = quantity("N m or N", None, above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> TorqueSpeed:
        """Return limits of twice the peak torque and twice the peak speed."""
        return cls(tuple(2.0 * f for f in sizes.torque), tuple(2.0 * w for w in sizes.speed))

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the limits."""
        fields = read_fields(self)
        stall, no_load, peak = (fields.each(name, machine) for name in ("stall", "no_load", "peak"))
        tau, v, reads = motors(machine, fields.prefix)
        limited = [i for i in range(len(stall)) if stall[i] is not None and no_load[i] is not None]
        share = ca.vertcat(*(tau[i] / stall[i] + v[i] / no_load[i] for i in limited))
        name = "torque_speed"
        own = Terms(
            signals={name: Quantity(share, "1", names_of(machine, name, limited))} if limited else {},
            limits={name: (-1.0, 1.0)} if limited else {},
            reads=reads, symbols=fields.symbols, nominal=fields.nominal, defines={"torque-speed limit": fields.prefix},
        )  # fmt: skip
        forces = units_of(machine, force=True)
        return own + bounded("peak_torque", tau, peak, names_of(machine, "peak_torque"), forces)


@dataclass(frozen=True)
class PowerLimit:
    """A limit of the power that all drives draw together, -brake <= sum tau v <= limit.

    tau and v are those of the motors in units of the joints. A drive that brakes feeds the others, as on a common
    supply; nothing else is stored.

    Adds the signals "drive_power" [W] and "drive_power_share" = drive_power / limit, limited to -brake / limit .. 1
    along every motion; no states, no controls, the parameters `power_limit.limit`, `power_limit.brake` if they are
    Parameters (a limit of braking then is one of the signal "brake_reserve" = (drive_power + brake) / limit >= 0).

    Args:
        limit: power that the supply gives > 0 [W].
        brake: power that it takes back >= 0; None for any [W].

    Raises:
        ValueError: a value is no finite number in its range.
    """

    limit: Value = quantity("W", above=0.0, scalar=True)
    brake: Value | None = quantity("W", None, at_least=0.0, scalar=True)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> PowerLimit:
        """Return a supply of 2 kW."""
        return cls(2000.0)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the limit."""
        fields = read_fields(self)
        tau, v, reads = motors(machine, fields.prefix)
        power, limit, brake = ca.dot(tau, v), fields["limit"], fields["brake"]
        # Shares, not watts: unscaled rows of this product of unknowns keep an interior-point method from converging.
        signals = {"drive_power": Quantity(power, "W"), "drive_power_share": Quantity(power / limit, "1")}
        lower = None if brake is None or isinstance(limit, ca.SX) or isinstance(brake, ca.SX) else -brake / limit
        limits: dict[str, tuple[Side, Side]] = {"drive_power_share": (lower, 1.0)}
        if brake is not None and lower is None:
            signals["brake_reserve"] = Quantity((power + brake) / limit, "1")
            limits["brake_reserve"] = (0.0, None)
        return Terms(
            signals=signals, limits=limits, reads=reads, symbols=fields.symbols, nominal=fields.nominal,
            defines={"power limit": fields.prefix},
        )  # fmt: skip


def motors(machine: Manipulator, reader: str) -> tuple[ca.SX, ca.SX, tuple[Read, ...]]:
    """Return symbols for torque and velocity of the motors (n,), and the Reads that connect them.

    Args:
        machine: whose motors.
        reader: name of the effect.
    """
    tau, v = (ca.vertcat(*map(ca.SX.sym, names_of(machine, name))) for name in ("motor_tau", "motor_v"))
    return tau, v, (Read("motor_tau", tau, reader, MACHINE), Read("motor_v", v, reader, MACHINE))
