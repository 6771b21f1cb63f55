"""Input that a user meets on the first day: grids of sums, no parameters, names of symbols, motions of no length."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from ocp import Fixed, Free, Problem, Status, System, along, end, given, point_to_point, solve, start, uniform
from ocp.transcription.grid import Grid


def carriage() -> System:
    """Return a mass on a rail with names for its symbols, without parameters."""
    q, v, force = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("force")
    return System(ca.vertcat(q, v), force, rate=ca.vertcat(v, force), signals={"q": q, "v": v, "tau": force})


@pytest.mark.parametrize("seed", range(20))
def test_widths_may_be_added_up(seed: int) -> None:
    h = np.random.default_rng(seed).uniform(0.1, 1.0, 7)
    grid = given(np.concatenate([[0.0], np.cumsum(h) / h.sum()]))
    assert (grid.ends[0], grid.ends[-1]) == (0.0, 1.0)


@pytest.mark.parametrize("ends", [[0.0, 0.5, 1.0 - 1e-9], [1e-9, 1.0], [0.0, 1.0 + 1e-6], [0.0, 1.0, 1.0], [0.0]])
def test_other_grids_are_still_refused(ends: list[float]) -> None:
    with pytest.raises(ValueError, match="Grid"):
        Grid(np.array(ends))


@pytest.mark.parametrize("p", [None, ca.SX(0, 1), ca.SX(), ca.SX(0, 0), [], ()])
def test_no_parameters_can_be_said_in_every_way(p: object) -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, p, u)  # type: ignore[arg-type]
    assert system.p.shape == (0, 1)
    assert solve(Problem(system, Free(), subject_to=(start(x, 0), end(x, 1), along(u, -1, 1))), grid=uniform(3)).ok


def test_a_system_without_controls_may_say_so_with_an_empty_expression() -> None:
    x = ca.SX.sym("x")
    assert System(x, ca.SX(), ca.SX(), -x).u.shape == (0, 1)


def test_a_forgotten_rate_is_named() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    with pytest.raises(TypeError, match="System: rate is None, expected dx/dt"):
        System(x, u)


def test_labels_are_the_names_of_the_symbols() -> None:
    system = carriage()
    assert [str(label) for label in system.label("x", 2)] == ["q", "v"]
    assert [str(label) for label in system.label("u", 1)] == ["force"]
    vector = ca.SX.sym("z", 3)
    numbered = System(vector, ca.SX(0, 1), ca.SX(0, 1), -vector)
    assert [str(label) for label in numbered.label("x", 3)] == ["x_1", "x_2", "x_3"]
    twins = ca.vertcat(ca.SX.sym("a"), ca.SX.sym("a"))
    assert [str(label) for label in System(twins, ca.SX(0, 1), ca.SX(0, 1), -twins).label("x", 2)] == ["x_1", "x_2"]
    late = solve(point_to_point(system, 0.0, 1.0, tau=1.0, horizon=Fixed(1.0)), grid=uniform(10))
    assert "the motion breaks dq/dt" in late.message
    assert "x_1" not in late.message


def test_a_motion_of_no_length_as_a_guess() -> None:
    """It divided by zero and then took 500 iterations."""
    still = solve(point_to_point(carriage(), 0.5, 0.5, tau=1.0), grid=uniform(10))
    assert still.duration == 0.0
    for horizon in (Free(1.0), Free(5.0), Fixed(3.0)):
        moved = solve(point_to_point(carriage(), 0.5, 1.5, tau=1.0, horizon=horizon), grid=uniform(10), guess=still)
        assert moved.ok, moved.message
        assert moved.iterations < 60
        assert moved.duration == pytest.approx(3.0 if isinstance(horizon, Fixed) else 2.0, rel=1e-6)


@pytest.mark.parametrize("limit", [0.0, (0.0, 0.0), (-1.0, 0.0)])
def test_a_way_to_go_without_speed_is_refused_at_once(limit: float | tuple[float, float]) -> None:
    """A limit of 0 led to t = 5.8e4 s after half a minute."""
    solution = solve(point_to_point(carriage(), 0.0, 1.0, tau=1.0, v=limit), grid=uniform(10))
    assert solution.status is Status.INFEASIBLE
    assert solution.solver_status == "not started"
    assert "q has 1 to go and its rate is limited to 0" in " ".join(solution.message.split())
    back = solve(point_to_point(carriage(), 0.0, -1.0, tau=1.0, v=(-1.0, 0.0)), grid=uniform(10))
    assert back.duration == pytest.approx(2.0, rel=1e-6)
