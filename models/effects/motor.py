"""Electric motors and their heat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import Some, bounded, names_of, present, quantity, read_fields, units_of
from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter, Value
from models.mechanics.contributions import Contribution, Sizes, SolvedMotion, values_of
from models.mechanics.linear_response import lag_error
from models.mechanics.terms import Effect, Quantity, Rate, Read, Source, State, Terms
from ocp.checks import Array
from ocp.system import Side


@dataclass(frozen=True)
class MotorDrive:
    """Direct-current motors with gears, L di/dt = u - R i - k N v, tau = N k i.

    v is the speed of the motors in units of the joints (of the joints themselves unless they are elastic), N the gear
    ratio. k is torque constant and back-EMF constant in one, as in SI both have the same number.

    Adds one state for each motor with inductance, `current_<coordinate>` [A], and makes the control the voltage, the
    signal "voltage" [V]; signals "current" [A], "copper_loss" R i^2 [W] and "electrical_power" sum u i [W]. "power"
    stays the mechanical power of the motors. The parameters `motor_drive.resistance`, ... if they are Parameters. The
    inertia of the rotor is RotorInertia or ElasticDrive.

    Args:
        constant: k > 0, one for all drives or one for each (None: an ideal torque) [N m/A].
        resistance: R > 0 [ohm].
        inductance: L >= 0 [H]; 0 makes the current follow at once, without a state.
        ratio: N, motor speed over joint speed [rad/rad or rad/m].

    Raises:
        ValueError: a value is no finite number in its range, or a motor lacks one.

    Source: L. Sciavicco, B. Siciliano, Modelling and Control of Robot Manipulators, chapter 8.
    """

    constant: Some = quantity("N m/A", above=0.0)
    resistance: Some = quantity("ohm", above=0.0)
    inductance: Some = quantity("H", 0.0, at_least=0.0)
    ratio: Some = quantity("rad/rad or rad/m", 100.0)

    def __post_init__(self) -> None:
        fields = read_fields(self)
        for name, value in fields.nominal.items():
            if name.startswith("motor_drive.inductance") and value == 0.0:
                raise ValueError(
                    "motor_drive.inductance: got Parameter(value=0.0), expected a value > 0 for one that stays a "
                    "symbol: it makes the current a state, which the number 0 does not"
                )

    @classmethod
    def typical(cls, sizes: Sizes) -> MotorDrive:
        """Return motors that take 10 A and 4 V at the winding for the peak torque, with L / R = 2 ms."""
        constants = tuple(peak / (10.0 * ratio) for peak, ratio in zip(sizes.torque, sizes.ratio, strict=True))
        return cls(constants, 0.4, 0.8e-3, sizes.ratio)

    def contribution(self, sizes: Sizes, motion: SolvedMotion, effects: Sequence[Effect]) -> Contribution:
        """Return how far the torque lags behind its command, by the electrical time constant L / R."""
        machine = sizes.machine
        constants = values_of(self, "inductance", machine) / values_of(self, "resistance", machine)
        return Contribution(lag_error(motion.t, motion.tau, constants), note="torque behind its command, by L / R")

    def mean_loss(self, machine: Manipulator, rms: Array) -> Array:
        """Return the mean copper loss (n,) [W] for torques of the joints with a root mean square (n,) [N m or N]."""
        gain = values_of(self, "constant", machine) * values_of(self, "ratio", machine)
        return np.asarray(values_of(self, "resistance", machine) * rms**2 / gain**2)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the states and the drive."""
        fields, n = read_fields(self), machine.q.numel()
        columns = [fields.each(name, machine) for name in ("constant", "resistance", "inductance", "ratio")]
        constant, resistance, inductance, ratio = columns
        motors = [i for i in range(n) if constant[i] is not None]
        for i in motors:
            for name, column in zip(("constant", "resistance", "inductance", "ratio"), columns, strict=True):
                present(fields, name, i, column[i])
        forces = units_of(machine, force=True)
        names = tuple(
            ("voltage_" if i in motors else "tau_") + coordinate.name
            for i, coordinate in enumerate(machine.coordinates)
        )
        control = ca.vertcat(*map(ca.SX.sym, names))
        speed = ca.vertcat(*map(ca.SX.sym, names_of(machine, "motor_v")))
        states: dict[str, State] = {}
        torque, current = ca.SX(control), ca.SX(n, 1)
        for i in motors:
            # Gear and constant together: newton metres (or newtons) of the joint for an ampere.
            gain = constant[i] * ratio[i]
            left = control[i] - gain * speed[i]
            if isinstance(inductance[i], float) and inductance[i] == 0.0:
                current[i] = left / resistance[i]
            else:
                name = f"current_{machine.coordinates[i].name}"
                current[i] = ca.SX.sym(name)
                states[name] = State(current[i], (left - resistance[i] * current[i]) / inductance[i], "A")
            torque[i] = gain * current[i]
        heat = ca.vertcat(*(resistance[i] * current[i] ** 2 if i in motors else ca.SX(0) for i in range(n)))
        electrical = sum((control[i] * current[i] for i in motors), ca.SX(0))
        voltage = Quantity(control, tuple("V" if i in motors else forces[i] for i in range(n)), names)

        def invert(tau: ca.SX, v: ca.SX, rate: Rate) -> Mapping[str, Quantity]:
            needed, drawn = ca.SX(tau), ca.SX(n, 1)
            for i in motors:
                drawn[i] = tau[i] / (constant[i] * ratio[i])
            for i in motors:
                needed[i] = resistance[i] * drawn[i] + constant[i] * ratio[i] * v[i]
                if not (isinstance(inductance[i], float) and inductance[i] == 0.0):
                    needed[i] += inductance[i] * rate(drawn[i])
            heat = ca.vertcat(*(resistance[i] * drawn[i] ** 2 if i in motors else ca.SX(0) for i in range(n)))
            return {
                "voltage": Quantity(needed, voltage.unit, names),
                "current": Quantity(drawn, "A", names_of(machine, "current")),
                "copper_loss": Quantity(heat, "W", names_of(machine, "copper_loss")),
            }

        return Terms(
            states=states,
            signals={
                "voltage": voltage,
                "current": Quantity(ca.densify(current), "A", names_of(machine, "current")),
                "copper_loss": Quantity(ca.densify(heat), "W", names_of(machine, "copper_loss")),
                "electrical_power": Quantity(electrical, "W"),
            },
            reads=(Read("motor_v", speed, fields.prefix, "a machine"),),
            source=Source(voltage, torque, invert),
            symbols=fields.symbols, nominal=fields.nominal, defines={"drives": fields.prefix},
        )  # fmt: skip


