"""Moved grids and least effort: switches lie between elements, controls that the cost does not determine are smooth."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from catalogue import problems

from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Ipopt,
    Problem,
    along,
    end,
    gentlest,
    legendre,
    polish,
    radau,
    solve,
    start,
    uniform,
    verify,
)  # fmt: skip
from ocp.arcs.least_effort import undetermined, with_effort, without_effort
from ocp.arcs.moving_grid import NARROWEST, SETTINGS, WIDEST, move_grid
from ocp.solution.structure import Kind
from ocp.transcription.grid import Grid

QUIET = Ipopt(progress=False)


def two_axes(slack=0.5):
    """Two double integrators from rest to rest over 1 and over less: the first one sets the time, 2 s."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    axes = problems.system(x, u, ca.vertcat(x[2:], u))
    ends = start(x, 0), end(x, [1.0, slack, 0.0, 0.0])
    return Problem(axes, Free(1.0), Bolza(time=1.0), (*ends, along(u, -1.0, 1.0)))


def test_moved_grid_has_the_switches_between_its_elements():
    known = problems.two_link()
    coarse = solve(known.problem, grid=uniform(30), solver=QUIET)
    moved = move_grid(coarse, known.problem)
    assert moved.ok
    assert known.cost - 1e-9 < moved.cost < known.cost + 2e-6  # the uniform grid is 3e-4 and more above
    assert coarse.cost - known.cost > 50 * (moved.cost - known.cost)
    for own in known.switches:
        for t in own:
            assert np.min(np.abs(moved.nodes - t)) < 1e-3
    widths = moved.grid.widths * len(moved.grid) * moved.duration / coarse.duration
    assert np.all((widths > NARROWEST - 1e-6) & (widths < WIDEST + 1e-6))


def test_a_grid_that_is_finer_somewhere_may_stay_so():
    known = problems.two_link()
    ends = np.concatenate([np.linspace(0.0, 0.05, 11)[:-1], np.linspace(0.05, 1.0, 31)])
    coarse = solve(known.problem, grid=Grid(ends), solver=QUIET)
    first = move_grid(coarse, known.problem, solver=replace(SETTINGS, max_iter=1))
    given, mean = coarse.grid.widths * coarse.duration, coarse.duration / len(coarse.grid)
    np.testing.assert_allclose(first.grid.widths * first.duration, given, rtol=0.2)  # nothing is cut off at the start
    assert np.min(given) < 0.5 * NARROWEST * mean
    moved = move_grid(coarse, known.problem)
    assert moved.ok
    assert known.cost - 1e-9 < moved.cost < known.cost + 1e-5


def test_moved_grid_keeps_a_fixed_duration():
    problem = problems.lift_cheapest(0.7).problem
    coarse = solve(problem, grid=uniform(10), solver=QUIET)
    moved = move_grid(coarse, problem, radau(3, Control.COLLOCATED))
    assert moved.ok
    assert moved.duration == pytest.approx(0.7, abs=1e-12)
    assert moved.problem is problem


def test_slack_axis_moves_with_least_effort():
    problem = two_axes()
    coarse = solve(problem, grid=uniform(40), solver=QUIET)
    assert coarse.duration == pytest.approx(2.0, abs=1e-6)
    eased = gentlest(coarse)
    assert eased.ok
    assert eased.problem is problem
    assert eased.cost == eased.duration == pytest.approx(2.0, abs=1e-5)
    assert eased.message.endswith("gentlest")
    # From rest to rest over d in T with least integral of u^2: u = 6 d / T^2 (1 - 2 t / T).
    t = np.linspace(0.03, 1.97, 50)
    d, T = 0.5, 2.0
    np.testing.assert_allclose(eased.u(t)[:, 1], 6 * d / T**2 * (1 - 2 * t / T), atol=0.03)
    again = gentlest(coarse, weight=1e-6)
    assert again.cost - 2.0 < eased.cost - 2.0 + 1e-9


