"""Time in the equations, a cost at the start, and integral constraints, against optima known in closed form."""

from __future__ import annotations

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Guess,
    Problem,
    System,
    along,
    end,
    estimate,
    extend,
    integral,
    load,
    multistart,
    polish,
    prepare,
    radau,
    save,
    simulate,
    solve,
    start,
    uniform,
    verify,
)
from ocp.studies.content_hash import digest

NO = np.zeros(0)
t, x, u, NONE = ca.SX.sym("t"), ca.SX.sym("x"), ca.SX.sym("u"), ca.SX(0, 1)
SMOOTH = radau(3, Control.COLLOCATED)


def driven() -> System:
    """Return x' = u - x + sin t."""
    return System(x, u, NONE, u - x + ca.sin(t), t=t)


def test_a_simulated_motion_depends_on_time():
    moved = simulate(driven(), [1.0], [0.0], [0.5, 1.0])
    exact = 1.5 * np.exp(-moved.t) + (np.sin(moved.t) - np.cos(moved.t)) / 2.0
    np.testing.assert_allclose(moved.x[:, 0], exact, rtol=1e-11)
    np.testing.assert_allclose(moved.x[:, 1], moved.t, rtol=1e-13)


def test_minimum_time_in_a_field_that_changes():
    """x' = u + t with |u| <= 1 reaches 4 first with u = 1: T + T^2/2 = 4, T = 2."""
    problem = Problem(System(x, u, NONE, u + t, t=t), Free(1.0), Bolza(time=1.0), (
        start(x, 0.0), end(x, 4.0), along(u, -1.0, 1.0)))  # fmt: skip
    solution = solve(problem, grid=uniform(10))
    assert solution.duration == pytest.approx(2.0, rel=1e-9)
    assert verify(solution).drift < 1e-9
    np.testing.assert_allclose(solution.signal("t", np.array([0.0, 1.0, 2.0]))[:, 0], [0.0, 1.0, 2.0], atol=1e-9)


def test_tracking_of_a_moving_target():
    """min int_0^1 u^2 + (x - t)^2, x' = u + 1, x(0) = 0 has the cost 0; with x(0) = 1 it is tanh(1)."""
    system = System(x, u, NONE, u + 1.0, t=t)
    for first, cost in ((0.0, 0.0), (1.0, np.tanh(1.0))):
        problem = Problem(system, Fixed(1.0), Bolza(running=u**2 + (x - t) ** 2), (start(x, first),))
        assert solve(problem, SMOOTH, uniform(10)).cost == pytest.approx(cost, abs=1e-9)


def test_the_clock_travels_and_can_start_elsewhere(tmp_path):
    system = driven()
    again = pickle.loads(pickle.dumps(system))
    assert (again.clock, again.x.numel(), str(again.label("x", 2)[1])) == (1, 2, "t [s]")
    assert replace(system, notes=("a copy",)).x.numel() == 2
    assert extend(system).clock == 1
    cost = Bolza(running=u**2)
    usual = Problem(system, Fixed(1.0), cost, (start(x, 1.0), end(x, 0.0)))
    later = Problem(system, Fixed(1.0), cost, (start(x, 1.0), end(x, 0.0), start(t, np.pi)))
    first, second = solve(usual, SMOOTH, uniform(10)), solve(later, SMOOTH, uniform(10))
    assert solve(pickle.loads(pickle.dumps(usual)), SMOOTH, uniform(10)).cost == pytest.approx(first.cost, rel=1e-10)
    # int e^{tau-1} u = -x_free(1) costs at least x_free^2 / int e^{2(tau-1)}; after pi, sin t has the other sign.
    free = [np.exp(-1.0) + sign * (0.5 * (np.sin(1.0) - np.cos(1.0)) + 0.5 * np.exp(-1.0)) for sign in (1.0, -1.0)]
    for solution, value in zip((first, second), free, strict=True):
        assert solution.cost == pytest.approx(value**2 / (0.5 * (1.0 - np.exp(-2.0))), rel=1e-8)
    save(first, tmp_path / "motion.npz")
    assert solve(usual, SMOOTH, uniform(10), guess=load(tmp_path / "motion.npz")).ok


def test_a_guess_may_leave_out_time_and_integrals():
    problem = Problem(driven(), Fixed(1.0), Bolza(running=u**2), (start(x, 1.0), end(x, 0.0), integral(x, upper=0.4)))
    short = Guess(np.array([0.0, 1.0]), np.array([[1.0], [0.0]]), np.zeros((2, 1)), 1.0, np.zeros(0))
    solution = solve(problem, SMOOTH, uniform(10), guess=short)
    assert solution.ok
    assert solution.x(1.0)[2] == pytest.approx(0.4, abs=1e-7)


def test_systems_without_time_keep_their_identity():
    """Digests of the release before; a store would recompute every case if they changed."""
    p = ca.SX.sym("p")
    system = System(x, u, p, u * p - x, {"q": x}, {"p": 2.0})
    assert len(system.__reduce__()[1]) == 7
    problem = Problem(system, Fixed(1.0), Bolza(running=u**2), (start(x, 1.0),))
    assert len(problem.__reduce__()[1]) == 5
    assert digest(driven()) != digest(System(ca.vertcat(x, t), u, NONE, ca.vertcat(u - x + ca.sin(t), 1.0)))


