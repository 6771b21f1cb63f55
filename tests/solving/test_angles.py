"""Controls that are angles without limits: iterates may wander by many turns, and are led back."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Free, Ipopt, Problem, System, along, end, solve, start, uniform
from ocp.solving.guess_ladder import DEFAULT
from ocp.solving.guess_rungs import OneTurn, Smooth
from ocp.solving.whole_turns import angles_without_limits

G = 9.81


def brachistochrone(limits=(), down=5.0, finish=(10.0, 5.0), begin=(0.0, 0.0, 0.0)):
    x, angle = ca.SX.sym("x", 3), ca.SX.sym("angle")
    system = System(x, angle, rate=ca.vertcat(x[2] * ca.sin(angle), x[2] * ca.cos(angle), G * ca.cos(angle)))
    ends = start(x, begin), end(x[:2], finish)
    return Problem(system, Free(1.0), Bolza(time=1.0), (*ends, *(along(angle, *one) for one in limits)))


def cycloid_time(across, down):
    """Return the time along the cycloid x = r (a - sin a), y = r (1 - cos a) from rest, by bisection for a."""
    low, high = 1e-3, 2.0 * np.pi - 1e-3
    for _ in range(100):
        a = (low + high) / 2.0
        low, high = (a, high) if (a - np.sin(a)) / (1.0 - np.cos(a)) < across / down else (low, a)
    return a * np.sqrt(down / (1.0 - np.cos(a)) / G)


def test_a_direction_without_limits_is_found_within_one_turn():
    solution = solve(brachistochrone(), grid=uniform(30), solver=Ipopt(progress=False), guess=(OneTurn(),))
    assert solution.ok, solution.message
    assert solution.duration == pytest.approx(cycloid_time(10.0, 5.0), rel=5e-4)
    assert DEFAULT[:2] == (Smooth(), OneTurn())


def test_angles_are_the_controls_without_limits_in_which_the_equations_are_periodic():
    assert angles_without_limits(brachistochrone(), []) == [0]
    assert angles_without_limits(brachistochrone([(-4.0, 4.0)]), []) == []
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 4)
    rate = ca.vertcat(u[0] + ca.sin(u[1]) + u[2] ** 2, x[0] * ca.cos(u[1]) * ca.cos(u[3] / 2.0))
    problem = Problem(System(x, u, rate=rate), Free(1.0), Bolza(time=1.0), (start(x, 0.0),))
    assert angles_without_limits(problem, []) == [1]
    limited = Problem(System(x, u, rate=rate), Free(1.0), Bolza(time=1.0), (along(u[0] + u[1], 0.0, 1.0),))
    assert angles_without_limits(limited, []) == []


def test_bad_turns_are_refused():
    with pytest.raises(ValueError, match="turns"):
        OneTurn(0.5)
