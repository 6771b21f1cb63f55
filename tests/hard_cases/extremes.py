"""Extremes of optimal control: tiny and huge motions and limits, bare balance, odd grids, no way at all."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from models import cylindrical, spherical
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Bolza,
    Fixed,
    Free,
    Grid,
    Ipopt,
    Problem,
    Solution,
    System,
    along,
    end,
    point_to_point,
    polish,
    solve,
    start,
    uniform,
    verify,
)

GRID = uniform(20)
MASS, WEIGHT = 65.0, 65.0 * 9.81  # lifted by the cylindrical machine
AHEAD = (150.0, 300.0)  # limits of its other drives
GRADED = Grid(np.append(1.0 - 10.0 ** -np.linspace(0.0, 9.0, 37), 1.0))
# A limit leaves at most the tolerance of complementarity, 1e-9 of a cost of 8: 20 elements with at most 10 limits, the
# last of them met to a tenth.
LEFT = 20 * 10 * 1e-9
GAIN = 2e-2  # that the verification lets the controls leave, share of the cost
# A polished motion is solved to 1e-10: 32 elements of six points, two limits.
POLISHED = 32 * 6 * 2 * 1e-10


def carriage(mass: float = 1.0, weight: float = 0.0) -> System:
    """Return a mass on a line, x'' = (u - weight) / mass."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    signals = {"q": x[0], "v": x[1], "tau": u}
    return System(x, u, ca.SX(0, 1), ca.vertcat(x[1], (u - weight) / mass), signals, {})


def shortest(way: float, limit: float, mass: float = 1.0, weight: float = 0.0) -> float:
    """Return the least time from rest to rest on a line: full force, then full force the other way."""
    rise, brake = (limit - weight) / mass, (limit + weight) / mass
    return float(np.sqrt(2.0 * way * (rise + brake) / (rise * brake)))


def lift(way: float, force: float, others: tuple[float, float] = AHEAD, horizon: Free | None = None) -> Problem:
    """Return the task of the cylindrical machine that lifts its carriage, the other axes at rest."""
    system = canonical(cylindrical(), [Gravity()])
    drives = (others[0], force, others[1])
    return point_to_point(system, [0.0, 0.2, 0.6], [0.0, 0.2 + way, 0.6], tau=drives, horizon=horizon)


def sound(solution: Solution) -> str:
    """Return what is wrong with the way a solve ended: no number, or no reason; empty if nothing is."""
    numbers = (solution.duration, solution.states, solution.controls, solution.costates)
    if not all(np.all(np.isfinite(part)) for part in numbers):
        return f"not a number: {solution.message}"
    report = verify(solution)
    if report.ok or any(len(words.split()) > 4 for words in report.failures):
        return ""
    return f"no reason: {solution.message}"


def ended(solution: Solution, distance: float, optimum: float | None = None) -> Figure:
    """Return whether a solve ended verified, or with numbers and a reason; never verified far from the optimum.

    Args:
        solution: of any status.
        distance: from the degeneracy.
        optimum: least duration, inf where there is no motion; None if it is not known.
    """
    wrong, report = sound(solution), verify(solution)
    if report.ok and optimum is not None and not abs(solution.duration / optimum - 1.0) <= GAIN:
        wrong = f"verified, {solution.duration:g} s instead of {optimum:g} s"
    words = "verified" if report.ok else "; ".join(report.failures)
    return Figure(float(bool(wrong)), 0.0, distance, note=wrong or f"{solution.message} [{words}]")


def exact(solution: Solution, optimum: float, tolerance: float, distance: float) -> Iterable[Figure]:
    """Yield the relative error of the duration of a solution that must be verified."""
    report = verify(solution)
    words = f"{solution.message} [{'; '.join(report.failures) or 'verified'}]"
    error = solution.duration / optimum - 1.0 if report.ok else np.nan
    yield Figure(error, tolerance, distance, note=words)


def _coincide() -> Iterable[Figure]:
    for position in (0.0, 1e-6, 1.0, 1e6):
        result = solve(point_to_point(carriage(), [position], [position], tau=1.0), grid=GRID)
        yield Figure(result.duration, 0.0, position, note=result.message)
        yield Figure(float("start and goal coincide" not in result.message or not verify(result).ok), 0.0, position)
    for lower in (0.0, 1e-6, 1e-3, 0.05, 10.0):
        result = solve(lift(0.0, 900.0, horizon=Free(max(lower, 1.0), lower=lower)), grid=GRID)
        yield Figure(abs(result.duration - lower), LEFT * max(lower, 1.0), lower, note=result.message)
        said = "lower limit" in result.message and verify(result).ok
        yield Figure(float(not said), 0.0, lower, note="; ".join(verify(result).failures))


