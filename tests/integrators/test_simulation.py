"""Integration against closed solutions: order, accuracy, jumps of the control, blow-up, reported times."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Control, Fixed, Problem, System, end, legendre, lobatto, radau, simulate, solve, start, uniform
from ocp.integrators.gragg_bulirsch_stoer import integrate

none = ca.SX(0, 1)


def oscillator():
    x = ca.SX.sym("x", 2)
    return System(x, none, none, ca.vertcat(x[1], -x[0]), {"energy": ca.sumsqr(x) / 2})


def double_integrator():
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    return System(x, u, p, ca.vertcat(x[1], u / p), {"u": u, "q": x[0]}, {"mass": 1.0})


def kepler():
    x = ca.SX.sym("x", 4)
    r = ca.norm_2(x[:2])
    return System(x, none, none, ca.vertcat(x[2:], -x[:2] / r**3), {"energy": ca.sumsqr(x[2:]) / 2 - 1 / r})


def orbit(t, e):
    """Return positions on the Kepler ellipse of half axis 1, eccentricity e, from the perihelion at t = 0."""
    anomaly = t + e * np.sin(t)
    for _ in range(50):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - t) / (1 - e * np.cos(anomaly))
    return np.stack([np.cos(anomaly) - e, np.sqrt(1 - e**2) * np.sin(anomaly)], axis=1)


def test_order_of_one_step():
    # x' = x cos t; a tolerance that accepts anything makes the interval one step, of local order 16 + 1.
    steps = np.array([0.8, 1.0, 1.25, 1.5])
    found = [
        integrate(lambda t, x: x * np.cos(t), 0.0, h, np.ones(1), rtol=1e9, atol=1e9).x[0] - np.exp(np.sin(h))
        for h in steps
    ]
    assert np.all(np.abs(found) < 1e-6)
    assert np.polyfit(np.log(steps), np.log(np.abs(found)), 1)[0] > 15.5


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13])
def test_error_follows_the_tolerance(rtol):
    # The flow of the oscillator keeps distances: errors of single steps add up, and no more.
    calls = []

    def rate(t, x):
        calls.append(t)
        return np.array([x[1], -x[0]])

    done = integrate(rate, 0.0, 15.0, np.array([1.0, 0.0]), rtol, rtol)
    steps = len(calls) / (1 + sum(2 * k - 1 for k in range(1, 9)))
    assert done.reached == 15.0
    assert np.max(np.abs(done.x - [np.cos(15.0), -np.sin(15.0)])) < steps * rtol


def test_a_looser_tolerance_costs_less():
    counts = []
    for rtol in (1e-3, 1e-6, 1e-9, 1e-12):
        calls = []
        integrate(lambda t, x, c=calls: c.append(t) or -x, 0.0, 40.0, np.ones(3), rtol, rtol)
        counts.append(len(calls))
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_harmonic_oscillator():
    t = np.linspace(0.0, 50.0, 333)
    found = simulate(oscillator(), [1.0, 0.0], [], t)
    assert found.ok
    np.testing.assert_allclose(found.x, np.stack([np.cos(t), -np.sin(t)], axis=1), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.signal("energy"), 0.5, rtol=0, atol=1e-11)


def test_kepler_orbit():
    e, t = 0.6, np.linspace(0.0, 2 * np.pi, 25)
    found = simulate(kepler(), [1 - e, 0, 0, np.sqrt((1 + e) / (1 - e))], [], t, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found.x[:, :2], orbit(t, e), rtol=0, atol=1e-11)


def test_energy_stays_over_five_orbits():
    e = 0.6
    found = simulate(kepler(), [1 - e, 0, 0, np.sqrt((1 + e) / (1 - e))], [], 10 * np.pi, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found.signal("energy"), -0.5, rtol=0, atol=1e-11)


@pytest.mark.parametrize("angle", [0.1, 1.5, 2.5])
def test_pendulum_passes_the_bottom_after_a_quarter_period(angle):
    # K(sin(angle / 2)) = pi / (2 agm(1, cos(angle / 2))).
    a, b = 1.0, np.cos(angle / 2)
    for _ in range(10):
        a, b = (a + b) / 2, np.sqrt(a * b)
    length, g = 0.7, 9.81
    x = ca.SX.sym("x", 2)
    pendulum = System(x, none, none, ca.vertcat(x[1], -g / length * ca.sin(x[0])))
    period = 4 * np.sqrt(length / g) * np.pi / (2 * a)
    found = simulate(pendulum, [angle, 0.0], [], [period / 4, period / 2, period], rtol=1e-13, atol=1e-13)
    speed = -2 * np.sqrt(g / length) * np.sin(angle / 2)
    np.testing.assert_allclose(found.x, [[0.0, speed], [-angle, 0.0], [angle, 0.0]], rtol=0, atol=1e-11)


def test_constant_and_callable_controls():
    t = np.array([0.5, 2.0])
    constant = simulate(double_integrator(), [1.0, -1.0], [0.6], t, values={"mass": 2.0})
    callable_ = simulate(double_integrator(), [1.0, -1.0], lambda _: [0.6], t, values={"mass": 2.0})
    np.testing.assert_allclose(constant.x, np.stack([1 - t + 0.15 * t**2, 0.3 * t - 1], axis=1), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(constant.x, callable_.x)
    np.testing.assert_array_equal(constant.u, [[0.6], [0.6]])
    assert constant.values == {"mass": 2.0}


def test_control_that_varies():
    t = np.linspace(0.0, 3.0, 7)
    found = simulate(double_integrator(), [0.0, 0.0], lambda s: np.array([np.cos(s)]), t)
    np.testing.assert_allclose(found.x, np.stack([1 - np.cos(t), np.sin(t)], axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.signal("u")[:, 0], np.cos(t), rtol=0, atol=1e-12)


@pytest.mark.parametrize("jump", [1.0, 1 / 3, 1.9999])
def test_steps_end_at_breaks(jump):
    def bang(t):
        return [1.0 if t < jump else -1.0]

    found = simulate(double_integrator(), [0.0, 0.0], bang, [jump, 2.0], breaks=[jump])
    speed, way = 2 * jump - 2.0, jump**2 / 2 + jump * (2 - jump) - (2 - jump) ** 2 / 2
    np.testing.assert_allclose(found.x, [[jump**2 / 2, jump], [way, speed]], rtol=0, atol=1e-12)


def test_breaks_outside_the_motion_do_nothing():
    found = simulate(double_integrator(), [0.0, 0.0], lambda _: [1.0], 2.0, breaks=[-1.0, 0.0, 2.0, 7.0])
    assert found.ok
    np.testing.assert_allclose(found.x[-1], [2.0, 2.0], rtol=0, atol=1e-11)


def effort(control, make=radau, degree=3, elements=6):
    system = double_integrator()
    ends = start(system.x, [0.0, 0.3]), end(system.x, [1.0, 0.0])
    problem = Problem(system, Fixed(1.5), Bolza(running=system["u"] ** 2), ends)
    solution = solve(problem, make(degree, control), uniform(elements), values={"mass": 2.0})
    assert solution.ok
    return solution


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("make", [radau, legendre, lobatto])
def test_control_of_a_solution(make, control):
    # The motion is a polynomial of low degree on each element, which every scheme represents exactly.
    solution = effort(control, make)
    t = np.union1d(solution.nodes, np.linspace(0.01, 1.49, 23))
    found = simulate(solution.problem.system, [0.0, 0.3], solution, t)
    np.testing.assert_allclose(found.x, solution.x(t), rtol=0, atol=1e-11)
    assert found.values == {"mass": 2.0}


def test_control_of_a_solution_by_hand():
    solution = effort(Control.CONSTANT)
    found = simulate(solution.problem.system, [0.0, 0.3], solution, solution.nodes)
    h, position, speed = 1.5 / 6, [0.0], [0.3]
    for force in solution.controls[:, 0, 0]:
        position.append(position[-1] + h * speed[-1] + h**2 / 2 * force / 2.0)
        speed.append(speed[-1] + h * force / 2.0)
    np.testing.assert_allclose(found.x, np.stack([position, speed], axis=1), rtol=0, atol=1e-13)


def test_parameters_of_a_solution_can_be_overruled():
    solution = effort(Control.CONSTANT)
    heavy = simulate(solution.problem.system, [0.0, 0.0], solution, [1.5], values={"mass": 4.0})
    light = simulate(solution.problem.system, [0.0, 0.0], solution, [1.5])
    np.testing.assert_allclose(2 * heavy.x, light.x, rtol=1e-12)


def test_blow_up_is_a_message():
    x = ca.SX.sym("x")
    t = np.array([0.0, 0.5, 0.9, 1.5, 2.0])
    found = simulate(System(x, none, none, x**2), [1.0], [], t)
    assert not found.ok
    assert "stopped at t = 1" in found.message or "stopped at t = 0.99" in found.message
    np.testing.assert_allclose(found.x[:3, 0], [1.0, 2.0, 10.0], rtol=1e-10)
    assert np.all(np.isnan(found.x[3:]))


def test_leaving_the_domain_is_a_message():
    x = ca.SX.sym("x", 2)
    found = simulate(System(x, none, none, ca.vertcat(-1.0, ca.sqrt(x[0]))), [1.0, 0.0], [], [0.5, 2.0])
    assert "f is not finite" in found.message
    assert found.x[0, 1] == pytest.approx((1 - 0.5**1.5) / 1.5, abs=1e-12)
    assert np.all(np.isnan(found.x[1]))


def test_control_that_is_no_number_is_a_message():
    found = simulate(double_integrator(), [0.0, 0.0], lambda t: [np.nan if t > 0.5 else 1.0], [0.4, 1.0], breaks=[0.5])
    assert not found.ok
    np.testing.assert_allclose(found.x[0], [0.08, 0.4], rtol=0, atol=1e-14)
    assert np.all(np.isnan(found.x[1]))


@pytest.mark.parametrize("times", [[0.0, 0.1, 0.30000000000000004, 1.1], [0.7], [1e-9, 1.0], np.linspace(0, 2, 50)])
def test_reported_times_are_those_asked_for(times):
    found = simulate(double_integrator(), [0.0, 1.0], lambda _: [0.0], times, breaks=[0.1, 0.5])
    np.testing.assert_array_equal(found.t, times)
    np.testing.assert_allclose(found.x[:, 0], times, rtol=1e-12)


def test_one_duration_is_reported_at_101_places():
    found = simulate(double_integrator(), [0.0, 1.0], [0.0], 2.5)
    np.testing.assert_array_equal(found.t, np.linspace(0.0, 2.5, 101))
    assert found.x.shape == (101, 2)


def test_the_start_alone():
    solution = effort(Control.CONSTANT)
    for control in ([1.0], lambda _: [1.0], solution):
        found = simulate(solution.problem.system, [0.25, -1.0], control, [0.0])
        np.testing.assert_array_equal(found.x, [[0.25, -1.0]])


@pytest.mark.parametrize("rate", [lambda t, x: x**3, lambda t, x: np.exp(x), lambda t, x: x**2 - x**2 * x])
def test_a_step_that_leaves_the_numbers_warns_nobody(rate):
    # Warnings are errors here: an unstable motion that is re-integrated leaves the numbers in trial steps.
    reached = integrate(rate, 0.0, 2.0, np.array([30.0]), 1e-12, 1e-12)
    assert 0.0 < reached.reached <= 2.0
    assert np.all(np.isfinite(reached.x))