@pytest.mark.parametrize(("wrong", "error"), [
    ({"t": "t"}, TypeError), ({"t": ca.SX.sym("t", 2)}, ValueError), ({"t": 2 * t}, ValueError), ({"t": u}, ValueError),
    ({"t": x}, ValueError),
])  # fmt: skip
def test_a_time_that_is_no_symbol_of_its_own_is_refused(wrong, error):
    with pytest.raises(error, match="System: "):
        System(x, u, NONE, u, **wrong)


def test_a_cost_at_the_start():
    """min (x(0) - 1)^2 + x(1)^2 with x' = x: x(0) = 1 / (1 + e^2)."""
    y = ca.SX.sym("y")
    free = System(y, ca.SX(0, 1), NONE, y)
    problem = Problem(free, Fixed(1.0), Bolza(final=y**2, initial=(y - 1.0) ** 2))
    for one in (problem, pickle.loads(pickle.dumps(problem))):
        solution = solve(one, grid=uniform(5))
        assert solution.cost == pytest.approx(1.0 - 1.0 / (1.0 + np.e**2), rel=1e-7)
        assert solution.x(0.0)[0] == pytest.approx(1.0 / (1.0 + np.e**2), rel=1e-6)
    # The costate at the start is minus the slope of that cost.
    assert solution.costate(np.zeros(1))[0, 0] == pytest.approx(-2.0 * (solution.x(0.0)[0] - 1.0), rel=1e-4)
    with pytest.raises(ValueError, match="initial depends on the control"):
        Problem(System(x, u, NONE, u), Fixed(1.0), Bolza(initial=u**2))
    assert digest(Bolza(time=1.0)) == digest(Bolza(1.0))


def test_the_largest_area_under_an_arc_of_given_length():
    """Dido: chord 1, length pi / 3 make an arc of radius 1; the area is (pi / 3 - sin(pi / 3)) / 2."""
    length = integral(ca.sqrt(1.0 + u**2), np.pi / 3.0, np.pi / 3.0, name="length")
    problem = Problem(System(x, u, NONE, u), Fixed(1.0), Bolza(running=-x), (start(x, 0.0), end(x, 0.0), length))
    # On the straight line the length does not change to first order with u: the constraint is singular there.
    bent = Guess(np.array([0.0, 0.5, 1.0]), np.array([[0.0], [0.1], [0.0]]), np.array([[0.2], [0.0], [-0.2]]), 1.0, NO)
    solution = solve(problem, SMOOTH, uniform(20), guess=bent)
    assert solution.ok, solution.message
    assert -solution.cost == pytest.approx((np.pi / 3.0 - np.sin(np.pi / 3.0)) / 2.0, rel=1e-8)
    assert verify(solution).ok
    assert estimate(solution).cost < 1e-6


def test_the_shortest_time_with_a_budget_of_energy():
    """min int u^2 from rest to rest over 1 in T is 12 / T^3, so a budget of 12 allows T = 1."""
    state = ca.SX.sym("x", 2)
    system = System(state, u, NONE, ca.vertcat(state[1], u))
    ends = (start(state, 0.0), end(state, [1.0, 0.0]))
    problem = Problem(system, Free(2.0), Bolza(time=1.0), (*ends, integral(u**2, upper=12.0)))
    solution = solve(problem, SMOOTH, uniform(10))
    assert solution.duration == pytest.approx(1.0, rel=1e-9)
    # Two problems with the same integrals share a system: one NLP serves both.
    prepared = prepare(problem, SMOOTH, uniform(10))
    twice = Problem(system, Free(2.0), Bolza(time=1.0), (*ends, integral(problem.system.rate[2], upper=24.0)))
    assert prepared(problem=twice).duration == pytest.approx(0.5 ** (1.0 / 3.0), rel=1e-8)
    assert multistart(problem, 2, scheme=SMOOTH, grid=uniform(10))[0].hits == 2


def test_a_budget_that_does_not_matter_changes_nothing():
    bounded = (start(x, 0.0), end(x, 1.0), along(u, -1.0, 2.0))
    system = System(x, u, NONE, u)
    free = solve(Problem(system, Free(1.0), Bolza(time=1.0), bounded), grid=uniform(5))
    loose = Problem(system, Free(1.0), Bolza(time=1.0), (*bounded, integral(ca.vertcat(u, u**2), [-9.0, 0.0], 9.0)))
    solution = solve(loose, grid=uniform(5))
    assert solution.duration == pytest.approx(free.duration, rel=1e-9)
    assert polish(solution).duration == pytest.approx(0.5, rel=1e-12)


def test_integrals_without_limits_or_of_strangers_are_refused():
    with pytest.raises(ValueError, match="integral: lower and upper are None"):
        integral(x)
    with pytest.raises(ValueError, match="symbols that are not in x, u or p"):
        Problem(System(x, u, NONE, u), Fixed(1.0), Bolza(), (integral(ca.SX.sym("z"), upper=1.0),))