def _ways() -> Iterable[Figure]:
    for way in 10.0 ** np.arange(-9.0, 4.0, 2.0):
        yield from exact(
            solve(point_to_point(carriage(), [0.0], [way], tau=1.0), grid=GRID), shortest(way, 1.0), LEFT, way
        )
    for way in 10.0 ** np.arange(-9.0, 0.0, 3.0):  # beside a position of one: rounding is a share of that
        target = (1.0 + way) - 1.0
        result = solve(point_to_point(carriage(), [1.0], [1.0 + way], tau=1.0), grid=GRID)
        yield from exact(result, shortest(target, 1.0), LEFT + 1e3 * np.finfo(float).eps / way, way)


def _turns() -> Iterable[Figure]:
    """Spin of the spherical arm about its own axis, held horizontally: no other coordinate moves."""
    system, inertia, torque = canonical(spherical()), 0.05, 3.0
    for turns in (1e-9 / (2.0 * np.pi), 1e-7, 1e-4, 1e-2, 1.0, 30.0, 1e3):
        way = 2.0 * np.pi * turns
        rest = [np.pi / 2.0, 0.0, 0.0, 0.85]
        task = point_to_point(system, rest, [*rest[:2], way, 0.85], tau=[260.0, 160.0, torque, 400.0])
        yield from exact(solve(task, grid=GRID), shortest(way, torque, inertia), LEFT, turns)


def _winding() -> Iterable[Figure]:
    """Turns of the cylindrical arm: an open-loop radial motion grows with the exponential of the angle."""
    for turns in (1e-3, 1e-1, 1.0, 3.0, 10.0):
        system = canonical(cylindrical(), [Gravity()])
        goal = [2.0 * np.pi * turns, 0.2, 0.6]
        result = solve(point_to_point(system, [0.0, 0.2, 0.6], goal, tau=[150.0, 900.0, 300.0]), grid=GRID)
        report = verify(result)
        words = "; ".join(report.failures)
        growth = float(np.exp(2.0 * np.pi * turns))
        yield Figure(float(not report.ok), 0.0, turns, growth, note=words or "verified")


def _balance() -> Iterable[Figure]:
    """The braking arc is about half the excess of the motion: a graded grid resolves it, a uniform one does not."""
    for excess in 10.0 ** -np.arange(1.0, 7.0):
        force = WEIGHT * (1.0 + excess)
        optimum = shortest(0.6, force, MASS, WEIGHT)
        task = point_to_point(carriage(MASS, WEIGHT), [0.0], [0.6], tau=force)
        graded = solve(task, grid=GRADED)
        # The least acceleration is a difference of forces, and so is its rounding.
        yield from exact(polish(graded), optimum, POLISHED + 1e3 * np.finfo(float).eps / excess, excess)
        whole = solve(lift(0.6, force), grid=GRADED)
        # The switch lies in an element that is narrower than the excess, and costs at most its width.
        yield from exact(whole, optimum, excess, excess)
        yield ended(solve(task, grid=GRID), excess, optimum)


def _weaker() -> Iterable[Figure]:
    for excess in (0.0, -1e-9, -1e-6, -1e-3):
        result = solve(lift(0.6, WEIGHT * (1.0 + excess)), grid=uniform(5), solver=Ipopt(max_iter=100))
        named = excess > -1e-8 or "cannot hold the start" in result.message
        yield Figure(float(not named), 0.0, abs(excess), note=result.message)
        yield ended(result, abs(excess), np.inf)


def _limits() -> Iterable[Figure]:
    for limit in 10.0 ** np.arange(-9.0, 10.0, 3.0):
        result = solve(point_to_point(carriage(), [0.0], [1.0], tau=limit), grid=GRID)
        yield from exact(result, shortest(1.0, limit), LEFT, limit)
    for limit in 10.0 ** np.arange(3.0, 10.0, 3.0):
        for task in (
            point_to_point(carriage(), [0.0], [1.0], tau=1.0, q=limit),
            point_to_point(carriage(), [0.0], [1.0], tau=1.0, v=limit),
        ):
            yield from exact(solve(task, grid=GRID), 2.0, LEFT, limit)
    boundless = point_to_point(carriage(), [0.0], [1.0], tau=1.0, q=np.inf, v=np.inf)
    yield from exact(solve(boundless, grid=GRID), 2.0, LEFT, np.inf)


