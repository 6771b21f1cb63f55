"""Controls that the cost leaves open: recognised, and determined by a small cost on effort."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Fixed, Problem, System, gentle, point_to_point, solve, uniform
from ocp.arcs.least_effort import slack


def two_masses(near):
    """Return the minimum time of two masses, one moved by 1, the other by less, forces within 1."""
    q, v, u = (ca.SX.sym(letter, 2) for letter in "qvu")
    system = System(ca.vertcat(q, v), u, rate=ca.vertcat(v, u), signals={"q": q, "v": v, "tau": u})
    return point_to_point(system, [0.0, 0.0], [1.0, near], tau=1.0)


def test_the_slow_mass_sets_the_time_and_the_other_takes_the_least_effort():
    problem = two_masses(0.25)
    solution = solve(gentle(problem, 1e-3), grid=uniform(40))
    assert solution.duration == pytest.approx(2.0, rel=1e-3)
    t = np.array([0.0, solution.duration])
    # The motion of least effort has the linear force 6 d / T^2 (1 - 2 t / T).
    assert solution.signal("tau", t)[:, 1] == pytest.approx([0.375, -0.375], rel=5e-2)


def test_slack_is_recognised():
    problem = two_masses(0.25)
    message = slack(problem, solve(problem, grid=uniform(40)))
    assert "u_2" in message
    assert "u_1" not in message
    problem = two_masses(1.0)
    assert slack(problem, solve(problem, grid=uniform(40))) == ""


def test_costs_that_need_no_effort_are_refused():
    problem = two_masses(0.25)
    with pytest.raises(ValueError, match="no weight of the duration"):
        gentle(Problem(problem.system, Fixed(3.0), Bolza(), problem.subject_to))
    effort = Bolza(time=1.0, running=ca.sumsqr(problem.system.u))
    with pytest.raises(ValueError, match="determines all limited controls"):
        gentle(Problem(problem.system, problem.horizon, effort, problem.subject_to))
