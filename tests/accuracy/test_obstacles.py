"""Obstacles between the nodes: held by the solve, and measured by verify against the size of the obstacle."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

import ocp
from models import torus
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Ball,
    Bolza,
    Box,
    Cylinder,
    Fixed,
    Free,
    Problem,
    System,
    along,
    end,
    outside,
    point_to_point,
    prepare,
    solve,
    start,
    uniform,
    verify,
)
from ocp.accuracy.violation_costs import cost_of_violations

ARM = canonical(torus(), [Gravity()])
TASK = point_to_point(
    ARM, [0.0, 0.4, -0.9], [2.0, 0.8, -1.3], tau=[250.0, 600.0, 220.0], q=([-3.0, -0.3, -2.6], [3.0, 2.0, 2.6])
)
CENTRE = np.array([0.262, 0.315, -0.049])  # 0.24 mm beside the path of the tool without the obstacle
TOOL = ARM["tool"]
APART = ca.sumsqr(TOOL - CENTRE)
# The same ball of 1 cm said in several ways, and other bodies around the same point with the least distance they leave.
BODIES = {
    "ball": (outside(Ball(CENTRE, 0.01), TOOL), 0.01),
    "ball of 2 cm": (outside(Ball(CENTRE, 0.02), TOOL), 0.02),
    "ball of 1 mm": (outside(Ball(CENTRE, 0.001), TOOL), 0.001),
    "square of the distance": (along(APART, lower=1e-4), 0.01),
    "square against zero": (along(APART - 1e-4, lower=0.0), 0.01),
    "negative square": (along(-APART, upper=-1e-4), 0.01),
    "square with a far upper side": (along(APART, 1e-4, 100.0), 0.01),
    "distance": (along(ca.norm_2(TOOL - CENTRE), lower=0.01), 0.01),
    "distance against zero": (along(ca.norm_2(TOOL - CENTRE) - 0.01, lower=0.0), 0.01),
    "cylinder": (outside(Cylinder(CENTRE, [0.0, 0.0, 1.0], 0.01), TOOL), 0.01),
    "box": (outside(Box(CENTRE - 0.01, CENTRE + 0.01), TOOL), 0.01),
}


def distance(solution, axes=slice(None)):
    """Return the least distance of the tool from the point, on a grid of 40000 times."""
    t = np.linspace(0.0, solution.duration, 40001)
    return np.min(np.linalg.norm((solution.signal("tool", t) - CENTRE)[:, axes], axis=1))


def with_body(name):
    return replace(TASK, subject_to=(*TASK.subject_to, BODIES[name][0]))


@cache
def through(name):
    """Solve with the constraints at the nodes alone."""
    return prepare(with_body(name), grid=uniform(25))()


@pytest.mark.parametrize("name", BODIES)
def test_a_motion_through_an_obstacle_is_not_verified(name):
    solution = through(name)
    assert solution.ok
    assert distance(solution) < 0.3 * BODIES[name][1]  # it passes right through
    report = verify(solution)
    assert not report.ok
    assert 0.5 < report.violation <= 1.0 + 1e-9
    assert "a limit is exceeded" in report.failures[0]
    assert report.violation.at == pytest.approx(0.2256, abs=3e-3)


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("ball of 1 mm", "distance", "cylinder", "box")]


@pytest.mark.parametrize("name", ["ball", "square against zero", *SLOW])
def test_solve_keeps_out_between_the_nodes(name):
    solution = solve(with_body(name), grid=uniform(25))
    assert solution.ok
    axes = slice(0, 2) if name == "cylinder" else slice(None)
    assert distance(solution, axes) >= 0.998 * BODIES[name][1]
    assert len(solution.grid) > 25
    assert f"solved again with {len(solution.grid)} elements instead of 25" in solution.message
    assert verify(solution).violation < 2e-3
    # Where the motion keeps clear, nothing is solved again.
    assert len(solve(TASK, grid=uniform(25)).grid) == 25


def test_the_deepest_point_is_found_between_samples():
    # A point on a straight line at constant speed passes a disc of radius R in the distance d R at t = 0.43: the excess
    # of 1 - |r - c|^2/R^2 is 1 - d^2, in a time that is short against the samples.
    x, u, radius, d = ca.SX.sym("x", 2), ca.SX.sym("u", 1), 1e-5, 0.3
    line = System(x, u, ca.SX(0, 1), ca.vertcat(1.0, u))
    task = Problem(line, Fixed(1.0), Bolza(running=u**2), (
        start(x, 0.0), outside(Ball([0.43, d * radius], radius), x)))  # fmt: skip
    straight = prepare(task, grid=uniform(10))()
    assert np.max(np.abs(straight.states[..., 1])) < 1e-12
    report = verify(straight)
    assert float(report.excess[-1]) == pytest.approx(1.0 - d**2, rel=1e-6)
    assert report.violation.at == pytest.approx(0.43, abs=1e-8)


@pytest.mark.parametrize(("expression", "limits", "excess", "share"), [
    # name of the case: x runs from 0 to 1, y = x (1 - x); the scale is the width, the range, the depth or the limit.
    (lambda x: x[0], (0.0, 0.9), 0.1, 0.1 / 0.9),  # between two limits: their distance
    (lambda x: x[0], (-np.inf, 0.9), 0.1, 0.1),  # of a coordinate: its range
    (lambda x: x[0] + 300.0, (-np.inf, 300.9), 0.1, 0.1),  # linear with an origin of its own
    (lambda x: ca.sumsqr(x[0] - 0.5), (1e-4, np.inf), 1e-4, 1.0),  # a forbidden interval, crossed in the middle
    (lambda x: 50.0 * ca.sumsqr(x[0] - 0.5), (50e-4, np.inf), 50e-4, 1.0),  # in other units
    (lambda x: ca.sumsqr(x[0] - 0.5) + 7.0, (7.0001, np.inf), 1e-4, 1.0),  # with another origin
    (lambda x: ca.sumsqr(x[0] - 0.5), (-np.inf, 0.16), 0.09, 0.09 / 0.16),  # an interval that is left
])  # fmt: skip
def test_the_scale_of_a_limit_is_physical(expression, limits, excess, share):
    x, u = ca.SX.sym("x", 1), ca.SX.sym("u")
    line = System(x, u, ca.SX(0, 1), 1.0 + 0.0 * u)
    free = Problem(line, Fixed(1.0), Bolza(running=u**2), (start(x, 0.0),))
    motion = solve(free, grid=uniform(7))
    report = verify(motion, replace(free, subject_to=(*free.subject_to, along(expression(x), *limits))))
    assert float(report.excess[-1]) == pytest.approx(excess, rel=1e-6)
    assert report.violation == pytest.approx(share, rel=1e-3)


@pytest.mark.slow
def test_no_grid_lets_a_collision_pass():
    for elements in range(20, 61, 5):
        solution = solve(with_body("ball"), grid=uniform(elements))
        assert not verify(solution).ok or distance(solution) > 0.998 * 0.01, elements


def test_several_obstacles_in_a_row():
    # A point mass in the plane between three posts of 5 mm on its straight path, in least time.
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    mass = System(x, u, ca.SX(0, 1), ca.vertcat(x[2:], u))
    posts = [np.array([c, 0.0005 * (-1) ** k]) for k, c in enumerate((0.23, 0.5, 0.77))]
    task = Problem(mass, Free(2.0), Bolza(time=1.0), (
        start(x, 0.0), end(x, [1.0, 0.0, 0.0, 0.0]), along(u, -1.0, 1.0),
        *(outside(Ball(post, 0.005), x[:2]) for post in posts)))  # fmt: skip
    solution = solve(task, grid=uniform(20))
    assert solution.ok, solution.message
    path = solution.x(np.linspace(0.0, solution.duration, 40001))[:, :2]
    for post in posts:
        assert np.min(np.linalg.norm(path - post, axis=1)) > 0.998 * 0.005


def test_an_equation_along_the_motion_does_not_hide_what_an_obstacle_is_worth():
    x, u, w = ca.SX.sym("x", 4), ca.SX.sym("u", 2), ca.SX.sym("w")
    costs = []
    for more in (False, True):
        system = System(x, ca.vertcat(u, w) if more else u, None, ca.vertcat(x[2:], u))
        ends = ocp.start(x, 0.0), ocp.end(x, [2.0, 0.0, 0.0, 0.0]), along(u, -1.0, 1.0)
        equation = (along(w - u[0], 0.0, 0.0),) if more else ()
        # The motion keeps clear of the smaller disc, and so passes through the rim of the larger one.
        horizon, effort = Fixed(3.0), Bolza(running=ca.sumsqr(u))
        posed, wider = (
            Problem(system, horizon, effort, (*ends, ocp.outside(Ball((1.0, -0.1), radius), x[:2]), *equation))
            for radius in (0.3, 0.31)
        )
        solution = ocp.prepare(posed, grid=ocp.uniform(12))()
        assert solution.ok, solution.message
        costs.append(float(cost_of_violations(solution, wider)[0].sum()))
    assert costs[0] > 0.0
    assert costs[1] == pytest.approx(costs[0], rel=1e-3)
