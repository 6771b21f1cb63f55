"""Through the pole theta = 0 of the spherical machine: simulated at speed, and as the best path of a motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from models import spherical
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from ocp import (
    Ipopt,
    Problem,
    Smooth,
    Solution,
    integrators,
    point_to_point,
    polish,
    radau,
    simulate,
    solve,
    uniform,
    verify,
)
from ocp.checks import Array
from ocp.integrators.contracts import Method
from ocp.integrators.simulation import Trajectory
from ocp.system import System

FORMS = (lagrange, hamel, canonical)
TOLERANCE = 1e-9  # of one step
Q0, V0 = np.array([0.3, 0.1, 0.2, 0.8]), np.array([-2.0, 1.0, 0.5, 0.1])  # theta = 0 after 0.16 s
END = 0.3  # [s]

# The turn of psi is worth its time near the pole only, where its inertia is least.
FROM, TO = [0.64, 0.0, 0.0, 0.8], [-0.26, 1.73, -2.0, 0.85]
WITHIN = ([-1.2, -4.0, -4.0, 0.2], [1.2, 4.0, 4.0, 2.0])
DRIVES = [160.0, 30.0, 3.0, 180.0]
# The same, but both ends on one side: the best path visits the other one.
ROUND = [0.6, 3.0, -3.0, 0.8]


def system_of(form: object, frame: str, axial: float = 1.0) -> tuple[System, Array]:
    """Return a form of the machine with C multiplied by `axial`, and the state of the same motion in it.

    psi' is given by its momentum, which stays the same, so that its speed at the pole grows like 1 / C.
    """
    machine = spherical(Theta_1_33=2.5 * axial, Theta_2_33=0.9 * axial, physical=False)
    system: System = form(machine, [Gravity()], frame)  # type: ignore[operator]
    basis = machine.frame(frame)
    third = machine.v if form is lagrange else basis.matrix @ machine.v
    third = basis.metric @ third if form is canonical else third
    start = ca.Function("start", [machine.q, machine.v], [ca.densify(third)])
    speed = V0.copy()
    speed[1] *= np.sqrt(axial)  # C psi'^2 at the pole stays about the same
    return system, np.append(Q0, np.array(start(Q0, speed)).ravel())


def moved(form: object, frame: str, method: Method, axial: float = 1.0, scale: float = 1.0) -> Trajectory:
    """Return the motion through the pole, its initial state multiplied by `scale`."""
    system, x0 = system_of(form, frame, axial)
    return simulate(system, x0 * scale, np.zeros(4), [END], method=method)


def coordinates(trajectory: Trajectory) -> Array:
    """Return q and v at the end."""
    return np.concatenate([trajectory.signal("q")[-1], trajectory.signal("v")[-1]])


def through(form: object) -> Iterator[Figure]:
    """Yield the error behind the pole, another form at 1e-13 as reference, while C / D falls from one to 1e-8.

    Each step may err by the tolerance, and the flow multiplies that by its condition number.
    """
    other = canonical if form is lagrange else lagrange
    for axial in (10.0**-k for k in range(9)):
        exact = coordinates(moved(other, "regular", integrators.extrapolation(1e-13, 1e-13), axial))
        near = coordinates(moved(other, "regular", integrators.extrapolation(1e-13, 1e-13), axial, 1.0 + 1e-7))
        got = moved(form, "regular", integrators.dormand_prince_8(TOLERANCE, TOLERANCE), axial)
        size = np.max(np.abs(exact))
        condition = max(1.0, float(np.max(np.abs(near - exact))) / size / 1e-7)
        steps = got.evaluations / 12.0
        error = float(np.max(np.abs(coordinates(got) - exact))) / size
        note = f"{got.evaluations} evaluations{'; ' + got.message if got.message else ''}"
        yield Figure(error, TOLERANCE * steps * condition, axial, condition, note)


METHODS: tuple[Method, ...] = (
    integrators.dormand_prince_8(TOLERANCE, TOLERANCE),
    integrators.radau_5(1e-6, 1e-6),
    integrators.adams(TOLERANCE, TOLERANCE),
    integrators.extrapolation(TOLERANCE, TOLERANCE),
    integrators.runge_kutta_4(1e-2),
)


def refused() -> Iterator[Figure]:
    """Yield 0 where a motion through the pole in the frame of the paper ends with a sentence, 1 where it does not."""
    for form in FORMS:
        for method in METHODS:
            got = moved(form, "paper", method)
            named = not got.ok and "sin(theta) is 0; use frame='regular'" in got.message
            clean = bool(np.all(np.isnan(got.x)))
            yield Figure(0.0 if named and clean else 1.0, 0.0, note=f"{form.__name__}: {got.message}")


def unwatched() -> Iterator[Figure]:
    """Yield how far the frame of the paper misses its tolerance where nobody watches the singularity."""
    exact = coordinates(moved(lagrange, "regular", integrators.extrapolation(1e-13, 1e-13)))
    for form in FORMS:
        system, x0 = system_of(form, "paper")
        for method in METHODS[:3]:
            blind = simulate(replace(system, singular=()), x0, np.zeros(4), [END], method=method)
            error = float(np.max(np.abs(coordinates(blind) - exact)))
            tolerance = 10.0 * float(getattr(method, "rtol", TOLERANCE)) * max(blind.evaluations / 12.0, 1.0)
            ended = blind.message or "ended without a word"
            yield Figure(error, tolerance, note=f"{form.__name__}: {blind.evaluations} evaluations, {ended}")


def there_and_back() -> Iterator[Figure]:
    """Yield 0 where a motion that crosses the pole twice between two reported times is noticed."""
    push, end = [60.0, 0.0, 0.0, 0.0], 0.6
    system, x0 = system_of(canonical, "regular")
    theta = simulate(system, x0, push, end).signal("q")[:, 0]
    crosses = theta.min() < 0.0 < theta[-1]
    yield Figure(0.0 if crosses else 1.0, 0.0, note=f"theta from 0.3 by {theta.min():.3f} to {theta[-1]:.3f}")
    system, x0 = system_of(canonical, "paper")
    for method in METHODS:
        got = simulate(system, x0, push, [end], method=method)
        yield Figure(0.0 if "sin(theta) is 0" in got.message else 1.0, 0.0, note=got.message or "not noticed")


def task(form: object, frame: str, goal: list[float]) -> Problem:
    """Return the motion of least time through the pole."""
    system: System = form(spherical(), [Gravity()], frame)  # type: ignore[operator]
    return point_to_point(system, FROM, goal, q=WITHIN, tau=DRIVES)


@cache
def solved(form: object) -> Solution:
    """Return the solution in the regular frame."""
    result: Solution = solve(task(form, "regular", TO), radau(3), uniform(50))
    return result


def optimal() -> Iterator[Figure]:
    """Yield what is not verified of the motion in both forms, and how far their times are apart, polished."""
    times = []
    for form in (canonical, hamel):
        raw = solved(form)
        theta = raw.signal("q", raw.t)[:, 0]
        index = int(np.argmin(np.abs(theta)))
        speed = raw.signal("v", raw.t)[index, 1]
        crossing = theta.min() < 0.0 < theta.max() and abs(speed) > 1.0
        best = polish(raw)
        reports = [verify(raw), verify(best)]
        failures = [words for report in reports for words in report.failures]
        failures += [] if crossing else ["the motion does not pass the pole while psi turns"]
        failures += [] if best.structure is not None else [best.message]
        note = f"{form.__name__}: t_f = {best.duration:.12f} s, psi' = {speed:.2f} rad/s at the pole"
        yield Figure(float(len(failures)), 0.0, note="; ".join([note, *failures]))
        times.append(best.duration)
    # Polished times are good to nine digits.
    yield Figure(abs(times[0] - times[1]) / times[0], 1e-9, note="t_f of both forms")


def paper_fails() -> Iterator[Figure]:
    """Yield 0 where the frame of the paper fails by value with the sentence that says why."""
    for form in FORMS:
        result = solve(task(form, "paper", TO), radau(3), uniform(50))
        named = not result.ok and "the frame 'paper' of the spherical manipulator is singular" in result.message
        yield Figure(0.0 if named else 1.0, 0.0, note=f"{form.__name__}: {result.status.name}, {result.message}")


def paper_round() -> Iterator[Figure]:
    """Yield 0 where ends on one side leave the frame a chance, and it fails with the sentence or is verified."""
    best = solve(task(canonical, "regular", ROUND), radau(3), uniform(50))
    yield Figure(0.0 if best.ok and np.min(best.signal("q", best.t)[:, 0]) < 0.0 else 1.0, 0.0, note=str(best.duration))
    for form in (canonical, hamel):
        result = solve(task(form, "paper", ROUND), radau(3), uniform(50), Ipopt(max_iter=60), (Smooth(),))
        explained = not result.ok and ("'paper'" in result.message or result.status.name == "LIMIT")
        sound = result.ok and not verify(result).failures and result.duration >= best.duration - 1e-6
        note = f"{form.__name__}: {result.status.name}, {result.duration:.6g} s, {result.message}"
        yield Figure(0.0 if explained or sound else 1.0, 0.0, note=note)


CASES: tuple[Case, ...] = (
    Case("pole", "through it, Lagrange", "q, v behind it, relative", "C / C_0", lambda: through(lagrange)),
    Case("pole", "through it, Boltzmann-Hamel", "q, v behind it, relative", "C / C_0", lambda: through(hamel)),
    Case("pole", "through it, canonical", "q, v behind it, relative", "C / C_0", lambda: through(canonical)),
    Case("pole", "through it in the frame of the paper", "motions not refused", "", refused, False),
    Case(
        "pole",
        "the frame of the paper unwatched",
        "q, v behind it",
        "",
        unwatched,
        False,
        outside="the frame is singular at theta = 0 and simulate refuses it; these are its equations all the same",
    ),
    Case("pole", "there and back in the frame of the paper", "motions not refused", "", there_and_back, False),
    Case("pole", "best path through it", "complaints; t_f, relative", "", optimal, False),
    Case("pole", "best path, frame of the paper", "solves without the sentence", "", paper_fails),
    Case("pole", "best path from side to side", "solves neither explained nor sound", "", paper_round, False),
)
