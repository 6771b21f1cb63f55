"""Stiff effects in optimal control: the optimum goes to that of the limit, and what is not resolved is explained."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from hard_cases.case import Case, Figure
from models import cylindrical
from models.effects import Coulomb, ElasticDrive, Gravity, JointStop, LaggedDrive, MotorDrive
from models.forms import canonical
from models.mechanics.terms import Effect
from ocp import Ipopt, Solution, integrators, point_to_point, radau, simulate, solve, uniform, verify
from ocp.solution.state_scales import scales_of_states

LIMIT = [60.0, 800.0, 300.0]  # of the drives [N m, N, N]
ROTOR, RESISTANCE, FRICTION = 1.0, 0.5, 30.0  # [kg m^2 or kg], [ohm], [N] of the lift
MASS = cylindrical().nominal["m_2"] + cylindrical().nominal["m_3"]  # that the lift moves [kg]
SOLVED = 1e-6  # s of t_f, what the tolerance 1e-8 of the solver leaves
TRUE = 1e-2  # share of a drift to which two integrators must agree on it


def motion(effect: Effect, limited: str, limit: list[float], iterations: int = 400) -> Solution:
    """Return the time-optimal motion on 20 elements of radau(3), implicit and L-stable."""
    system = canonical(cylindrical(), [Gravity(), effect])
    task = point_to_point(system, [0.0, 0.0, 0.5], [1.0, 0.3, 0.8], **{limited: limit})  # type: ignore[arg-type]
    result: Solution = solve(task, radau(3), uniform(20), Ipopt(max_iter=iterations))
    return result


def lag(value: float) -> tuple[Solution, float]:
    """Return the motion with a lag [s] and what it may cost: each start, switch and stop some time constants."""
    return motion(LaggedDrive(value), "command", LIMIT), 10.0 * value


def inductance(value: float) -> tuple[Solution, float]:
    """Return the motion with motors of an electric time constant [s] and what that may cost."""
    return motion(MotorDrive(0.1, RESISTANCE, RESISTANCE * value, 100.0), "voltage", [48.0] * 3), 10.0 * value


def width(value: float) -> tuple[Solution, float]:
    """Return the motion with dry friction of a width [m/s] and the time in which friction takes ten widths away."""
    return motion(Coulomb((3.0, FRICTION, 10.0), value), "tau", LIMIT), 10.0 * value * MASS / FRICTION


def compliance(value: float) -> tuple[Solution, float]:
    """Return the motion with springs of 1 / value [N m/rad, N/m] and ten radians of their slowest swing."""
    return motion(ElasticDrive(1.0 / value, ROTOR), "motor_tau", LIMIT), 10.0 * math.sqrt(value * ROTOR)


def to_the_limit(make: Callable[[float], tuple[Solution, float]], values: list[float], last: float) -> Iterator[Figure]:
    """Yield how far t_f is from that of the most degenerate motion [s]."""
    reference, rest = make(last)
    for value in values:
        result, allowed = make(value)
        far = abs(result.duration - reference.duration) if result.ok and reference.ok else math.nan
        yield Figure(far, SOLVED + allowed + rest, value, note=result.message)


def honesty(make: Callable[[float], tuple[Solution, float]], values: list[float]) -> Iterator[Figure]:
    """Yield by which share the drift that `verify` reports differs from that of Radau IIA at another tolerance.

    A solution that is not verified must say why; one without a reason counts as 1.
    """
    for value in values:
        result, _ = make(value)
        report = verify(result)
        assert result.problem is not None
        system, nodes = result.problem.system, result.nodes
        again = simulate(system, result.states[0, 0], result, nodes, method=integrators.radau_5(1e-9, 1e-9))
        away = np.abs(again.x - result.x(nodes)) / scales_of_states(result, result.problem)[0]
        names = list(map(str, system.x.elements()))
        drift = float(np.max(away[:, names.index(report.drift.what)]))
        said = report.ok or (bool(report.failures) and all(report.failures))
        far = abs(drift - report.drift) / max(drift, 1e-9) if said else 1.0
        words = "verified" if report.ok else f"not verified: {report.failures[0]}"
        yield Figure(far, TRUE, value, note=words)


def explained(effect: Callable[[float], Effect], limited: str, values: list[float], most: int) -> Iterator[Figure]:
    """Yield 0 for motions that end, after so many iterations at most, verified or with a reason in words, else 1."""
    for k in values:
        result = motion(effect(k), limited, LIMIT, iterations=most)
        report = verify(result)
        words = "verified" if report.ok else f"{result.status.name.lower()}: {report.failures[0]}"
        said = (report.ok and result.ok) or (bool(report.failures) and bool(result.message))
        yield Figure(0.0 if said else 1.0, 0.0, 1.0 / k, note=words)


def beside(k: float) -> JointStop:
    """Return stops a tenth of a millimetre behind start and goal of the radial joint."""
    return JointStop((None, None, 0.4999), (None, None, 0.8001), stiffness=k, width=1e-5)


def _cases() -> Iterator[Case]:
    group, quantity = "stiff effects, optimal control", "t_f [s]"
    ways = {
        "lag": (lag, "time constant [s]", [10.0**-k for k in range(1, 8)], 1e-9),
        "motor": (inductance, "time constant L / R [s]", [10.0**-k for k in range(1, 8)], 1e-9),
        "dry friction": (width, "width [m/s, rad/s]", [10.0**-k for k in range(0, 7)], 1e-8),
        "elastic joint": (compliance, "1 / stiffness [m/N]", [10.0**-k for k in range(1, 8)], 1e-8),
    }
    for name, (make, towards, values, last) in ways.items():
        goes, fast = partial(to_the_limit, make, values, last), name in ("lag", "dry friction")
        yield Case(group, f"{name}: t_f goes to the limit", quantity, towards, goes, fast)
        true = partial(honesty, make, [values[0], values[3], values[-1]])
        yield Case(group, f"{name}: the drift reported is true", "drift, relative", towards, true, fast=False)
    stiff = [float(k) for k in 10.0 ** np.arange(3, 10, 2)]
    ends = partial(explained, beside, "tau", stiff, 30)
    yield Case(group, "rest beside a joint stop", "1 if unexplained", "1 / stiffness [m/N]", ends, fast=False)
    springs = partial(explained, lambda k: ElasticDrive(k, ROTOR), "motor_tau", [1e9], 200)
    yield Case(group, "elastic joint of 1e9", "1 if unexplained", "1 / stiffness [m/N]", springs, fast=False)


CASES: tuple[Case, ...] = tuple(_cases())
