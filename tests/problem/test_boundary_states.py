"""States at the ends of a motion: nonlinear conditions lead to the nearest state that keeps the limits."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Free, Problem, System, along, end, start
from ocp.problem.boundary_states import ends


def problem(*conditions):
    """Return the shortest motion of a mass in the plane from (0.1, 0) at rest."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    system = System(x, u, rate=ca.vertcat(x[2:], u), signals={"r": x[:2], "w": x[2:]})
    own = [one(x) for one in conditions]
    begin = (start(system["r"], [0.1, 0.0]), start(system["w"], 0.0), end(system["w"], 0.0))
    return Problem(system, Free(guess=1.0), Bolza(time=1.0), (*begin, along(u, -1.0, 1.0), *own))


def on_a_circle(x):
    return end(ca.vertcat(ca.sumsqr(x[:2]), x[0] * x[1]), [1.0, 0.0])


def test_the_nearest_of_several_states():
    first, last, (start_fixed, end_fixed) = ends(problem(on_a_circle), [])
    assert first == pytest.approx([0.1, 0.0, 0.0, 0.0])
    assert last == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-12)
    assert start_fixed
    assert not end_fixed  # three other states satisfy the conditions


def test_the_nearest_that_keeps_the_limits_along_the_motion():
    _, last, _ = ends(problem(on_a_circle, lambda x: along(x[:2], [-2.0, -2.0], [0.5, 2.0])), [])
    assert abs(last[0]) == pytest.approx(0.0, abs=1e-12)
    assert abs(last[1]) == pytest.approx(1.0)
    curved = lambda x: along(x[0] ** 2 + x[0] - x[1] ** 3, upper=0.5)  # noqa: E731  # at (1, 0), (0, -1): beyond
    _, last, _ = ends(problem(on_a_circle, curved), [])
    assert last == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-12)


def test_linear_conditions_determine_the_state():
    fixed = lambda x: end(ca.vertcat(x[0] + x[1], x[0] - x[1]), [1.0, 0.0])  # noqa: E731
    _, last, (_, whole) = ends(problem(fixed), [])
    assert whole
    assert np.max(np.abs(last - [0.5, 0.5, 0.0, 0.0])) < 1e-14


def test_conditions_that_are_linear_once_others_are_fixed_determine_the_state():
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    system = System(x, u, rate=ca.vertcat(x[2:], u), signals={"r": x[:2], "w": x[2:]})
    momenta = (1.0 + x[0] ** 2) * ca.vertcat(x[2] + x[3], x[3])
    conditions = (start(x, 0.0), end(x[:2], [1.0, 2.0]), end(momenta, [2.0, 1.0]))
    _, last, (_, whole) = ends(Problem(system, Free(guess=1.0), Bolza(time=1.0), conditions), [])
    assert whole
    assert last == pytest.approx([1.0, 2.0, 0.5, 0.5], abs=1e-12)


def test_conditions_without_a_solution_leave_the_guess_finite():
    _, last, (_, whole) = ends(problem(lambda x: end(ca.sumsqr(x[:2]) + 1.0, 0.0)), [])
    assert not whole
    assert np.all(np.isfinite(last))
