"""Limits of controls with states or with each other: torque and speed, power, sums of controls."""

import casadi as ca
import numpy as np
import pytest
from catalogue.published import PUBLISHED, root

from ocp import Bolza, Fixed, Free, Problem, System, along, end, polish, solve, start, verify
from ocp.arcs.control_limits import blocking, coupled_limits, curved_limit, pushes_of, sides_of
from ocp.solution.structure import Kind

FORCE, SPEED, POWER, WAY, MASS = 3.0, 2.0, 2.5, 1.7, 1.3


def cart(*limits):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u / MASS))
    ends = start(x, 0.0), end(x, [WAY, 0.0])
    return Problem(system, Free(guess=2.0), Bolza(time=1.0), (*ends, *(limit(x, u) for limit in limits)))


def drive():
    return cart(lambda x, u: along(u / FORCE + x[1] / SPEED, -1.0, 1.0))


def drive_time():
    """Return the least time of `drive`: v' = k (V - v) up to v1, then v' = -k (V + v) down to rest, k = F / (m V)."""
    k = FORCE / (MASS * SPEED)

    def both(v):
        up, down = -np.log(1.0 - v / SPEED) / k, np.log(1.0 + v / SPEED) / k
        return SPEED * up - v / k + v / k - SPEED * down, up + down

    v1 = root(lambda v: both(v)[0] - WAY, 1e-6, SPEED * (1.0 - 1e-9))
    return both(v1)[1]


def supply_time():
    """Return the least time with |u| <= F, u v <= P: force F to v = P / F, then m v v' = P, then force -F."""
    slow = POWER / FORCE

    def both(v):
        first, last = slow * MASS / FORCE, v * MASS / FORCE
        middle = MASS * (v**2 - slow**2) / (2.0 * POWER)
        way = slow * first / 2.0 + MASS * (v**3 - slow**3) / (3.0 * POWER) + v * last / 2.0
        return way, first + middle + last

    return both(root(lambda v: both(v)[0] - WAY, slow, 10.0))[1]


def test_torque_and_speed():
    found = polish(solve(drive()))
    assert found.cost == pytest.approx(drive_time(), rel=1e-10)
    assert [set(arc.kinds) for arc in found.structure.arcs] == [{Kind.HOLDING}, {Kind.HOLDING}]
    assert verify(found).ok


def test_power():
    limits = (lambda x, u: along(u, -FORCE, FORCE)), (lambda x, u: along(u * x[1], upper=POWER))
    found = polish(solve(cart(*limits)))
    assert found.cost == pytest.approx(supply_time(), rel=1e-10)
    assert [arc.kinds for arc in found.structure.arcs] == [(Kind.UPPER,), (Kind.HOLDING,), (Kind.LOWER,)]
    assert verify(found).ok


def test_control_that_reaches_a_limit_of_states_without_a_jump():
    known = PUBLISHED["Rayleigh with a mixed limit"]
    found = polish(solve(known.make()))
    assert found.cost == pytest.approx(known.value, abs=1e-10)
    kinds = [arc.kinds[0] for arc in found.structure.arcs]
    assert kinds == [Kind.HOLDING, Kind.INTERIOR, Kind.HOLDING, Kind.INTERIOR]


def test_saturated_regulator():
    # x' = u, |u| <= 0.3, min 1/2 int x^2 + u^2 over 4 from 1: u = -0.3 until tanh feedback needs less.
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u)
    problem = Problem(system, Fixed(4.0), Bolza(running=(x**2 + u**2) / 2.0), (start(x, 1.0), along(u, lower=-0.3)))
    found = polish(solve(problem))
    t1 = root(lambda t: (1.0 - 0.3 * t) * np.tanh(4.0 - t) - 0.3, 0.0, 4.0)
    x1 = 1.0 - 0.3 * t1
    exact = ((1.0 - x1**3) / 0.9 + 0.09 * t1 + x1**2 * np.tanh(4.0 - t1)) / 2.0
    assert found.cost == pytest.approx(exact, rel=1e-10)
    assert found.structure.arcs[0].duration == pytest.approx(t1, abs=1e-6)  # the barrier of the bound moves it


def two():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    limits = along(u, 0.0, 1.0), along(u[0] + 2.0 * u[1] + x[0], upper=1.5), along(x[1] * u[1], -1.0, 0.5)
    return Problem(System(x, u, ca.SX(0, 1), u), Fixed(1.0), Bolza(running=ca.sum1(u)), limits)


def test_limit_of_one_control_is_one_of_that_control():
    x, u = np.array([[0.2, 2.0], [0.2, -4.0], [0.2, 0.0]]), np.full((3, 2), 0.1)
    low, high = sides_of(two(), x, u, np.zeros(0))
    np.testing.assert_allclose(low, 0.0)
    np.testing.assert_allclose(high, [[1.0, 0.25], [1.0, 0.25], [1.0, 1.0]])
    assert [own for *_, own in coupled_limits(two())] == [(0, 1), (1,)]
    assert curved_limit(two()) == ""


def test_the_limit_that_a_control_meets_first():
    point = np.array([0.2, 0.1]), np.array([0.2, 0.3]), np.zeros(0)
    assert blocking(two(), point, 0, 1) == (1, 0, 1)  # u_1 up to 0.7 by the sum
    assert blocking(two(), point, 0, -1) is None  # down to its bound
    assert blocking(two(), (np.array([-1.0, 4.0]), *point[1:]), 1, 1) == (2, 0, 1)


def test_multiplier_of_a_limit_makes_the_control_that_holds_it_stationary():
    x, u, slopes = np.array([[0.2, 0.1]]), np.array([[0.3, 0.5]]), np.array([[-3.0, -8.0]])
    pushes = pushes_of(two(), [(1, 0, 1)], (x, u, np.zeros(0)), slopes)
    np.testing.assert_allclose(pushes, [[4.0, 8.0]])  # multiplier 4 times (1, 2): u_1 has dH/du_1 = 1 > 0, at its bound


def test_limit_curved_in_several_controls_is_named():
    x, u = ca.SX.sym("x"), ca.SX.sym("u", 2)
    limits = (along(ca.sumsqr(u), upper=1.0),)
    problem = Problem(System(x, u, ca.SX(0, 1), u[0]), Fixed(1.0), Bolza(running=u[1]), limits)
    assert curved_limit(problem)


@pytest.mark.slow
def test_sums_of_controls():
    # Below the digits by shooting, whose structure has four switches less.
    known = PUBLISHED["flying robot"]
    found = polish(solve(known.make()), seconds=120.0)
    assert found.structure is not None
    assert known.value - 2e-5 < found.cost < known.value - 5e-6
    held = {contact for arc in found.structure.arcs for contact in arc.held}
    assert {contact.limit for contact in held} == {0, 1}
    assert verify(found).ok