@dataclass(frozen=True)
class WindingHeat:
    """Windings that warm up, C dT/dt = R i^2 - (T - ambient) / R_th, and a limit of their temperature.

    One body for each motor: winding and housing together, its resistance R that of the motor, at all temperatures.
    R i^2 is the signal "copper_loss" of the current of a MotorDrive, which must be in the list too, anywhere.

    Adds one state for each winding, `winding_<coordinate>` [K], starting at `initial`, the signal "winding" of all
    of them and, if there is a limit, that limit along every motion; the parameters `winding_heat.capacity`, ... if
    they are Parameters.

    Args:
        resistance: R_th > 0 to the surroundings, one for all drives or one for each (None: no winding) [K/W].
        capacity: C > 0 [J/K].
        limit: highest temperature; None for none [K].
        ambient: temperature of the surroundings [K].
        initial: temperature at the start; None is that of the surroundings [K].

    Raises:
        ValueError: a value is no finite number in its range; no effect defines "copper_loss".

    Source: IEC 60034-1, Rotating electrical machines, rating and performance: a body of one time constant, R_th C.
    """

    resistance: Some = quantity("K/W", above=0.0)
    capacity: Some = quantity("J/K", above=0.0)
    limit: Some | None = quantity("K", None, above=0.0)
    ambient: Value = quantity("K", 293.15, above=0.0, scalar=True)
    initial: float | None = quantity("K", None, above=0.0, scalar=True)

    def __post_init__(self) -> None:
        read_fields(self)

    @classmethod
    def typical(cls, sizes: Sizes) -> WindingHeat:
        """Return windings of 2 K/W and 500 J/K that may warm up to 393 K."""
        return cls(2.0, 500.0, 393.15)

    def contribution(self, sizes: Sizes, motion: SolvedMotion, effects: Sequence[Effect]) -> Contribution:
        """Return the steady rise of the temperature at the mean loss, as a share of the allowed rise."""
        motor = next((effect for effect in effects if hasattr(effect, "mean_loss")), None)
        nothing = np.zeros_like(motion.tau)
        if motor is None:
            return Contribution(nothing, note="needs a MotorDrive")
        loss = motor.mean_loss(sizes.machine, motion.rms(motion.tau))
        rise = values_of(self, "resistance", sizes.machine) * loss
        ambient = self.ambient.value if isinstance(self.ambient, Parameter) else self.ambient
        allowed = values_of(self, "limit", sizes.machine) - float(ambient)
        use = float(np.nanmax(rise / allowed)) if self.limit is not None else float("nan")
        return Contribution(nothing, use, f"steady rise {np.nanmax(rise):.3g} K if the motion is repeated")

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the states and limits."""
        fields, n = read_fields(self), machine.q.numel()
        resistance, capacity, limit = (fields.each(name, machine) for name in ("resistance", "capacity", "limit"))
        windings = [i for i in range(n) if resistance[i] is not None and capacity[i] is not None]
        heat = ca.vertcat(*map(ca.SX.sym, names_of(machine, "copper_loss")))
        cool = self.ambient.value if isinstance(self.ambient, Parameter) else float(self.ambient)
        states = {}
        for i in windings:
            name = f"winding_{machine.coordinates[i].name}"
            symbol = ca.SX.sym(name)
            rate = (heat[i] - (symbol - fields["ambient"]) / resistance[i]) / capacity[i]
            states[name] = State(symbol, rate, "K", cool if self.initial is None else float(self.initial))
        signals: dict[str, Quantity] = {}
        limits: dict[str, tuple[Side, Side]] = {}
        if windings:
            temperatures = ca.vertcat(*(state.symbol for state in states.values()))
            signals["winding"] = Quantity(temperatures, "K", tuple(states))
            bound = bounded("winding", temperatures, [limit[i] for i in windings], tuple(states), "K", both=False)
            signals, limits = {**signals, **bound.signals}, dict(bound.limits)
        read = Read("copper_loss", heat, f"{fields.prefix} (heated by the current of a motor)", "MotorDrive(...)")
        return Terms(
            states=states, signals=signals, limits=limits, reads=(read,),
            symbols=fields.symbols, nominal=fields.nominal, defines={"heat of the windings": fields.prefix},
        )  # fmt: skip
