"""What effects mean for a solved motion: those that are on, and those that have been left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from models.effects import (
    Coulomb,
    ElasticDrive,
    Gravity,
    LaggedDrive,
    MotorDrive,
    Payload,
    PowerLimit,
    RotorInertia,
    Stribeck,
    ToolForce,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect, name_of
from models.torques.linear_response import lag, oscillation
from models.torques.torque_functions import inverse_dynamics, recover
from ocp import checks
from ocp.checks import Array
from ocp.system import System

PLACES = np.linspace(0.0, 1.0, 9)  # on each element of the solution


class Solved(Protocol):
    """What is asked of a solution."""

    @property
    def values(self) -> Mapping[str, float]:
        """Parameter values by name."""

    def samples(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """Return t (K,), x (K, nx), dx/dt (K, nx), u (K, nu) at places tau of every element."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What one effect means for each drive of a motion."""

    name: str
    on: bool  # whether the motion was solved with it
    effect: Effect
    peak: Array  # (n,) largest torque that it adds or takes [N m or N]
    rms: Array  # (n,) root of the mean square over the motion [N m or N]
    share: Array  # (n,) peak over the largest torque of each drive in the motion
    use: float  # largest share of its limit that the motion uses; NaN if it is no limit
    note: str

    def __str__(self) -> str:
        shares = " ".join(f"{100.0 * value:7.2f}" for value in self.share)
        use = "" if np.isnan(self.use) else f"  uses {100.0 * self.use:.0f} % of the limit"
        return f"{self.name:16s} {'on ' if self.on else 'off'} {shares} % of peak torque{use}  {self.note}".rstrip()


@dataclass(frozen=True, eq=False)
class Course:
    """A motion with its torques at many times."""

    t: Array  # (K,)
    q: Array  # (n, K)
    v: Array
    a: Array
    tau: Array
    values: Mapping[str, float]

    def rms(self, values: Array) -> Array:
        """Return the root of the mean square over time (n,) of values (n, K)."""
        return np.asarray(np.sqrt(np.trapezoid(values**2, self.t) / max(self.t[-1] - self.t[0], 1e-300)))


def estimate(
    system: System,
    machine: Manipulator,
    effects: Sequence[Effect],
    solution: Solved,
    candidates: Sequence[Effect] | None = None,
) -> tuple[Estimate, ...]:
    """Estimate what every effect that is on, and every one that is off, contributes to the torque of each drive.

    Along q(t) of the solution, without solving again. Effects on the joints (gravity, loads, friction, rotors, tool
    forces): tau with the effect less tau without it, by inverse dynamics; exact for this motion. Lags and electric
    motors: the torque less the torque behind the lag (T, or L / R). Elastic joints: the torque less that in a spring
    with the rotor before it, an undamped oscillator sqrt(k / J). Limits: the largest share of the limit; heat: the
    steady rise at the mean loss over the allowed rise. What is off is added to what is on, one by one; in the other
    direction drives are judged as they are.

    Args:
        system: a form of the machine with these effects, that of the solution.
        machine: the machine.
        effects: those that are on.
        solution: of a problem on the system.
        candidates: effects that are off; None for `typical` ones of every family that is not on.

    Returns:
        First those that are on, then those that are off, in the order of their largest share.

    Raises:
        TypeError, ValueError: as `inverse_dynamics`.
    """
    checks.instance("system", system, System, "a System, a form of the machine")
    if isinstance(solution, type) or not (hasattr(solution, "values") and hasattr(solution, "samples")):
        raise TypeError(f"solution: got {checks.shown(solution)}, expected a Solution")
    if candidates is not None:
        checks.instance("candidates", candidates, list | tuple, "a list of effects, or None")
        for candidate in candidates:
            if isinstance(candidate, type) or not callable(candidate):
                raise TypeError(f"candidates: got {checks.shown(candidate)}, expected an effect such as Gravity()")
    t, x, rate, _ = solution.samples(PLACES)
    values = dict(solution.values)
    p = np.array([values.get(name, value) for name, value in system.nominal.items()])[:, None]
    result = recover(system, machine, effects).map(len(t))(x.T, rate.T, np.tile(p, len(t)))
    q, v, a, tau = (np.array(part) for part in result)
    course = Course(t, q, v, a, tau, values)
    if candidates is None:
        known = {type(effect) for effect in effects}
        dry = known & {Coulomb, Stribeck}
        drives = known & {LaggedDrive, MotorDrive}
        off = [
            effect
            for effect in typical(machine, course.tau, course.v)
            if type(effect) not in known
            and not (dry and type(effect) in (Coulomb, Stribeck))
            and not (drives and type(effect) in (LaggedDrive, MotorDrive))
            and not (ElasticDrive in known and isinstance(effect, RotorInertia))
        ]
    else:
        off = list(candidates)
    motors = [effect for effect in (*effects, *off) if isinstance(effect, MotorDrive)]
    rows = []
    for on, listed in ((True, effects), (False, off)):
        judged = [_judged(machine, effects, effect, on, course, motors) for effect in listed]
        rows += sorted(judged, key=lambda row: -float(np.max(np.nan_to_num(row.share))))
    return tuple(rows)


