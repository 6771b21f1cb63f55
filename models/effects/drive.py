"""Drives with dynamics of their own: a first-order lag, and elastic joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import Some, names_of, quantity, read_fields, units_of
from models.machines.manipulator import Manipulator
from models.mechanics.contributions import ROTOR, Contribution, Sizes, SolvedMotion, values_of
from models.mechanics.linear_response import lag_error, oscillator_error
from models.mechanics.terms import Effect, Quantity, Rate, Source, State, Terms, Transmission
from ocp.checks import Array


@dataclass(frozen=True)
class LaggedDrive:
    """Drives whose torque follows a command with a lag of first order, T dtau/dt = command - tau.

    Adds one state for each drive that lags, `drive_tau_<coordinate>` [N m or N], and makes the control the commanded
    torque, the signal "command"; the parameters `lagged_drive.time_constant` (`..._1` ...) if they are Parameters.

    Args:
        time_constant: T > 0, one for all drives or one for each (None: ideal) [s].

    Raises:
        ValueError: a value is no finite number > 0.

    Source: L. Sciavicco, B. Siciliano, Modelling and Control of Robot Manipulators, chapter 8 (a closed current loop).
    """

    time_constant: Some = quantity("s", above=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> LaggedDrive:
        """Return drives with a lag of 5 ms."""
        return cls(5e-3)

    def contribution(self, sizes: Sizes, motion: SolvedMotion, effects: Sequence[Effect]) -> Contribution:
        """Return how far the torque lags behind its command."""
        constants = values_of(self, "time_constant", sizes.machine)
        return Contribution(lag_error(motion.t, motion.tau, constants), note="torque behind its command")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the states and the drive."""
        fields = read_fields(self)
        constants, units = fields.each("time_constant", machine), units_of(machine, force=True)
        names = names_of(machine, "drive_tau")
        command = Quantity(_column(machine, "command"), units, names_of(machine, "command"))
        states: dict[str, State] = {}
        torque = ca.SX(command.expression)
        for i, constant in enumerate(constants):
            if constant is not None:
                symbol = ca.SX.sym(names[i])
                states[names[i]] = State(symbol, (command.expression[i] - symbol) / constant, units[i])
                torque[i] = symbol
        lag = ca.vertcat(*(0.0 if constant is None else constant for constant in constants))

        def invert(tau: ca.SX, v: ca.SX, rate: Rate) -> Mapping[str, Quantity]:
            return {"command": Quantity(tau + lag * rate(tau), units, command.components)}

        return Terms(
            states=states, signals={"command": command}, source=Source(command, torque, invert),
            symbols=fields.symbols, nominal=fields.nominal, defines={"drives": fields.prefix},
        )  # fmt: skip


