"""Problems of the benchmark in plain expressions and numbers, so that every contender solves the same ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from models.effects import Gravity
from models.forms import canonical
from models.scenes.scene_template import TASKS
from ocp import Bolza, Fixed, Free, Guess, Ipopt, Problem, System, along, end, radau, smooth, start, uniform
from ocp.checks import Array
from ocp.transcription.scaling import from_limits

Pin = tuple[ca.SX, Sequence[float] | Array]  # an expression in the state, and its values

PI = float(np.pi)


@dataclass(frozen=True, eq=False)
class Case:
    """Move a system from start to end, for the shortest duration or for the smallest integral over a fixed one."""

    title: str
    system: System  # x' = rate(x, u), every number folded in
    start: tuple[Pin, ...]
    end: tuple[Pin, ...]
    x: tuple[Array, Array]  # lower, upper limits (nx,) along the motion, infinite for none
    u: tuple[Array, Array]  # (nu,)
    duration: float  # guess of a free duration, or the fixed one [s]
    running: ca.SX = field(default_factory=lambda: ca.SX(0))  # integrand for a fixed duration; 0 for minimum time
    known: float = float("nan")  # optimal cost

    @property
    def free(self) -> bool:
        """Whether the duration is to be minimised."""
        return bool(self.running.is_zero())

    def problem(self) -> Problem:
        """Return the case as a Problem of this project."""
        return Problem(
            self.system,
            Free(self.duration) if self.free else Fixed(self.duration),
            Bolza(time=1.0) if self.free else Bolza(running=self.running),
            (
                *(start(expression, values) for expression, values in self.start),
                *(end(expression, values) for expression, values in self.end),
                along(self.system.x, *self.x),
                along(self.system.u, *self.u),
            ),
        )


@dataclass(frozen=True, eq=False)
class Numbers:
    """Initial guess, scales and settings, given to every contender that takes them."""

    guess: Guess
    x: Array  # (N, m, nx) the guess at the nodes of every element
    u: Array  # (N, nu) in the middle of every element
    duration: float  # [s]
    x_scale: Array  # (nx,)
    u_scale: Array  # (nu,)
    duration_scale: float  # [s]
    cost_scale: float
    ends_scale: Array  # of the conditions at the ends, one after the other
    ipopt: dict[str, Any]  # IPOPT's options by their own names


@dataclass(frozen=True)
class RunResult:
    """Cost, seconds and iterations of one run of a contender on a problem and grid; NaN for what it does not report."""

    setup: float = float("nan")  # wall-clock seconds until the solver starts
    derivatives: float = float("nan")  # evaluating cost, constraints, derivatives [s]
    solver: float = float("nan")  # the rest of the solve; all of it where derivatives are not reported [s]
    cpu: float = float("nan")  # processor seconds of everything
    iterations: float = float("nan")
    cost: float = float("nan")  # t_f [s], or the integral
    drift: float = float("nan")  # true error of the motion by re-simulation, share of the largest state
    note: str = ""  # why there is no result
    setup_only: bool = False  # the solve was left out

    @property
    def busy(self) -> float:
        """Seconds of set-up and solve, as far as it came."""
        return float(np.nansum([self.setup, self.derivatives, self.solver]))

    @property
    def total(self) -> float:
        """Seconds of set-up and solve; nan without a result."""
        return float("nan") if self.setup_only or self.note else self.busy


def numbers(case: Case, elements: int, settings: Ipopt) -> Numbers:
    """Return what this project starts from on a uniform grid with Radau of degree 3, as numbers."""
    problem, grid, scheme = case.problem(), uniform(elements), radau(3)
    guess = smooth(problem, [])
    scaling = from_limits(problem, guess, [], np.zeros(0, dtype=int))
    starts, widths = grid.ends[:-1, None], grid.widths[:, None]
    return Numbers(
        guess,
        guess.state(starts + widths * scheme.nodes),
        guess.control(starts + widths * 0.5)[:, 0],
        guess.duration,
        scaling.x,
        scaling.u,
        scaling.horizon,
        scaling.cost,
        np.concatenate(scaling.limits[: len(case.start) + len(case.end)]),
        dict(settings.options(warm=False)["ipopt"]),
    )


def _robot_arm(title: str, duration: float, known: float, running: Callable[[ca.SX], ca.SX]) -> Case:
    """Return the COPS robot arm: rho, theta, phi and their rates; its inertia lacks its rate, as published."""
    x, u, length = ca.SX.sym("x", 6), ca.SX.sym("u", 3), 5.0
    rho, phi = x[0], x[2]
    inertia = ((length - rho) ** 3 + rho**3) / 3.0
    rate = ca.vertcat(x[3:], u[0] / length, u[1] / (inertia * ca.sin(phi) ** 2), u[2] / inertia)
    free = np.full(3, np.inf)
    return Case(
        title,
        System(x, u, ca.SX(0, 1), rate),
        ((x[:3], (4.5, 0.0, PI / 4.0)), (x[3:], (0.0, 0.0, 0.0))),
        ((x[:3], (4.5, 2.0 * PI / 3.0, PI / 4.0)), (x[3:], (0.0, 0.0, 0.0))),
        (np.array([0.0, -PI, 0.0, *-free]), np.array([length, PI, PI, *free])),
        (-np.ones(3), np.ones(3)),
        duration,
        running(u),
        known,
    )


def robot_arm() -> Case:
    """Return P1: the COPS robot arm in minimum time (Dolan, More, Munson, COPS 3.0)."""
    return _robot_arm("P1, COPS robot arm, minimum time", 5.0, 9.140911745908168, lambda u: ca.SX(0))


def smooth_arm() -> Case:
    """Return P4: the COPS robot arm with a duration of 10 s and the least integral of u'u."""
    return _robot_arm("P4, COPS robot arm, 10 s, least integral of u'u", 10.0, float("nan"), ca.sumsqr)


