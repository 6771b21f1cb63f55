"""Ten problems that cannot be solved as they stand; docs/failures.md shows what the user is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models import spherical
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
    return solve(point_to_point(arm(), FROM, TO, q=WITHIN, tau=[20.0, 160.0, 3.0, 400.0]), grid=GRID)


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


def not_a_number() -> Solution:
    upright = [0.0, 0.0, 0.0, 0.85]
    return solve(point_to_point(arm("paper"), upright, TO, tau=DRIVES), grid=GRID)


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