def test_slack_axis_is_polished_with_least_effort():
    problem = two_axes()
    solution = polish(solve(problem, grid=uniform(21), solver=QUIET))
    assert solution.structure is not None, solution.message
    assert solution.cost == pytest.approx(2.0, abs=1e-9)
    kinds = {name: [row.kind for row in solution.structure if row.name == name] for name in ("u_1", "u_2")}
    assert kinds == {"u_1": [Kind.UPPER, Kind.LOWER], "u_2": [Kind.INTERIOR]}
    assert solution.structure.switches("u_1") == pytest.approx((1.0,), abs=1e-7)
    assert verify(solution).ok
    t = np.linspace(0.0, 2.0, 41)
    np.testing.assert_allclose(solution.u(t)[:, 1], 0.75 * (1 - t), atol=2e-3)


def test_slack_axis_has_least_effort_where_no_structure_is_found():
    coarse = solve(two_axes(), grid=uniform(40), solver=QUIET)
    solution = polish(coarse, seconds=1e-9)
    assert solution.structure is None
    assert "the cost does not determine u_2 (100%) of the motion; it is that of least effort here" in solution.message
    assert solution.ok
    assert solution.cost == solution.duration == pytest.approx(2.0, abs=1e-5)
    t, d, T = np.linspace(0.03, 1.97, 50), 0.5, 2.0
    np.testing.assert_allclose(solution.u(t)[:, 1], 6 * d / T**2 * (1 - 2 * t / T), atol=0.03)
    assert verify(solution).ok


def test_which_controls_are_undetermined():
    assert undetermined(two_axes()).tolist() == [0, 1]
    free = two_axes()
    bounded = replace(free, subject_to=(*free.subject_to[:2], along(free.system.u[0], -1.0, 1.0)))
    assert undetermined(bounded).tolist() == [0]
    known = problems.lift_cheapest()
    assert undetermined(known.problem).tolist() == []
    coarse = solve(known.problem, grid=uniform(10), solver=QUIET)
    assert with_effort(known.problem, coarse, 1e-4) is known.problem
    assert "the cost determines all controls" in gentlest(coarse).message


def test_cost_without_effort_is_that_of_the_problem():
    problem = replace(two_axes(), horizon=Fixed(2.5), minimise=Bolza(running=two_axes().system.x[0] * 0))
    x = problem.system.x
    problem = replace(problem, minimise=Bolza(time=0.5, running=x[1] ** 2, final=3.0 + 0.0 * x[0]))
    coarse = solve(problem, grid=uniform(20), solver=QUIET)
    assert coarse.ok
    assert without_effort(coarse, problem).cost == pytest.approx(coarse.cost, rel=1e-9)


def test_wrong_arguments():
    with pytest.raises(TypeError, match="gentlest: solution is"):
        gentlest(3)
    coarse = solve(two_axes(), grid=uniform(10), solver=QUIET)
    with pytest.raises(ValueError, match="gentlest: weight"):
        gentlest(coarse, weight=0.0)
    with pytest.raises(ValueError, match="polish: seconds"):
        polish(coarse, seconds=0.0)
    failed = replace(coarse, status=type(coarse.status).LIMIT)
    assert "not a solved motion" in gentlest(failed).message


def test_no_structure_within_the_seconds_is_said():
    coarse = solve(two_axes(), grid=uniform(21), solver=QUIET)
    result = polish(coarse, seconds=1e-6)
    assert result.structure is None
    assert result.ok
    assert "(within 1e-06 s)" in result.message


def test_reading_schemes_are_those_of_the_given_grid():
    coarse = solve(two_axes(), grid=uniform(21), solver=QUIET)
    moved = move_grid(coarse, with_effort(coarse.problem, coarse, 1e-4), legendre(3, Control.COLLOCATED))
    assert moved.ok
    assert len(moved.grid) == 21
    assert moved.scheme == legendre(3, Control.COLLOCATED)