@dataclass(frozen=True)
class ElasticDrive:
    """Joints that yield between motor and link, J theta'' = tau_motor - tau, tau = k (theta - q) + d (theta' - v).

    theta is the position of the motor in units of its joint, J = N^2 J_rotor the rotor inertia reflected to it. The
    rotation of the rotors with the links that carry them is neglected, as in `RotorInertia`, which it replaces. A rotor
    that an elastic joint has itself, such as those of robots.puma560(), leaves the metric and sits behind the spring;
    an inertia of None takes it as it is.

    Adds two states for each elastic joint, `motor_q_<coordinate>` and `motor_v_<coordinate>`, and makes the control the
    torque of the motors, the signal "motor_tau"; "motor_q" and "motor_v" are signals, "tau" is the force on the joint,
    "power" that of the motors, "loss" has d (theta' - v)^2; the parameters `elastic_drive.stiffness`, ... if they
    are Parameters. A drive with a lag or an electric motor may stand before it.

    Args:
        stiffness: k > 0, one for all joints or one for each (None: rigid) [N m/rad or N/m].
        inertia: J > 0 of the motor, reflected to its joint [kg m^2 or kg].
        damping: d >= 0 [N m s/rad or N s/m].

    Raises:
        ValueError: a value is no finite number in its range, or a joint that is not rigid lacks one.

    Source: M. W. Spong, Modeling and control of elastic joint robots, ASME J. Dyn. Syst. Meas. Control 109 (1987).
    """

    stiffness: Some = quantity("N m/rad or N/m", above=0.0)
    inertia: Some | None = quantity("kg m^2 or kg", None, above=0.0)
    damping: Some = quantity("N m s/rad or N s/m", 0.0, at_least=0.0)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> ElasticDrive:
        """Return joints of 1e5 N m/rad (1e6 N/m) with rotors of 1e-4 kg m^2 behind usual gears, or their own."""
        stiffness = tuple(1e5 if c.unit == "rad" else 1e6 for c in sizes.machine.coordinates)
        own = sizes.machine.rotors or (0.0,) * len(stiffness)
        pairs = zip(own, sizes.ratio, strict=True)
        return cls(stiffness, tuple(None if _is_there(rotor) else ROTOR * ratio**2 for rotor, ratio in pairs))

    def contribution(self, sizes: Sizes, motion: SolvedMotion, effects: Sequence[Effect]) -> Contribution:
        """Return the torque that oscillates in the joints: rotor and spring as an undamped oscillator sqrt(k / J)."""
        machine = sizes.machine
        given = values_of(self, "inertia", machine)
        inertia = np.where(np.isnan(given), _rotors_of(machine), given)
        frequencies = np.sqrt(values_of(self, "stiffness", machine) / inertia)
        error = oscillator_error(motion.t, motion.tau, frequencies)
        return Contribution(error, note="torque that oscillates in the joints")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the states and the transmission."""
        fields, n = read_fields(self), machine.q.numel()
        k, inertia, damping = (fields.each(name, machine) for name in ("stiffness", "inertia", "damping"))
        elastic = [i for i in range(n) if k[i] is not None]
        own, turning = machine.rotors or (0.0,) * n, machine.spins or (0.0,) * n
        inertia = tuple(own[i] if inertia[i] is None and i in elastic else inertia[i] for i in range(n))
        for i in elastic:
            if isinstance(inertia[i], float) and inertia[i] == 0.0:
                raise ValueError(
                    f"elastic_drive.inertia_{i + 1}: got None for a joint with a stiffness and without a rotor of its "
                    "own, expected kg m^2"
                )
        motor_tau, motor_q, motor_v = _column(machine, "motor_tau"), ca.SX(machine.q), ca.SX(machine.v)
        torque, metric, spins = ca.SX(motor_tau), ca.SX(n, n), ca.SX(n, 1)
        states: dict[str, State] = {}
        energy = dissipation = ca.SX(0)
        for i in range(n):
            if i not in elastic:
                if inertia[i] is not None:
                    metric[i, i] = inertia[i]  # a rigid joint turns its rotor
                continue
            if _is_there(own[i]):
                metric[i, i] = -own[i]
            if _is_there(turning[i]):
                spins[i] = -turning[i]
            name, unit = machine.coordinates[i].name, machine.coordinates[i].unit
            theta, speed = ca.SX.sym(f"motor_q_{name}"), ca.SX.sym(f"motor_v_{name}")
            twist, slip, d = theta - machine.q[i], speed - machine.v[i], 0.0 if damping[i] is None else damping[i]
            motor_q[i], motor_v[i], torque[i] = theta, speed, k[i] * twist + d * slip
            states[theta.name()] = State(theta, speed, unit)
            states[speed.name()] = State(speed, (motor_tau[i] - torque[i]) / inertia[i], f"{unit}/s")
            energy += (inertia[i] * speed**2 + k[i] * twist**2) / 2
            dissipation += d * slip**2

        def invert(tau: ca.SX, rate: Rate) -> tuple[ca.SX, ca.SX, ca.SX]:
            if not dissipation.is_zero():
                raise ValueError(
                    "drive_dynamics: elastic joints with damping; the motion at one instant does not fix their motors, "
                    "use ElasticDrive(..., damping=0)"
                )
            q = ca.SX(machine.q)
            for i in elastic:
                q[i] += tau[i] / k[i]
            v = rate(q)
            a, needed = rate(v), ca.SX(tau)
            for i in elastic:
                needed[i] += inertia[i] * a[i]
            return q, v, needed

        return Terms(
            metric=ca.sparsify(metric) if metric.nnz() else None, spins=spins if spins.nnz() else None,
            states=states, energy=energy, dissipation=dissipation,
            transmission=Transmission(motor_tau, motor_q, motor_v, torque, invert),
            symbols=fields.symbols, nominal=fields.nominal,
            defines={"transmission": fields.prefix, "rotors": fields.prefix},
        )  # fmt: skip


def _column(machine: Manipulator, prefix: str) -> ca.SX:
    return ca.vertcat(*(ca.SX.sym(name) for name in names_of(machine, prefix)))


def _is_there(entry: ca.SX | float) -> bool:
    return isinstance(entry, ca.SX) or entry != 0.0


def _rotors_of(machine: Manipulator) -> Array:
    """Return the reflected inertia (n,) of the rotors that the joints have, NaN for those without."""
    symbols = ca.vertcat(*machine.symbols.values()) if machine.symbols else ca.SX(0, 1)
    rotors = ca.vertcat(*map(ca.SX, machine.rotors or (0.0,) * len(machine.coordinates)))
    values = ca.Function("rotors", [symbols], [rotors])([machine.nominal[name] for name in machine.symbols])
    numbers = values.full().ravel()
    return np.where(numbers > 0.0, numbers, np.nan)