def _idle() -> Iterable[Figure]:
    """One drive with a limit far from all others, its axis at rest: the lift decides."""
    optimum = shortest(0.6, 900.0, MASS, WEIGHT)
    for limit in (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9):
        result = solve(lift(0.6, 900.0, (limit, 300.0)), grid=GRID)
        # One switch inside an element of width h costs at most h^2 / 4 of the time, times the ratio of accelerations.
        yield from exact(result, optimum, (1.0 / len(GRID)) ** 2 * (900.0 + WEIGHT) / (900.0 - WEIGHT), limit)


def _effort() -> Iterable[Figure]:
    """Least effort, u = 6 - 12 t, integral of u^2 = 12; with no limits, and with limits far beyond."""
    for limit in (10.0, 1e3, 1e6, 1e9, np.inf):
        system = carriage()
        task = point_to_point(
            system, [0.0], [1.0], tau=limit, horizon=Fixed(1.0), minimise=Bolza(running=system["tau"] ** 2)
        )
        result = solve(task, grid=uniform(40))
        # Constants on n elements in place of a line cost 12 / n^2 more.
        report = verify(result)
        error = result.cost - 12.0 * (1.0 + 1.0 / 40**2) if report.ok else np.nan
        yield Figure(error, 12.0 * 0.1 / 40**2, limit, note="; ".join(report.failures))


def _powerless() -> Iterable[Figure]:
    """A drive without authority: at rest, in the way of the motion, and needed."""
    lifted = shortest(0.6, 900.0, MASS, WEIGHT)
    for task, words, optimum in (
        (lift(0.6, 0.0), "the drive that lifts", np.inf),
        (lift(0.6, 900.0, (0.0, 300.0)), "a drive at rest", lifted),
        (lift(0.6, 900.0, (0.0, 0.0)), "all others at rest", lifted),
        (point_to_point(carriage(), [0.0], [1.0], tau=0.0), "the only one", np.inf),
    ):
        result = solve(task, grid=uniform(10), solver=Ipopt(max_iter=100))
        figure = ended(result, 0.0, optimum)
        yield Figure(figure.value, 0.0, 0.0, note=f"{words}: {figure.note}")


def _at_limits() -> Iterable[Figure]:
    yield from exact(
        solve(point_to_point(carriage(), [0.0], [1.0], tau=1.0, q=([0.0], [1.0])), grid=GRID), 2.0, LEFT, 0.0
    )
    system = carriage()
    moving = (start(system["q"], 0.0), start(system["v"], 1.0), end(system["q"], 1.0), end(system["v"], 0.0))
    for slack in (0.0, 1e-9, 1e-6, 1e-3, 1.0):
        held = (along(system["tau"], -1.0, 1.0), along(system["v"], -(1.0 + slack), 1.0 + slack))
        result = solve(Problem(system, Free(), Bolza(time=1.0), (*moving, *held)), grid=GRID)
        # Speed 1 for a time, then the brake: 0.5 + 1 s; faster first if the limit allows: 2 sqrt(1.5) - 1 without one.
        top = min(1.0 + slack, np.sqrt(1.5))
        optimum = (top - 1.0) + (1.0 - (top**2 - 1.0) / 2.0 - top**2 / 2.0) / top + top
        # Two switches inside elements.
        yield from exact(result, optimum, 2.0 / len(GRID) ** 2, slack)


CASES: tuple[Case, ...] = (
    Case("extremes", "start and goal coincide", "duration [s]", "position, lower limit", _coincide),
    Case("extremes", "ways from 1e-9 to 1e3", "t_f, relative", "way", _ways),
    Case("extremes", "1e-9 rad to 1e3 turns", "t_f, relative", "turns", _turns),
    Case(
        "extremes", "turns of an arm that centrifugal forces carry outwards", "verified", "turns", _winding, fast=False,
        outside="open-loop motions grow with e^angle; after a turn re-integration cannot confirm them, and says so",
    ),
    Case("extremes", "limits from 1e-9 to 1e9 and none", "t_f, relative", "limit", _limits),
    Case("extremes", "a drive at rest with limits from 1e-9 to 1e9", "t_f, relative", "limit", _idle),
    Case("extremes", "effort within limits that are none", "cost", "limit", _effort),
    Case("extremes", "torque barely above the weight", "t_f, relative", "excess of torque", _balance, fast=False),
    Case("extremes", "torque barely below the weight", "named", "lack of torque", _weaker, fast=False),
    Case("extremes", "drives without authority", "verified or named", "", _powerless, fast=False),
    Case("extremes", "start on a limit", "t_f, relative", "slack", _at_limits),
)  # fmt: skip