def typical(machine: Manipulator, tau: Array, v: Array) -> tuple[Effect, ...]:
    """Return effects with parameters of the usual size for a motion, to judge what has been left out.

    Gravity 9.81 m/s^2; payload a tenth of the mass of the machine; viscous friction that takes 5 % of the peak torque
    at the peak speed; Coulomb friction 5 % of the peak torque, Stribeck with a breakaway of 7.5 %; rotors of
    1e-4 kg m^2 with a ratio of 100 (300 rad/m); a lag of 5 ms; joints of 1e5 N m/rad (1e6 N/m) with those rotors;
    motors with L / R = 2 ms; a tool force of 50 N downwards; torque-speed limits of twice the peak torque and speed;
    a supply of 2 kW; windings whose temperature may rise by 100 K. Stops and counterbalances depend on the build of
    the machine and have no usual size.

    Args:
        machine: whose drives they are for.
        tau: (n, K) torques of the motion [N m or N].
        v: (n, K) velocities [rad/s or m/s].
    """
    angular = [c.unit == "rad" for c in machine.coordinates]
    torque = [float(value) or 1.0 for value in np.max(np.abs(tau), axis=1)]
    speed = [float(value) or 1.0 for value in np.max(np.abs(v), axis=1)]
    mass = float(sum(machine.nominal[name] for name in machine.nominal if name.startswith("m_")))
    ratio = tuple(100.0 if turns else 300.0 for turns in angular)
    reflected = tuple(1e-4 * n**2 for n in ratio)
    # Sized so that the peak torque takes 10 A, with 4 V at the winding for it.
    constants = tuple(peak / (10.0 * n) for peak, n in zip(torque, ratio, strict=True))
    return (
        Gravity(),
        Payload(0.1 * mass),
        Viscous(tuple(0.05 * f / w for f, w in zip(torque, speed, strict=True))),
        Coulomb(tuple(0.05 * f for f in torque)),
        Stribeck(tuple(0.05 * f for f in torque), tuple(0.075 * f for f in torque)),
        RotorInertia(1e-4, ratio),
        LaggedDrive(5e-3),
        ElasticDrive(tuple(1e5 if turns else 1e6 for turns in angular), reflected),
        MotorDrive(constants, 0.4, 0.8e-3, ratio),
        ToolForce((0.0, 0.0, -50.0)),
        TorqueSpeed(tuple(2.0 * f for f in torque), tuple(2.0 * w for w in speed)),
        PowerLimit(2000.0),
        WindingHeat(2.0, 500.0, 393.15),
    )


