"""Stiff effects in simulation, against solutions in closed form evaluated in extended precision."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from hard_cases.case import Case, Figure
from models import cylindrical
from models.effects import Coulomb, ElasticDrive, Gravity, JointStop, LaggedDrive, MotorDrive
from models.forms import canonical, lagrange
from ocp import System, integrators, simulate
from ocp.checks import Array
from ocp.integrators.contracts import Method

EPS = float(np.finfo(float).eps)
DIGITS = 60
MASS = cylindrical().nominal["m_2"] + cylindrical().nominal["m_3"]  # that the lift moves [kg]
ARM = cylindrical().nominal["m_3"]  # that moves along r [kg]
# The integrators and their tolerances: the default, implicit ones, explicit ones.
METHODS: dict[str, tuple[Method | None, float]] = {
    "the default": (None, 1e-12),
    "radau_5": (integrators.radau_5(1e-9, 1e-9), 1e-9),
    "bdf": (integrators.bdf(1e-9, 1e-9), 1e-9),
    "dormand_prince_8": (integrators.dormand_prince_8(1e-9, 1e-9), 1e-9),
}
STEPS = 1e3  # tolerances that add up to the error at the end, where nothing damps them


def lift(system: System, x0: dict[str, float], control: float, time: float, method: Method | None) -> tuple[Array, str]:
    """Return xi and its speed at the end of a motion of the lift alone, and the message."""
    start = [x0.get(name, 0.5 if name == "r" else 0.0) for name in map(str, system.x.elements())]
    motion = simulate(system, start, [0.0, control, 0.0], [time], method=method)
    return np.array([motion.signal("q")[0, 1], motion.signal("v")[0, 1]]), motion.message


def linear(
    matrix: Sequence[Sequence[float]], constant: Sequence[float], start: Sequence[float], time: float
) -> list[Any]:
    """Return x(time) of x' = A x + b from its exponential, in 60 digits."""
    import mpmath as mp  # type: ignore[import-untyped,import-not-found]

    n = len(start)
    with mp.workdps(DIGITS):
        rows = [[mp.mpf(a) * mp.mpf(time) for a in row] + [mp.mpf(b) * mp.mpf(time)] for row, b in zip(
            matrix, constant, strict=True)]  # fmt: skip
        grown = mp.expm(mp.matrix([*rows, [0] * (n + 1)])) * mp.matrix([*map(mp.mpf, start), 1])
        return [grown[i] for i in range(n)]


def coulomb(name: str) -> Iterator[Figure]:
    """Yield the error of a stop by dry friction, M v' = -f tanh(v / w), as the width w goes to 1e-6 m/s."""
    import mpmath as mp  # type: ignore[import-untyped,import-not-found]

    method, tolerance = METHODS[name]
    v0, f, time = 0.3, 30.0, 1.0
    for width in 10.0 ** -np.arange(0, 7):
        with mp.workdps(DIGITS):
            w, v_0 = mp.mpf(width), mp.mpf(v0)
            v = w * mp.asinh(mp.sinh(v_0 / w) * mp.exp(-mp.mpf(f) * time / (mp.mpf(MASS) * w)))
            points = [v, *(w * k for k in (1, 3, 10, 30, 100) if v < w * k < v_0), v_0]
            way = mp.mpf(MASS) / f * mp.quad(lambda s, w=w: s / mp.tanh(s / w), points)
            exact = np.array([float(way), float(v)])
        system = lagrange(cylindrical(), [Coulomb((0.0, f, 0.0), width)])
        result, message = lift(system, {"v_xi": v0}, 0.0, time, method)
        stiffness = 1.0 + f * time / (MASS * width)  # how often the fastest mode dies out
        yield Figure(float(np.max(np.abs(result - exact))), STEPS * tolerance, float(width), stiffness, message)


def elastic(name: str) -> Iterator[Figure]:
    """Yield the error of the lift behind a spring as its stiffness goes to 1e9 N/m.

    The swing of motor against load is not damped: errors add up over its radians, and methods that damp it are held
    to the mean motion alone.
    """
    method, tolerance = METHODS[name]
    rotor, force, time = 1.0, 400.0, 0.02
    for k in 10.0 ** np.arange(3, 10):
        rate = [[0, 0, 1, 0], [0, 0, 0, 1], [-k / MASS, k / MASS, 0, 0], [k / rotor, -k / rotor, 0, 0]]
        exact = linear(rate, [0, 0, 0, force / rotor], [0.1, 0.1, 0.0, 0.0], time)
        system = canonical(cylindrical(), [ElasticDrive((None, k, None), (None, rotor, None))])
        result, message = lift(system, {"xi": 0.1, "motor_q_xi": 0.1}, force, time, method)
        radians = 1.0 + math.sqrt(k * (1.0 / MASS + 1.0 / rotor)) * time
        # f itself is uncertain by eps k |q| / rotor, which the swing turns into eps |q| for each of its radians.
        allowed = STEPS * tolerance * radians + 1e2 * EPS * radians
        yield Figure(abs(float(exact[0] - result[0])), allowed, 1.0 / k, radians, message)


def lagged(name: str) -> Iterator[Figure]:
    """Yield the error of the lift behind a lag as its time constant goes to 1e-6 s."""
    method, tolerance = METHODS[name]
    force, time = 400.0, 1.0
    for lag in 10.0 ** -np.arange(0, 7):
        rate: list[list[float]] = [[0, 1, 0], [0, 0, 1 / MASS], [0, 0, -1 / lag]]
        exact = linear(rate, [0, 0, force / lag], [0.0, 0.0, -100.0], time)
        system = canonical(cylindrical(), [LaggedDrive((None, lag, None))])
        result, message = lift(system, {"drive_tau_xi": -100.0}, force, time, method)
        far = max(abs(float(e - a)) for e, a in zip(exact, result, strict=False))
        yield Figure(far, STEPS * tolerance * force / MASS, float(lag), 1.0 + time / lag, message)


