"""A duration of zero between different ends is no motion: not from a guess, not as a result."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Free,
    Ipopt,
    Problem,
    Status,
    System,
    along,
    end,
    prepare,
    simulate,
    smooth,
    solve,
    start,
    uniform,
)
from ocp.solution.integration_drift import collapsed
from ocp.solving.guess_ladder import LongerDuration

x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)


def quadrotor(goal, inertia=0.01, arm=0.2, horizon=None):
    """A planar quadrotor of 1 kg with two propellers of up to 9.81 N: position, pitch, and their rates."""
    thrust = u[0] + u[1]
    rate = ca.vertcat(x[3:], -thrust * ca.sin(x[2]), thrust * ca.cos(x[2]) - 9.81, arm * (u[1] - u[0]) / inertia)
    system = System(x, u, ca.SX(0, 1), rate)
    limits = start(x, 0.0), end(x, [*goal, 0.0, 0.0, 0.0, 0.0]), along(u, 0.0, 9.81)
    return Problem(system, Free() if horizon is None else horizon, Bolza(time=1.0), limits)


@pytest.mark.parametrize(("goal", "inertia", "arm"), [((5.0, 0.0), 0.01, 0.2), ((1.0, 0.0), 1.0, 1.0)])
def test_a_quadrotor_flies_sideways_in_finite_time(goal, inertia, arm):
    problem = quadrotor(goal, inertia, arm)
    solution = solve(problem, grid=uniform(50))
    assert solution.ok, solution.message
    held = solve(replace(problem, horizon=Free(2.0, 0.2)), grid=uniform(50))
    assert solution.duration == pytest.approx(held.duration, rel=1e-6)
    # No sideways flight is faster than with all of the thrust of 2 g pointing sideways: T >= 2 sqrt(d / 2g).
    assert solution.duration > 2.0 * np.sqrt(goal[0] / 19.62)
    moved = simulate(problem.system, solution.states[0, 0], solution, solution.nodes)
    np.testing.assert_allclose(moved.x[-1, :2], goal, atol=2e-2 * max(goal))


def test_the_first_guess_is_no_instant():
    # On the straight path the propellers only carry the weight: no duration is short enough to need more of them.
    assert smooth(quadrotor((5.0, 0.0)), []).duration >= 0.1


def test_a_collapsed_solution_is_failed_and_says_so():
    problem = quadrotor((5.0, 0.0))
    solution = solve(problem, grid=uniform(20))
    assert not collapsed(solution)
    assert collapsed(replace(solution, duration=1.5e-31))
    assert not collapsed(replace(solution, duration=1.5e-31, states=0.0 * solution.states))  # at rest all the time
    # A short motion that is one: micrometres in microseconds, from a guess of a second.
    y, f = ca.SX.sym("y", 2), ca.SX.sym("f")
    axis = System(y, f, ca.SX(0, 1), ca.vertcat(y[1], f))
    short = Problem(axis, subject_to=(start(y, 0.0), end(y, [1e-12, 0.0]), along(f, -1.0, 1.0)))
    brief = solve(short, grid=uniform(20))
    assert brief.ok
    assert brief.duration == pytest.approx(2e-6, rel=1e-6)


@pytest.mark.slow
def test_the_message_of_a_collapse_has_a_cure(monkeypatch):
    # The guess of a vanishing duration that used to be made.
    problem = quadrotor((5.0, 0.0))
    prepared = prepare(problem, grid=uniform(50), solver=Ipopt(progress=False))
    guess = replace(smooth(problem, []), duration=1e-20)
    solution = prepared(guess)
    assert not solution.ok
    if solution.status is Status.FAILED:
        assert "the duration collapsed" in solution.message
        assert "Free(guess, lower=...)" in solution.message


def test_a_lower_limit_is_released():
    problem = quadrotor((5.0, 0.0))
    prepared = prepare(problem, grid=uniform(30))
    guesses, warm = LongerDuration()(prepared, None)
    assert warm
    assert guesses[0].duration > 0.5
    assert LongerDuration()(prepare(replace(problem, horizon=Free(2.0, 2.0)), grid=uniform(30)), None) is None
