"""Refinement to a tolerance: met where the optimum is known, within budgets, for fewer iterations than from scratch."""

from functools import cache

import numpy as np
import pytest
from catalogue import problems

from ocp import (
    Control,
    Cost,
    Ipopt,
    Seconds,
    Share,
    Signal,
    Status,
    estimate,
    gentle,
    radau,
    solve,
    solve_to_accuracy,
    uniform,
    verify,
)

COLLOCATED = radau(3, Control.COLLOCATED)


@cache
def ladder(make, tol, scheme=None):
    return tuple(solve_to_accuracy(make().problem, tol, scheme))


@pytest.mark.parametrize("scheme", [None, COLLOCATED], ids=["constant", "collocated"])
@pytest.mark.parametrize("make", [problems.cops, problems.two_link, problems.lift_fastest], ids=lambda m: m.__name__)
def test_reaches_the_tolerance(make, scheme):
    steps = ladder(make, 1e-6, scheme)
    last = steps[-1]
    assert last.accuracy.met
    assert last.accuracy.reason == "the tolerance is met"
    assert abs(last.cost - make().cost) <= 1e-6
    assert all(abs(step.cost - make().cost) <= step.accuracy.error for step in steps)
    seconds = [step.accuracy.seconds for step in steps]
    assert np.all(np.diff(seconds) > 0.0)
    assert not any(step.accuracy.reason for step in steps[:-1])


def test_few_elements_do_what_a_uniform_grid_needs_thousands_for():
    last = ladder(problems.two_link, 1e-6)[-1]
    uniform_error = solve(problems.two_link().problem, grid=uniform(200)).cost - problems.two_link().cost
    assert len(last.grid) < 150
    assert abs(last.cost - problems.two_link().cost) < uniform_error / 10.0


def test_controls_keep_their_limits_by_default():
    last = ladder(problems.two_link, 1e-6)[-1]
    assert np.max(np.abs(last.controls)) <= 1.0
    assert verify(last).violation < 1e-9


def test_a_small_cost_on_effort_leaves_controls_switching():
    steps = list(solve_to_accuracy(gentle(problems.two_link().problem), 1e-4))
    assert {step.scheme.control for step in steps} == {Control.CONSTANT}
    assert steps[-1].accuracy.met
    assert verify(steps[-1]).ok
    assert next(solve_to_accuracy(problems.crane().problem)).scheme.control is Control.COLLOCATED


def test_smooth_problem_raises_the_degree():
    known = problems.straight_line("cylindrical")
    steps = list(solve_to_accuracy(known.problem, Share(1e-9), guess=known.guess, grid=uniform(6)))
    assert steps[-1].accuracy.met
    assert steps[-1].scheme.degree > steps[0].scheme.degree
    assert steps[-1].cost == pytest.approx(known.cost, rel=1e-9)


@pytest.mark.slow
def test_tolerances_in_other_terms():
    problem = problems.two_link().problem
    by_time = list(solve_to_accuracy(problem, Seconds(1e-4)))[-1]
    assert by_time.accuracy.met
    assert by_time.accuracy.unit == "s"
    by_signal = list(solve_to_accuracy(problem, Signal("x", 1e-7, "rad"), radau(2), uniform(12)))[-1]
    assert by_signal.accuracy.met
    assert np.max(estimate(by_signal).states) <= 1e-7
    assert verify(by_signal).drift < 1e-6
    with pytest.raises(ValueError, match="depends on the controls"):
        list(solve_to_accuracy(problem, Signal("u", 1e-7)))
    with pytest.raises(ValueError, match="Cost: tol is -1"):
        solve_to_accuracy(problem, -1.0)
    with pytest.raises(ValueError, match="budget"):
        solve_to_accuracy(problem, seconds=0.0)
    assert Cost(1e-3).tol == 1e-3


def test_budget_of_elements():
    steps = list(solve_to_accuracy(problems.cops().problem, 1e-12, elements=40))
    assert len(steps[-1].grid) <= 40
    assert not steps[-1].accuracy.met
    assert "40 are allowed" in steps[-1].message
    assert steps[-1].accuracy.error < steps[0].accuracy.error


def test_budget_of_seconds():
    steps = list(solve_to_accuracy(problems.two_link().problem, 1e-15, seconds=0.4))
    assert steps[-1].accuracy.reason
    assert steps[0].ok


def test_failure_is_the_last_rung():
    steps = list(solve_to_accuracy(problems.cops().problem, solver=Ipopt(max_iter=3)))
    assert len(steps) == 1
    assert steps[0].status is Status.LIMIT
    assert steps[0].accuracy.error == np.inf
    assert Status.LIMIT.value in steps[0].accuracy.reason


def test_finish_is_the_last_rung_if_it_is_better():
    best = ladder(problems.lift_fastest, 1e-6)[-1]
    steps = list(solve_to_accuracy(problems.lift_fastest().problem, 1e-6, finish=lambda _: best))
    assert len(steps) == 2
    assert steps[-1].cost == best.cost
    assert steps[-1].accuracy.met
    worse = solve(problems.lift_fastest().problem, grid=uniform(3))
    steps = list(solve_to_accuracy(problems.lift_fastest().problem, 1e-6, finish=lambda _: worse))
    assert steps[-1].cost != worse.cost


def test_multipliers_save_iterations_along_the_ladder():
    """A third of the iterations of cold starts is saved over all ladders; single steps may take more."""
    warm = cold = 0
    for make in (problems.cops, problems.two_link, problems.lift_fastest):
        for scheme in (None, COLLOCATED):
            steps = ladder(make, 1e-6, scheme)[1:]
            warm += sum(step.iterations for step in steps)
            cold += sum(solve(step.problem, step.scheme, step.grid, Ipopt(tol=1e-10)).iterations for step in steps)
    assert warm < 2.0 / 3.0 * cold