def motor(name: str) -> Iterator[Figure]:
    """Yield the error of the lift driven by a motor as its electric time constant L / R goes to 1e-6 s."""
    method, tolerance = METHODS[name]
    constant, resistance, ratio, voltage, time = 0.1, 0.5, 100.0, 48.0, 1.0
    gain = constant * ratio
    for tau in 10.0 ** -np.arange(0, 7):
        inductance = tau * resistance
        rate: list[list[float]] = [[0, 1, 0], [0, 0, gain / MASS], [0, -gain / inductance, -resistance / inductance]]
        exact = linear(rate, [0, 0, voltage / inductance], [0.0, 0.0, 0.0], time)
        drive = MotorDrive((None, constant, None), (None, resistance, None), (None, inductance, None), ratio)
        result, message = lift(canonical(cylindrical(), [drive]), {}, voltage, time, method)
        far = max(abs(float(e - a)) for e, a in zip(exact, result, strict=False))
        # The current is known to a tolerance of its size, 96 A, and moves the lift with gain / M for each.
        allowed = STEPS * tolerance * voltage / resistance * gain / MASS
        yield Figure(far, allowed, float(tau), 1.0 + time / tau, message)


def stop(name: str) -> Iterator[Figure]:
    """Yield the error of the speed after a stop was hit at 2 m/s, as its stiffness goes to 1e9 N/m.

    Behind the stop m v dv = -k e (1 + d v) de: whatever k, d v - ln(1 + d v) is the same before and after. Smoothing
    over a millionth of the way into the stop changes the speed by about that share.
    """
    import mpmath as mp  # type: ignore[import-untyped,import-not-found]

    method, tolerance = METHODS[name]
    speed, damping, way = 2.0, 0.3, 0.02
    with mp.workdps(DIGITS):
        d, v = mp.mpf(damping), mp.mpf(speed)
        after = float(mp.findroot(lambda s: d * s - mp.log(1 + d * s) - d * v + mp.log(1 + d * v), -0.7 * v))
    for k in 10.0 ** np.arange(3, 10):
        depth = speed * math.sqrt(ARM / k)
        effect = JointStop(upper=(None, None, 0.5 + way), stiffness=k, damping=damping, width=1e-6 * depth)
        begun = [0.0, 0.0, 0.5, 0.0, 0.0, speed]
        time = way / speed + math.pi * math.sqrt(ARM / k) * 1.2 + way / abs(after)
        motion = simulate(lagrange(cylindrical(A=0.0), [effect]), begun, np.zeros(3), [time], method=method)
        # The time of a step is lost or won against that of the contact, in which the speed turns around.
        allowed = (STEPS * tolerance + 1e-5) * speed
        result = float(motion.signal("v")[0, 2])
        yield Figure(abs(result - after), allowed, 1.0 / k, 1.0 + speed / depth * time, motion.message)


def sticking() -> Iterator[Figure]:
    """Yield how far the default is from Radau IIA where joints slide, stick and creep, as the width goes to 0."""
    for width in 10.0 ** -np.arange(0, 7):
        system = lagrange(cylindrical(), [Gravity(), Coulomb((5.0, 10.0, 10.0), width)])
        ends = [
            simulate(system, [0.0, 0.0, 0.5, 1.0, 0.3, -0.2], np.zeros(3), [0.5], method=method).x[0]
            for method in (None, integrators.radau_5(1e-11, 1e-12))
        ]
        yield Figure(float(np.max(np.abs(ends[0] - ends[1]))), STEPS * 1e-11, float(width))


def words_of_explicit_steps() -> Iterator[Figure]:
    """Yield 0 if explicit steps that are too long for the lag say so and name what to use instead, else 1."""
    for lag in 10.0 ** -np.arange(4, 11):
        system = canonical(cylindrical(), [LaggedDrive((None, lag, None))])
        _, message = lift(system, {"drive_tau_xi": -100.0}, 400.0, 1.0, integrators.runge_kutta_4(1e2 * lag))
        said = "stiff" in message and "radau" in message
        yield Figure(0.0 if said else 1.0, 0.0, float(lag), note=message)


def _cases() -> Iterator[Case]:
    group = "stiff effects, simulation"
    effects: dict[str, tuple[str, str, Callable[[str], Iterator[Figure]]]] = {
        "dry friction": ("way and speed [m, m/s]", "width [m/s]", coulomb),
        "elastic joint": ("position of the load [m]", "1 / stiffness [m/N]", elastic),
        "lag": ("way and speed [m, m/s]", "time constant [s]", lagged),
        "motor": ("way and speed [m, m/s]", "time constant [s]", motor),
        "joint stop at speed": ("speed after the stop [m/s]", "1 / stiffness [m/N]", stop),
    }
    for effect, (quantity, towards, measure) in effects.items():
        for name in METHODS:
            yield Case(group, f"{effect}, {name}", quantity, towards, partial(measure, name), name == "the default")
    yield Case(group, "joints that stick, the default", "states [SI]", "width [m/s, rad/s]", sticking)
    yield Case(
        group, "explicit steps too long are explained", "1 for silence", "time constant [s]", words_of_explicit_steps
    )


CASES: tuple[Case, ...] = tuple(_cases())
