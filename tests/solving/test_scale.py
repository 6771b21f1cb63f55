"""Nothing depends on units: similar tasks have similar solutions, and guesses and messages know no absolute sizes."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Fixed,
    Free,
    Problem,
    Sequence,
    Status,
    System,
    along,
    end,
    estimate,
    outside,
    point_to_point,
    polish,
    prepare,
    solve,
    solve_to_accuracy,
    start,
    uniform,
    verify,
)
from ocp.problem.regions import Ball
from ocp.solving.first_guesses import smooth

LENGTHS = [1e-6, 1e6]
GRID = uniform(20)


def carriage(gain: float = 1.0, weight: float = 0.0) -> System:
    """A mass on a line, x'' = gain u - weight."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    signals = {"q": x[0], "v": x[1], "tau": u}
    return System(x, u, ca.SX(0, 1), ca.vertcat(x[1], gain * u - weight), signals, {})


def around(size: float, tempo: float) -> Problem:
    """A mass in a plane, from one side of a ball to the other; numbers of lengths and times are scaled."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[2:], u), {"q": x[:2], "v": x[2:], "tau": u}, {})
    task = point_to_point(
        system, [-size, 0.1 * size], [size, 0.1 * size], tau=size / tempo**2, horizon=Free(2.0 * tempo)
    )
    ball = outside(Ball([0.0, 0.0, 0.0], 0.4 * size), ca.vertcat(x[:2], 0))
    return replace(task, subject_to=(*task.subject_to, ball))


@pytest.mark.parametrize(("size", "tempo"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-3, 1e3)])
def test_a_task_around_an_obstacle_in_other_units(size: float, tempo: float) -> None:
    # With an odd number of elements the switch lies inside one, and costates are unique.
    known, found = (solve(task, grid=uniform(21)) for task in (around(1.0, 1.0), around(size, tempo)))
    assert known.ok
    assert found.ok, found.message
    assert found.duration / tempo == pytest.approx(known.duration, rel=1e-7)
    assert 0.5 <= found.iterations / known.iterations <= 2.0
    report = verify(found)
    assert report.ok, report.failures
    np.testing.assert_allclose(
        found.costates * np.array([size, size, size / tempo, size / tempo]) / tempo, known.costates, atol=1e-6
    )


@pytest.mark.parametrize("tempo", [1e-3, 1e3])
def test_a_sequence_in_other_units_of_time(tempo: float) -> None:
    def legs(tempo: float) -> Sequence:
        system = carriage()
        limits = along(system["tau"], -1.0 / tempo**2, 1.0 / tempo**2)
        horizon = Free(tempo)
        first = Problem(system, horizon, Bolza(1.0), (start(system["q"], 0.0), start(system["v"], 0.0), limits))
        first = replace(first, subject_to=(*first.subject_to, end(system["q"], 0.25)))
        second = Problem(system, horizon, Bolza(1.0), (end(system["q"], 1.0), end(system["v"], 0.0), limits))
        return Sequence((first, second))

    known, found = solve(legs(1.0), grid=uniform(8)), solve(legs(tempo), grid=uniform(8))
    assert found.ok
    assert found.duration / tempo == pytest.approx(known.duration, rel=1e-7)
    assert 0.5 <= found.iterations / known.iterations <= 2.0


@pytest.mark.parametrize("guess", [1e-6, 1.0, 1e6])
def test_the_guess_of_the_duration_hardly_matters(guess: float) -> None:
    task = point_to_point(carriage(), 0.0, 1.0, tau=1.0, horizon=Free(guess))
    assert 2.0 < smooth(task, []).duration < 4.0
    solution = solve(task, grid=GRID)
    assert solution.duration == pytest.approx(2.0, rel=1e-8)


def test_a_speed_limit_keeps_the_guess_from_being_shortened() -> None:
    system = carriage()
    guess = smooth(point_to_point(system, 0.0, 1.0, tau=1e9, v=1.0, horizon=Free(100.0)), [])
    assert np.max(np.abs(guess.x[:, 1])) <= 1.0


@pytest.mark.parametrize("limit", [1e3, 1e6, 1e9])
def test_limits_out_of_reach_change_nothing(limit: float) -> None:
    system = carriage()
    known = solve(point_to_point(system, 0.0, 1.0, tau=1.0), grid=GRID)
    for limits in ({"q": limit}, {"v": limit}):
        found = solve(point_to_point(system, 0.0, 1.0, tau=1.0, **limits), grid=GRID)
        assert found.duration == pytest.approx(known.duration, rel=1e-8)
        assert verify(found).ok
    effort = Bolza(running=system["tau"] ** 2)
    task = point_to_point(system, 0.0, 1.0, tau=limit, horizon=Fixed(1.0), minimise=effort)
    found = solve(task, grid=uniform(40))
    assert found.cost == pytest.approx(12.0, rel=2e-3)  # u = 6 - 12 t, constant on elements
    assert verify(found).ok, verify(found).failures


@pytest.mark.parametrize("place", [0.0, 1.0])
def test_a_motion_small_beside_its_place(place: float) -> None:
    solution = solve(point_to_point(carriage(), place, place + 1e-9, tau=1.0), grid=GRID)
    assert solution.duration == pytest.approx(2.0 * np.sqrt((place + 1e-9) - place), rel=1e-6)
    assert verify(solution).ok, verify(solution).failures


def test_a_drift_of_a_small_motion_is_seen() -> None:
    solution = solve(point_to_point(carriage(), 1.0, 1.0 + 1e-6, tau=1.0), grid=GRID)
    states = solution.states.copy()
    states[-1, -1, 0] += 1e-9  # a thousandth of the way
    assert verify(replace(solution, states=states)).drift > 1e-4


@pytest.mark.parametrize("place", [0.0, 3.0])
def test_start_and_goal_coincide(place: float) -> None:
    task = point_to_point(carriage(1.0, 0.5), place, place, tau=1.0)
    solution = solve(task, grid=GRID)
    assert solution.status is Status.SOLVED
    assert solution.duration == 0.0
    assert solution.cost == 0.0
    assert "start and goal coincide" in solution.message
    assert verify(solution).ok
    assert estimate(solution).cost == 0.0
    assert "no duration" in polish(solution).message
    assert [rung.duration for rung in solve_to_accuracy(task)] == [0.0]
    np.testing.assert_array_equal(solution.x(0.0), [place, 0.0])
    np.testing.assert_allclose(solution.rate(0.0), [0.0, 0.0], atol=1e-14)
    later = solve(replace(task, horizon=Free(1.0, lower=0.25)), grid=GRID)
    assert later.duration == pytest.approx(0.25, rel=1e-8)
    assert "lower limit of 0.25 s" in later.message
    assert verify(later).ok, verify(later).failures


def test_a_tolerance_below_rounding_and_a_drive_without_limits_are_named() -> None:
    from ocp import Ipopt

    system = carriage()
    below = solve(point_to_point(system, 0.0, 1.0, tau=1.0), grid=GRID, solver=Ipopt(tol=1e-17))
    assert "below rounding" in below.message
    brief = Ipopt(max_iter=60)
    endless = solve(point_to_point(system, 0.0, 1.0), grid=uniform(5), solver=brief)
    assert not endless.ok
    assert "without limits" in endless.message


def test_a_grid_too_coarse_for_any_motion_is_named() -> None:
    solution = solve(point_to_point(carriage(), 0.0, 1.0, tau=1.0), grid=uniform(1))
    assert not solution.ok
    assert "try a grid of ten elements or more" in solution.message


def test_polish_refuses_a_control_beyond_its_limits_between_points() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u, {"q": x, "tau": u}, {})
    least = Problem(system, Fixed(3.0), Bolza(running=x**2), (start(x, 1.0), along(u, -1.0, 1.0)))
    coarse = solve(least, grid=uniform(31))
    polished = polish(coarse)
    # The first structure that is read exceeds the bounds by half their range at a cost that is too low; it is refused.
    assert polished.structure is not None
    assert verify(polished).violation < 1e-9
    assert polished.cost == pytest.approx(1.0 / 3.0, rel=1e-9)


def test_scales_of_cost_and_limits_are_powers_of_two() -> None:
    scaling = prepare(around(1e-3, 1e3), grid=GRID).joined.nlps[0].scaling
    for size in (scaling.cost, *np.concatenate(scaling.limits)):
        assert np.log2(size) == round(np.log2(size))


@pytest.mark.parametrize(("low", "high"), [(298.0, 398.0), (-398.0, -298.0)])
def test_rates_with_controls_beyond_their_limits_set_no_scale(low: float, high: float) -> None:
    # A reaction at a temperature: at -398 K its rate would be exp(+2500/398) times larger than it ever is.
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    first, second = 4000.0 * ca.exp(-2500.0 / ca.fabs(u)), 620000.0 * ca.exp(-5000.0 / ca.fabs(u))
    signed = 4000.0 * ca.exp(-2500.0 / u * np.sign(low)), 620000.0 * ca.exp(-5000.0 / u * np.sign(low))
    for one, two in ((first, second), signed):
        system = System(x, u, rate=ca.vertcat(-one * x[0] ** 2, one * x[0] ** 2 - two * x[1]))
        task = Problem(system, Fixed(1.0), Bolza(final=-x[1]), (start(x, [1.0, 0.0]), along(u, low, high)))
        scaling = prepare(task).joined.nlps[0].scaling
        assert np.all(scaling.x < 10.0)
        solution = solve(task)
        assert solution.cost == pytest.approx(-0.6108029205537, abs=2e-4)  # by shooting
        assert estimate(solution).cost < 1e-3
