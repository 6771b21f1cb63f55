"""Problems that cannot be solved as they stand, or barely; docs/failures.md shows the messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models import cylindrical, spherical
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Ball,
    Bolza,
    Fixed,
    Free,
    Guess,
    Ipopt,
    Problem,
    SequenceSolution,
    Solution,
    System,
    along,
    end,
    outside,
    point_to_point,
    solve,
    start,
    uniform,
)

FROM, TO = [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9]
WITHIN = ([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1])
DRIVES = [260.0, 160.0, 3.0, 400.0]
GRID = uniform(20)


@dataclass(frozen=True)
class Failing:
    """A problem that fails, and words that the message must contain."""

    name: str
    run: Callable[[], Solution | SequenceSolution]
    says: tuple[str, ...]


def arm(frame: str | None = None) -> System:
    return canonical(spherical(), [Gravity()], frame)


def weak_drive() -> Solution:
    lift = canonical(cylindrical(), [Gravity()])
    task = point_to_point(lift, [0.0, 0.2, 0.6], [2.0, 0.8, 0.8], tau=[150.0, 600.0, 300.0])
    return solve(task, grid=GRID, solver=Ipopt(max_iter=200))


def walled_in() -> Solution:
    system = arm()
    task = point_to_point(system, FROM, TO, q=WITHIN, tau=DRIVES)
    wall = along(system["tool"][1], lower=0.9)
    return solve(replace(task, subject_to=(*task.subject_to, wall)), grid=GRID)


def start_outside() -> Solution:
    return solve(point_to_point(arm(), [0.9, 0.0, 0.0, 0.5], TO, q=WITHIN, tau=DRIVES), grid=GRID)


def start_in_obstacle() -> Solution:
    system = arm()
    task = point_to_point(system, FROM, TO, q=WITHIN, tau=DRIVES)
    obstacle = outside(Ball([0.0, 1.0, 0.8], 0.3), system["tool"])
    return solve(replace(task, subject_to=(*task.subject_to, obstacle)), grid=GRID)


def contradictory() -> Solution:
    system = arm()
    task = point_to_point(system, FROM, TO, q=WITHIN, tau=DRIVES)
    return solve(replace(task, subject_to=(*task.subject_to, along(system["q"][3], 1.2, 1.5))), grid=GRID)


def singular_start() -> Solution:
    upright = [0.0, 0.0, 0.0, 0.85]
    return solve(point_to_point(arm("paper"), upright, TO, tau=DRIVES), grid=GRID)


def singular_between() -> Solution:
    beyond = [-1.2, *TO[1:]]
    return solve(point_to_point(arm("paper"), FROM, beyond, tau=DRIVES), grid=GRID)


def not_a_number() -> Solution:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u / x, {"x": x, "u": u}, {})
    return solve(Problem(system, subject_to=(start(x, 0.0), end(x, 1.0), along(u, -1.0, 1.0))), grid=GRID)


def unbounded() -> Solution:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u, {"x": x, "u": u}, {})
    cost = Bolza(running=x)
    return solve(Problem(system, Fixed(1.0), cost, (start(x, 0.0),)), grid=GRID)


def hopeless_guess() -> Solution:
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    share = np.linspace(0.0, 1.0, 40)
    noise = np.random.default_rng(7).normal(size=(40, 12)) * 1e4
    return solve(
        task, grid=GRID, guess=Guess(share, noise[:, :8], noise[:, 8:], 1e-3, np.zeros(0)), solver=Ipopt(max_iter=60)
    )


def too_short() -> Solution:
    return solve(point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES, horizon=Fixed(0.5)), grid=GRID)


def nowhere_to_go() -> Solution:
    return solve(point_to_point(arm(), FROM, FROM, q=WITHIN, tau=DRIVES), grid=GRID)


def huge_scales() -> Solution:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], 1e-12 * u), {"q": x[0], "v": x[1], "tau": u}, {})
    return solve(point_to_point(system, 0.0, 1e9, tau=1e-6, horizon=Free(1.0)), grid=GRID, solver=Ipopt(max_iter=40))


FAILING = (
    Failing("a drive too weak for the load", weak_drive, ("tau_xi cannot hold the start", "637.7", "600", "raise")),
    Failing("a wall between start and end", walled_in, ("tool_y", "at the end", "move")),
    Failing("the start outside the limits", start_outside, ("r is 0.5 m at the start", "0.6", "move the start")),
    Failing("the start inside an obstacle", start_in_obstacle, ("clearance from Ball", "at the start")),
    Failing("limits that exclude each other", contradictory, ("limits of r", "at least 1.2", "at most 1.1")),
    Failing("not a number at the start", not_a_number, ("dx/dt is", "x = 0", "singularity")),
    Failing(
        "a start where the frame is singular",
        singular_start,
        ("the start is singular", "'paper'", "sin(theta) is 0", "use frame='regular'"),
    ),
    Failing(
        "a singularity of the frame between start and end",
        singular_between,
        ("two sides of a singularity", "'paper'", "sin(theta) is 0", "use frame='regular'"),
    ),
    Failing("a cost without a lower bound", unbounded, ("no bound", "try")),
    Failing("a hopeless guess", hopeless_guess, ("the motion breaks", "at t =", "without a guess")),
    Failing("a fixed duration that is too short", too_short, ("the shortest motion found", "0.68", "0.5 s were asked")),
    Failing("nowhere to go", nowhere_to_go, ("lower limit of 0 s", "start and goal coincide")),
    Failing("huge differences of scale", huge_scales, ("solved",)),
)
