"""No verdict "infeasible" or "unbounded" before easier problems have been tried, and the verdict names them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from models.effects import Gravity, Payload
from models.forms import canonical
from models.scenes.scene_template import TASKS
from ocp import Bolza, Fixed, Free, Ipopt, Problem, System, along, end, point_to_point, solve, start, uniform, verify
from ocp.solving.guess_rungs import LeastEffort

NONE = ca.SX(0, 1)


def swing_up(limit: float, guess: float) -> Problem:
    """Return the swing of a pendulum to the top in least time, with a motor too weak to lift it at once."""
    q, v, u = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("u")
    system = System(ca.vertcat(q, v), u, NONE, ca.vertcat(v, u - ca.sin(q)), {"q": q, "v": v, "tau": u})
    return point_to_point(system, 0.0, np.pi, tau=limit, horizon=Free(guess))


@pytest.mark.parametrize(("limit", "guess", "known"), [
    (0.5, 1.0, 7.592956), pytest.param(0.25, 20.0, 14.608568, marks=pytest.mark.slow),
])  # fmt: skip
def test_a_weak_pendulum_is_not_infeasible(limit: float, guess: float, known: float) -> None:
    """Both were "no motion found that meets all constraints"; the values come from guesses 20 and 1 s of other runs."""
    solution = solve(swing_up(limit, guess), grid=uniform(50))
    assert solution.ok, solution.message
    assert solution.duration == pytest.approx(known, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("guess", [1.0, 5.0, 20.0])
def test_the_weakest_pendulum_has_one_optimum_from_every_guess(guess: float) -> None:
    solution = solve(swing_up(0.2, guess), grid=uniform(50))
    assert solution.rung == "LeastEffort"
    assert solution.duration == pytest.approx(18.09795, rel=1e-5)


@pytest.mark.slow
def test_a_motion_that_cannot_be_is_still_refused_and_says_what_was_tried() -> None:
    q, u = ca.SX.sym("q"), ca.SX.sym("u")
    system = System(q, u, NONE, u * ca.cos(q), {"q": q, "tau": u})  # no control moves q beyond pi / 2
    problem = Problem(system, Free(1.0, upper=50.0), Bolza(time=1.0), (
        start(q, 0.0), end(q, 2.0), along(u, -1.0, 1.0)))  # fmt: skip
    solution = solve(problem, grid=uniform(20))
    assert not solution.ok
    for rung in ("Smooth", "StraightLine", "LeastEffort (not solved itself)"):
        assert rung in solution.message


def test_least_effort_keeps_the_duration_within_its_limits() -> None:
    """A duration of at most 7 s does not suffice for 0.5: the continuation must not leave that limit."""
    problem = swing_up(0.5, 1.0)
    short = Problem(problem.system, Free(1.0, upper=7.0), problem.minimise, problem.subject_to)
    assert not solve(short, grid=uniform(30)).ok
    fixed = Problem(problem.system, Fixed(8.0), Bolza(running=problem.system.u**2), problem.subject_to)
    assert solve(fixed).ok
    with pytest.raises(ValueError, match="increasing numbers > 0"):
        LeastEffort((2.0, 1.0))


@pytest.mark.slow
@pytest.mark.parametrize(("elements", "known"), [(20, 2.26597), (40, 2.23566)])
def test_a_load_that_the_drives_cannot_hold_is_swung_to_the_goal(elements: int, known: float) -> None:
    task = TASKS["spherical"]
    arm = canonical(task.machine(), [Gravity(), Payload(20.0)])
    problem = point_to_point(arm, task.q0, task.q1, q=(task.q_min, task.q_max), tau=task.limit)
    solution = solve(problem, grid=uniform(elements), solver=Ipopt(progress=False))
    assert solution.ok, solution.message
    assert "cannot hold the end" in solution.message
    assert solution.duration == pytest.approx(known, abs=1e-4)  # found from 0 kg in steps of 2 kg, each from the last


@pytest.mark.slow
def test_a_pendubot_without_an_upper_time_is_no_unbounded_problem() -> None:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    q1, q2, v1, v2 = ca.vertsplit(x)
    coupled, gravity = 0.5 * ca.cos(q2), 9.81
    a, b, d = 5.0 / 3.0 + 2.0 * coupled, 1.0 / 3.0 + coupled, 1.0 / 3.0
    h = 0.5 * ca.sin(q2)
    weights = 1.5 * gravity * ca.sin(q1) + 0.5 * gravity * ca.sin(q1 + q2), 0.5 * gravity * ca.sin(q1 + q2)
    r1 = u + h * v2 * v1 + h * (v1 + v2) * v2 - weights[0]
    r2 = -h * v1 * v1 - weights[1]
    det = a * d - b * b
    system = System(x, u, rate=ca.vertcat(v1, v2, (d * r1 - b * r2) / det, (a * r2 - b * r1) / det))
    limits = start(x, np.zeros(4)), end(x, [np.pi, 0.0, 0.0, 0.0]), along(u, -20.0, 20.0)
    free, bounded = (Problem(system, horizon, Bolza(time=1.0), limits) for horizon in (Free(1.0), Free(1.0, upper=9.0)))
    found = solve(free, solver=Ipopt(progress=False))
    assert verify(found).ok, verify(found)
    assert found.duration == pytest.approx(solve(bounded, solver=Ipopt(progress=False)).duration, rel=1e-6)
