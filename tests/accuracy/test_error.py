"""Errors estimated from a solution alone, against the true ones; multipliers as a start."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from catalogue import calibration, problems

from ocp import (
    Bolza,
    Control,
    Fixed,
    Ipopt,
    Problem,
    Status,
    System,
    along,
    estimate,
    legendre,
    load,
    lobatto,
    prepare,
    radau,
    save,
    simulate,
    solve,
    start,
    uniform,
)
from ocp.accuracy.hamiltonian_minimum import minimise, solved
from ocp.solving.warm_start import multipliers


def test_calibration_on_a_few():
    names = (
        "COPS robot arm",
        "lift up",
        "Bryson-Denham, arc",
        "straight line, cylindrical",
        "lift, effort, fixed duration",
    )
    schemes = (radau(3), radau(3, Control.COLLOCATED), legendre(3, Control.COLLOCATED))
    bounded, median = calibration.summary(list(calibration.measure(names, schemes, (10, 20))))
    assert bounded == 1.0
    assert 2.0 <= median < 6.0  # 4.7 measured; the factor of safety alone makes it 2


@pytest.mark.slow
def test_calibration():
    bounded, median = calibration.summary(list(calibration.measure(calibration.QUICK)))
    assert bounded >= 0.985  # 99.1 % measured, the rest on cart-pole grids that do not resolve the swing
    assert 2.0 <= median < 3.0  # 2.4 measured


def test_estimate_is_sharp_for_smooth_problems():
    # To first order the estimate is right; it claims twice as much.
    for case in calibration.measure(("lift, effort, fixed duration",), (radau(3),), (10, 40)):
        assert case.ratio == pytest.approx(2.0, rel=0.05)


def test_drift_is_that_of_an_independent_integration():
    known = problems.two_link()
    solution = solve(known.problem, radau(2), uniform(20))
    errors = estimate(solution)
    moved = simulate(known.problem.system, solution.x(0.0), solution, solution.nodes)
    apart = moved.x - solution.x(solution.nodes)
    np.testing.assert_allclose(errors.drift, apart, atol=2e-2 * np.max(np.abs(apart)))
    np.testing.assert_allclose(errors.states, np.max(np.abs(apart), axis=0), rtol=2e-2)


def test_moved_state_changes_the_cost_by_its_costate():
    known = problems.lift_fastest()
    solution = solve(known.problem, grid=uniform(20))
    states = np.array(solution.states)
    states[5, -1, 0] += 1e-5
    states[6:, 0, 0] += 1e-5
    states[6:, 1:, 0] += 1e-5
    states[-1, -1, 0] -= 1e-5
    more = estimate(replace(solution, states=states)).dynamics - estimate(solution).dynamics
    # A jump up by 1e-5 and one down at the end, both multiplied by the same costate, as height does not enter the rate.
    assert abs(more) < 1e-8
    states[-1, -1, 0] += 1e-5
    more = estimate(replace(solution, states=states)).dynamics - estimate(solution).dynamics
    assert more == pytest.approx(-1e-5 * solution.costates[5, -1, 0], rel=1e-6)


def test_limits_exceeded_between_points_have_a_cost():
    known = problems.lift_fastest()
    assert estimate(solve(known.problem, grid=uniform(7))).overshoot < 1e-9
    assert estimate(solve(known.problem, radau(3, Control.COLLOCATED), uniform(7))).overshoot > 1e-5


def test_unfinished_solution_has_no_finite_error():
    stopped = solve(problems.two_link().problem, grid=uniform(10), solver=Ipopt(max_iter=2))
    assert stopped.status is Status.LIMIT
    assert estimate(stopped).cost == np.inf
    assert np.all(estimate(stopped).states == np.inf)


def test_parts_add_up_and_are_printed():
    errors = estimate(solve(problems.cops().problem, grid=uniform(20)))
    assert errors.elements.sum() == pytest.approx(errors.cost, rel=1e-3)
    for word in ("cost", "dynamics", "optimality", "duration", "Hamiltonian"):
        assert word in str(errors)


def test_estimate_survives_a_file(tmp_path):
    known = problems.bryson_denham(0.1)
    solution = solve(known.problem, radau(3, Control.COLLOCATED), uniform(7))
    save(solution, tmp_path / "s.npz")
    with pytest.raises(ValueError, match=r"estimate: .* pass problem="):
        estimate(load(tmp_path / "s.npz"))
    assert estimate(load(tmp_path / "s.npz"), known.problem).cost == estimate(solution).cost


def test_least_hamiltonian_of_coupled_controls():
    # min lambda u over |u| <= 2 and over a tilted ellipse, known in closed form.
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    Q = np.array([[2.0, 0.6], [0.6, 1.0]])
    task = Problem(
        System(x, u, ca.SX(0, 1), u), Fixed(1.0), Bolza(running=ca.SX(0), final=x[0] + 3 * x[1]),
        (start(x, 0), along(u.T @ ca.DM(Q) @ u, upper=4.0)),
    )  # fmt: skip
    solution = solve(task, radau(2), uniform(4))
    assert solution.ok
    result = minimise(solution, task, np.array([0.2, 0.7]))
    slope = np.array([1.0, 3.0])
    np.testing.assert_allclose(result.least, -2.0 * np.sqrt(slope @ np.linalg.solve(Q, slope)), rtol=1e-6)


@pytest.mark.parametrize("scheme", [radau(3), legendre(3), lobatto(3), radau(3, Control.LINEAR)], ids=repr)
def test_multipliers_of_the_same_grid_are_those_of_the_solve(scheme):
    problem = problems.two_link().problem
    cold = prepare(problem, scheme, uniform(15))
    solution = cold()
    again = cold.proceed(solution)
    assert again.ok
    assert again.cost == pytest.approx(solution.cost, abs=1e-7)
    assert again.iterations < 0.7 * solution.iterations
    rows = multipliers(cold.joined.nlps[0], solution)[1]
    assert np.all(np.isfinite(rows))


@pytest.mark.parametrize("make", [problems.cops, problems.two_link, problems.crane], ids=lambda make: make.__name__)
def test_multipliers_save_iterations_on_a_finer_grid(make):
    problem = make().problem
    coarse = solve(problem, grid=uniform(20))
    fine = prepare(problem, grid=uniform(40))
    cold, warm = fine(), fine.proceed(coarse)
    assert warm.ok
    assert warm.cost == pytest.approx(cold.cost, rel=1e-7)
    assert warm.iterations < cold.iterations


def test_singular_steps_are_the_least_ones():
    stack = np.array([[[2.0, 0.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]], [[np.nan, 0.0], [0.0, 1.0]]])
    result = solved(stack, np.array([[4.0, 0.0], [2.0, 2.0], [1.0, 1.0]]))
    assert result == pytest.approx(np.array([[2.0, 0.0], [1.0, 1.0], [0.0, 0.0]]))


@pytest.mark.parametrize("elements", [10, 20, 40])
@pytest.mark.parametrize("ends", ["free start", "fixed start"])
def test_gauss_schemes_of_two_points_do_not_hide_the_shape_of_the_control(elements, ends):
    # Control and costate are lines through the same two points: their distance between the points was not seen.
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    oscillator = System(x, u, rate=ca.vertcat(x[1], (1.0 - x[0] ** 2) * x[1] - x[0] + u))
    start_at = (start(x[0], 1.0),) if ends == "free start" else (start(x, [1.0, -0.4]),)
    problem = Problem(oscillator, Fixed(6.0), Bolza(running=ca.sumsqr(x) + u**2), start_at)
    # Radau IIA of five points on 150 elements.
    exact = 2.7762000369 if ends == "free start" else solve(problem, radau(5, Control.COLLOCATED), uniform(60)).cost
    solution = solve(problem, legendre(2, Control.COLLOCATED), uniform(elements))
    true = solution.cost - exact
    errors = estimate(solution)
    assert errors.cost == pytest.approx(2.0 * true, rel=0.05)
    # Not only bounded: to first order, the parts give the error with its sign.
    assert errors.optimality - errors.dynamics == pytest.approx(true, rel=0.05)
