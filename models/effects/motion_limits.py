"""Limits of the motion itself: acceleration and jerk of the joints, speed of the tool; and drives of limited rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import Some, bounded, names_of, quantity, read_fields, units_of
from models.machines.manipulator import Manipulator
from models.machines.parameters import Value
from models.mechanics.contributions import Contribution, Sizes, SolvedMotion, values_of
from models.mechanics.terms import Effect, Quantity, Rate, Read, Source, State, Terms

RAMP = 0.02  # usual time from no torque to the largest one [s]
STILL = 1e-9  # share of the largest torque below which a torque does not change


@dataclass(frozen=True)
class MotionLimits:
    """Limits of the accelerations and jerks of the joints, |v'| <= a, |v''| <= j, and of the tool, |dr/dt| <= s.

    Adds the signals "acceleration" and "jerk" of all joints, limited along every motion, and "tool_speed" with its
    square as a share of that of the limit, "tool_speed_share" in 0 .. 1, which has a derivative at rest; no states, no
    controls, the parameters `motion_limits.jerk`, ... if they are Parameters (a limit that is one limits
    "acceleration_share" or "jerk_share" to -1 .. 1). A limit of the jerk needs drives whose torques are states, such as
    `TorqueRate` or `LaggedDrive`. In Lagrange form the acceleration has the shortest graph.

    Args:
        acceleration: a > 0, one for all joints or one for each (None: no limit) [rad/s^2 or m/s^2].
        jerk: j > 0 [rad/s^3 or m/s^3].
        tool_speed: s > 0 of the tool point [m/s].

    Raises:
        ValueError: a value is no finite number > 0.
    """

    acceleration: Some | None = quantity("rad/s^2 or m/s^2", None, above=0.0)
    jerk: Some | None = quantity("rad/s^3 or m/s^3", None, above=0.0)
    tool_speed: Value | None = quantity("m/s", None, above=0.0, scalar=True)

    def __post_init__(self) -> None:
        read_fields(self)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the limits."""
        fields = read_fields(self)
        own = Terms(symbols=fields.symbols, nominal=fields.nominal)
        for name, order in (("acceleration", 2), ("jerk", 3)):
            if fields[name] is None:
                continue
            symbol = ca.SX.sym(name, machine.q.numel())
            units, limits = units_of(machine, f"/s^{order}"), fields.each(name, machine)
            read = Terms(reads=(Read(name, symbol, fields.prefix, "TorqueRate or LaggedDrive"),))
            own = own + read + bounded(name, symbol, limits, names_of(machine, name), units)
        if fields["tool_speed"] is not None:
            square = ca.sumsqr(ca.jtimes(machine.tool, machine.q, machine.v))
            signals = {
                "tool_speed": Quantity(ca.sqrt(square), "m/s"),
                "tool_speed_share": Quantity(square / fields["tool_speed"] ** 2, "1"),
            }
            own = own + Terms(signals=signals, limits={"tool_speed_share": (None, 1.0)})
        return own


@dataclass(frozen=True)
class TorqueRate:
    """Drives whose torque changes at a limited rate, dtau/dt = u, |u| <= rate.

    Adds one state for each limited drive, `drive_tau_<coordinate>` [N m or N], and makes its control the rate of its
    torque, the signal "torque_rate" of all drives, limited along every motion (a drive without a limit keeps its torque
    as control); the parameters `torque_rate.rate` (`..._1` ...) if they are Parameters (they limit
    "torque_rate_share" to -1 .. 1).

    Args:
        rate: > 0, one for all drives or one for each (None: no limit) [N m/s or N/s].

    Raises:
        ValueError: a value is no finite number > 0.

    Source: A. Isidori, Nonlinear Control Systems, 5.4 (dynamic extension).
    """

    rate: Some = quantity("N m/s or N/s", above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> TorqueRate:
        """Return drives that reach their largest torque within 20 ms."""
        return cls(tuple(torque / RAMP for torque in sizes.torque))

    def contribution(self, sizes: Sizes, motion: SolvedMotion, effects: Sequence[Effect]) -> Contribution:
        """Return the largest share of the limits that the torques of the motion ask for, infinite where one jumps."""
        limits = values_of(self, "rate", sizes.machine)[:, None]
        changes, steps = np.abs(np.diff(motion.tau, axis=1)), np.diff(motion.t)
        moved = changes > STILL * np.max(np.abs(motion.tau))
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.where(moved, changes / steps / limits, 0.0)
        return Contribution(np.zeros_like(motion.tau), float(np.nanmax(shares, initial=0.0)), "share of the rates")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the states, the drive and its limits."""
        fields = read_fields(self)
        limits, units = fields.each("rate", machine), units_of(machine, force=True)
        names, n = names_of(machine, "drive_tau"), machine.q.numel()
        control = ca.vertcat(*(ca.SX.sym(name) for name in names_of(machine, "torque_rate")))
        torque, states = ca.SX(control), dict[str, State]()
        for i in range(n):
            if limits[i] is not None:
                symbol = ca.SX.sym(names[i])
                states[names[i]] = State(symbol, control[i], units[i])
                torque[i] = symbol
        rates = tuple(unit if limit is None else f"{unit}/s" for unit, limit in zip(units, limits, strict=True))
        components = names_of(machine, "torque_rate")
        limited = [limit is not None for limit in limits]

        def invert(tau: ca.SX, v: ca.SX, rate: Rate) -> Mapping[str, Quantity]:
            slopes = rate(tau)
            both = ca.vertcat(*(slopes[i] if limited[i] else tau[i] for i in range(n)))
            return {"torque_rate": Quantity(both, rates, components)}

        bounds = bounded("torque_rate", control, limits, components, rates)
        shown = {} if "torque_rate" in bounds.signals else {"torque_rate": Quantity(control, rates, components)}
        return bounds + Terms(
            states=states, signals=shown, source=Source(Quantity(control, rates, components), torque, invert),
            symbols=fields.symbols, nominal=fields.nominal, defines={"drives": fields.prefix},
        )  # fmt: skip