def _judged(
    machine: Manipulator, effects: Sequence[Effect], effect: Effect, on: bool, course: Course, motors: list[MotorDrive]
) -> Estimate:
    others = [other for other in effects if other is not effect]
    use, note = float("nan"), ""
    added = np.zeros_like(course.tau)
    if isinstance(effect, LaggedDrive):
        added, note = lag(course.t, course.tau, _column(effect, machine, "time_constant")), "torque behind its command"
    elif isinstance(effect, MotorDrive):
        constants = _column(effect, machine, "inductance") / _column(effect, machine, "resistance")
        added, note = lag(course.t, course.tau, constants), "torque behind its command, by L / R"
    elif isinstance(effect, ElasticDrive):
        frequency = np.sqrt(_column(effect, machine, "stiffness") / _column(effect, machine, "inertia"))
        added, note = oscillation(course.t, course.tau, frequency), "torque that swings in the joints"
    elif isinstance(effect, WindingHeat):
        use, note = _heating(machine, effect, course, motors)
    elif isinstance(effect, TorqueSpeed | PowerLimit):
        use = _limit_use(machine, effect, course)
    else:
        rest = _without_drives(others if on else effects)
        more, less = _torque(machine, [*rest, effect], course), _torque(machine, rest, course)
        added = more - less
    peak = np.max(np.abs(added), axis=1)
    largest = np.maximum(np.max(np.abs(course.tau), axis=1), 1e-300)
    return Estimate(name_of(effect), on, effect, peak, course.rms(added), peak / largest, use, note)


def _without_drives(effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects that act on the joints: what reads motors cannot stand alone."""
    drives = (LaggedDrive, MotorDrive, ElasticDrive, WindingHeat, TorqueSpeed, PowerLimit)
    return [effect for effect in effects if not isinstance(effect, drives)]


def _torque(machine: Manipulator, effects: Sequence[Effect], course: Course) -> Array:
    function, names = inverse_dynamics(machine, effects), assemble(machine, effects)
    nominal = {**machine.nominal, **names.terms.nominal}
    p = np.array([[course.values.get(name, nominal[name])] for name in names.parameters]).reshape(-1, 1)
    inputs = [course.q, course.v, course.a, np.tile(p, len(course.t))]
    if function.n_in() == 5:
        inputs.append(course.t[None, :])
    return np.array(function.map(len(course.t))(*inputs))


def _limit_use(machine: Manipulator, effect: TorqueSpeed | PowerLimit, course: Course) -> float:
    terms = effect(machine, assemble(machine, ()).terms)
    used = 0.0  # a side of zero has no share
    symbols: dict[str, ca.SX] = {read.name: read.symbol for read in terms.reads}
    names = list(terms.symbols)
    p = np.array([course.values.get(name, terms.nominal[name]) for name in names])[:, None]
    for name, (lower, upper) in terms.limits.items():
        inputs = [symbols["motor_tau"], symbols["motor_v"], ca.vertcat(*terms.symbols.values())]
        function = ca.Function("signal", inputs, [terms.signals[name].expression])
        signal = np.array(function.map(len(course.t))(course.tau, course.v, np.tile(p, len(course.t))))
        for sign, side in ((-1.0, lower), (1.0, upper)):
            if side is not None and np.all(np.asarray(side) != 0.0):
                used = max(used, float(np.max(sign * signal / np.abs(np.broadcast_to(side, len(signal)))[:, None])))
    return used


def _heating(machine: Manipulator, effect: WindingHeat, course: Course, motors: list[MotorDrive]) -> tuple[float, str]:
    if not motors:
        return float("nan"), "needs a MotorDrive"
    motor = motors[0]
    gain = _column(motor, machine, "constant") * _column(motor, machine, "ratio")
    loss = _column(motor, machine, "resistance") * course.rms(course.tau) ** 2 / gain**2
    rise = _column(effect, machine, "resistance") * loss
    ambient = effect.ambient.value if isinstance(effect.ambient, Parameter) else effect.ambient
    allowed = _column(effect, machine, "limit") - float(ambient)
    use = float(np.nanmax(rise / allowed)) if effect.limit is not None else float("nan")
    return use, f"steady rise {np.nanmax(rise):.3g} K if the motion is repeated"


def _column(effect: Effect, machine: Manipulator, name: str) -> Array:
    """Return a field for every drive, NaN where a drive has none."""
    value = getattr(effect, name)
    several = value if isinstance(value, Sequence) else (value,) * len(machine.coordinates)
    numbers = [item.value if isinstance(item, Parameter) else item for item in several]
    return np.array([np.nan if item is None else float(item) for item in numbers])
