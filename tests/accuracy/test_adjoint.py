"""Costates with the multipliers of state limits spread evenly: certificates that bound the known error closely."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue import problems

from ocp import Control, Ipopt, along, estimate, gentle, legendre, lobatto, radau, solve, uniform, verify
from ocp.accuracy.even_multipliers import even

SHARP = Ipopt(tol=1e-11, progress=False)
CONSTANT = (radau(3), legendre(3), lobatto(3), radau(2), lobatto(4))
LIFT = problems.lift_fastest(speed=1.2)


@pytest.mark.parametrize("scheme", CONSTANT, ids=repr)
@pytest.mark.parametrize("elements", [10, 20, 40, 80])
def test_the_gain_under_a_speed_limit_bounds_the_known_error_closely(scheme, elements):
    solution = solve(LIFT.problem, scheme, uniform(elements), SHARP)
    true = solution.cost - LIFT.cost
    gain = verify(solution).switching * solution.cost
    assert true <= gain <= 6.0 * true
    assert true <= estimate(solution).cost <= 12.0 * true


@pytest.mark.parametrize("elements", [10, 20, 40])
def test_a_small_cost_on_effort_leaves_the_bound_close(elements):
    problem = gentle(LIFT.problem)
    best = solve(problem, radau(3), uniform(400), SHARP).cost  # 5e-6 above that of 1600 elements
    solution = solve(problem, radau(3), uniform(elements), SHARP)
    true = solution.cost - best
    assert true <= estimate(solution).cost <= 12.0 * true


@pytest.mark.parametrize("scheme", CONSTANT, ids=repr)
def test_what_is_spread_has_no_mean_and_points_along_the_limit(scheme):
    solution = solve(LIFT.problem, scheme, uniform(20), SHARP)
    adjoint = even(solution, LIFT.problem)
    moved = adjoint.costates - solution.costates
    assert adjoint.moved
    assert np.max(np.abs(moved[..., 1])) > 1e-3 * np.max(np.abs(solution.costates[..., 1]))
    np.testing.assert_array_equal(moved[..., 0], 0.0)  # the limit is one of v alone
    np.testing.assert_allclose(np.einsum("j,kja->ka", scheme.weights, moved), 0.0, atol=1e-12)
    # dH/du = lambda_2 / m: no less even than before on any element, and even where the speed is held.
    spread = [np.ptp(costates[..., 1], axis=1) for costates in (solution.costates, adjoint.costates)]
    assert np.all(spread[1] <= spread[0] + 1e-12)
    held = np.all(np.abs(solution.states[..., 1] - 1.2) < 1e-6, axis=1)
    assert held.any()
    assert np.max(spread[1][held]) < 1e-9
    assert np.all(adjoint.slack >= 0.0)


def test_the_unit_of_a_limit_plays_no_part():
    solution = solve(LIFT.problem, radau(3), uniform(20), SHARP)
    first, last, speed, force = LIFT.problem.subject_to
    speed = along(1e6 * LIFT.problem.system.x[1], 1e6 * speed.lower, 1e6 * speed.upper)
    other = replace(LIFT.problem, subject_to=(first, last, speed, force))
    here, there = even(solution, LIFT.problem), even(solution, other)
    np.testing.assert_allclose(there.costates, here.costates, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(there.slack, here.slack, rtol=1e-6, atol=1e-12)


def test_where_no_multiplier_is_a_saw_nothing_moves():
    cases = (
        (problems.lift_fastest(), radau(3)),
        (problems.bryson_denham(0.1), radau(3)),  # of second order
        (problems.crane(), radau(3)),  # H curved in the control
        (LIFT, radau(3, Control.LINEAR)),
        (LIFT, radau(3, Control.COLLOCATED)),
    )
    for known, scheme in cases:
        solution = solve(known.problem, scheme, uniform(20), SHARP)
        adjoint = even(solution, known.problem)
        assert not adjoint.moved
        assert adjoint.costates is solution.costates
        assert not adjoint.slack.any()


def test_numbers_that_are_none_are_left_alone():
    solution = solve(LIFT.problem, radau(3), uniform(20), SHARP)
    costates, states = solution.costates.copy(), solution.states.copy()
    costates[10, 1], states[12, 2] = np.nan, np.inf
    broken = replace(solution, costates=costates, states=states)
    whole, adjoint = even(solution, LIFT.problem), even(broken, LIFT.problem)
    left = [10, 12]
    np.testing.assert_array_equal(adjoint.costates[left], costates[left])
    np.testing.assert_allclose(np.delete(adjoint.costates, left, 0), np.delete(whole.costates, left, 0), rtol=1e-12)
    assert np.all(np.isfinite(adjoint.slack))
    assert not verify(replace(solution, costates=np.full_like(costates, np.nan))).ok
