"""Costs whose optimum is zero: goals that are reached, exact tracking, no cost at all; shares need a floor."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Fixed,
    Free,
    Problem,
    Share,
    System,
    along,
    end,
    estimate,
    solve,
    solve_to_accuracy,
    start,
    verify,
)
from ocp.transcription.grid import uniform

x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
AXIS = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u))
SWING = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u - 9.81 * ca.sin(x[0])))
GOAL = ca.sumsqr(x - ca.DM([1.0, 0.0]))
WITHIN = start(x, 0.0), along(u, -2.0, 2.0)
ZERO = {
    "soft goal": Problem(AXIS, Fixed(2.0), Bolza(final=GOAL), WITHIN),
    "soft goal of a swing": Problem(SWING, Fixed(2.0), Bolza(final=GOAL), (start(x, 0.0), along(u, -20.0, 20.0))),
    "soft goal in small units": Problem(AXIS, Fixed(2.0), Bolza(final=1e-12 * GOAL), WITHIN),
    "rest": Problem(AXIS, Fixed(2.0), Bolza(running=ca.sumsqr(x)), WITHIN),
    "tracking of a speed": Problem(
        AXIS, Fixed(2.0), Bolza(running=(x[1] - 1.0) ** 2), (start(x, [0.0, 1.0]), along(u, -2.0, 2.0))
    ),
    "effort that is not needed": Problem(
        AXIS, Fixed(2.0), Bolza(running=u**2), (start(x, [0.0, 1.0]), end(x, [2.0, 1.0]), along(u, -2.0, 2.0))
    ),
    "a cost that crosses zero": Problem(AXIS, Fixed(2.0), Bolza(final=x[0]), (start(x, [4.0, 0.0]), WITHIN[1])),
    "no cost": Problem(AXIS, Fixed(2.0), Bolza(), (*WITHIN, end(x, [1.0, 0.0]))),
    "no cost, free duration": Problem(
        SWING, Free(2.0), Bolza(), (start(x, 0.0), end(x, [1.0, 0.0]), along(u, -20, 20))
    ),
}


@pytest.mark.parametrize("name", ZERO)
def test_an_optimum_of_zero_is_verified(name):
    solution = solve(ZERO[name], grid=uniform(20))
    assert solution.ok
    assert abs(solution.cost) < 1e-8
    report = verify(solution)
    assert report.ok, str(report)
    assert report.switching < 1e-5
    assert estimate(solution).hamiltonian < 1e-2
    steps = list(solve_to_accuracy(ZERO[name], Share(1e-5)))
    assert steps[-1].accuracy.met
    assert len(steps) <= 3


@pytest.mark.parametrize("name", ["soft goal", "tracking of a speed", "effort that is not needed", "rest"])
def test_a_motion_that_misses_the_zero_is_not_verified(name):
    # Solved with a control of at least 0.4, verified as a solution of the problem without that limit.
    moved = solve(replace(ZERO[name], subject_to=(*ZERO[name].subject_to, along(u - 0.4, lower=0.0))), grid=uniform(20))
    assert moved.cost > 1e-3
    assert not verify(moved, ZERO[name]).ok


@pytest.mark.parametrize("constant", [0.0, 1e-3, 1.0, -1.0, 1e6])
def test_a_constant_in_the_cost_changes_no_estimate(constant):
    task = Problem(SWING, Fixed(1.2), Bolza(running=u**2 / 50.0, final=constant), (
        start(x, 0.0), end(x, [1.0, 0.0])))  # fmt: skip
    plain = replace(task, minimise=Bolza(running=u**2 / 50.0))
    one, other = estimate(solve(task, grid=uniform(15))), estimate(solve(plain, grid=uniform(15)))
    assert one.cost == pytest.approx(other.cost, rel=1e-3, abs=2e-12 * abs(constant))
    assert np.all(np.isfinite([one.cost, one.duration]))