def two_link_arm() -> Case:
    """Return P3: Luus's two-link arm in minimum time; x = (th1', th2', th2 - th1, th1)."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    s, c = ca.sin(x[2]), ca.cos(x[2])
    shared = 31.0 / 36.0 + 9.0 / 4.0 * s**2
    first = s * (9.0 / 4.0 * c * x[0] ** 2 + 2.0 * x[1] ** 2) + 4.0 / 3.0 * (u[0] - u[1]) - 3.0 / 2.0 * c * u[1]
    second = s * (7.0 / 2.0 * x[0] ** 2 + 9.0 / 4.0 * c * x[1] ** 2) - 7.0 / 3.0 * u[1] + 3.0 / 2.0 * c * (u[0] - u[1])
    return Case(
        "P3, Luus two-link arm, minimum time",
        System(x, u, ca.SX(0, 1), ca.vertcat(first / shared, -second / shared, x[1] - x[0], x[0])),
        ((x, (0.0, 0.0, 0.5, 0.0)),),
        ((x, (0.0, 0.0, 0.5, 0.522)),),
        (np.full(4, -np.inf), np.full(4, np.inf)),
        (-np.ones(2), np.ones(2)),
        3.0,
        known=2.98227994254784,
    )


def manipulator(name: str, title: str) -> Callable[[], Case]:
    """Return the maker of the default task of scripts/time_optimal.py for a machine, in canonical form, gravity on."""

    def make() -> Case:
        task = TASKS[name]
        arm = canonical(task.machine(), [Gravity()])
        rest, free, limit = np.zeros(len(task.q0)), np.full(len(task.q0), np.inf), np.array(task.limit)
        return Case(
            title,
            arm,
            ((arm["q"], task.q0), (arm["v"], rest)),
            ((arm["q"], task.q1), (arm["v"], rest)),
            (np.array([*task.q_min, *-free]), np.array([*task.q_max, *free])),
            (-limit, limit),
            1.0,
        )

    return make


CASES: dict[str, Callable[[], Case]] = {
    "P1": robot_arm,
    "P2": manipulator("spherical", "P2, spherical manipulator, minimum time"),
    "P3": two_link_arm,
    "P4": smooth_arm,
    "cylindrical": manipulator("cylindrical", "cylindrical manipulator, minimum time"),
    "torus": manipulator("torus", "torus-like manipulator, minimum time"),
}
