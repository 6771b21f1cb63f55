"""Deadlines: solves end at the next iteration after them, and nothing more is tried."""

from itertools import pairwise

import numpy as np
import pytest
from catalogue import problems
from catalogue.published import PUBLISHED

from ocp import Status, polish, resolved, solve, solve_to_accuracy, uniform
from ocp.accuracy.limit_order import control_pattern
from ocp.solving.deadline import overdue, within


def test_a_solve_after_its_deadline_ends_at_once():
    problem = problems.cops().problem
    with within(0.0):
        assert overdue()
        late = solve(problem)
    assert late.status is Status.LIMIT
    assert late.iterations == 0
    assert "guesses tried: Smooth)" in late.message
    assert not overdue()
    assert solve(problem).ok


def test_the_earliest_of_nested_deadlines_counts():
    with within(0.0):
        with within(1e9):
            assert overdue()
        assert overdue()
    with within(1e9):
        with within(0.0):
            assert overdue()
        assert not overdue()


def test_a_grid_is_not_refined_after_the_deadline():
    coarse = solve(PUBLISHED["two masses with dry friction"].make(), grid=uniform(20))
    assert coarse.ok
    with within(0.0):
        assert resolved(coarse) is coarse


def test_the_last_stage_is_tried_where_the_order_of_limits_changes():
    patterns = []

    def finish(step):
        patterns.append(control_pattern(step))
        return step  # not better

    steps = list(solve_to_accuracy(problems.cops().problem, 1e-7, finish=finish))
    assert steps[-1].accuracy.met
    assert 1 <= len(patterns) < len(steps)
    assert all(one != other for one, other in pairwise(patterns))


@pytest.mark.parametrize("count", [25, 40, 60])
def test_the_order_of_limits_does_not_depend_on_the_grid(count):
    # Accelerate, coast at the limit of speed, brake: the speed is at its limit in between.
    order = control_pattern(solve(problems.lift_fastest(speed=1.2).problem, grid=uniform(count)))
    assert order[0] == (1, 0, -1)
    assert order[2] == (0, 1, 0)


def test_polish_after_the_deadline_returns_the_motion():
    solution = solve(problems.lift_fastest().problem)
    with within(0.0):
        late = polish(solution)
    assert late.structure is None or late.ok
    assert np.isfinite(late.cost)
