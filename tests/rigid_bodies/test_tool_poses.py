"""Inverse kinematics of any arm: all branches, orientation, redundancy, paths, and as boundary conditions."""

import casadi as ca
import numpy as np
import pytest

from models import Parameter, along_poses, inverse_kinematics, orientation_error, robots, torus
from models.effects import Gravity
from models.forms import canonical
from ocp import Bolza, Free, Guess, Problem, along, end, solve, start, uniform


def tool_of(arm):
    return ca.Function("tool", [arm.q], [ca.densify(arm.tool), ca.densify(arm.tool_orientation)])


def apart(one, other):
    return np.max(np.abs(np.angle(np.exp(1j * (one - other)))), axis=-1)


@pytest.mark.parametrize(("make", "branches"), [(robots.ur5, 8), (robots.puma560, 4)], ids=["ur5", "puma"])
def test_all_branches_of_six_axes_are_found(make, branches):
    arm = make()
    tool, rng = tool_of(arm), np.random.default_rng(3)
    lower, upper = (np.clip(side, -2.5, 2.5) for side in arm.limits["q"])
    most = 0
    for _ in range(5):
        given = rng.uniform(lower, upper)
        place, axes = (part.full() for part in tool(given))
        solutions = inverse_kinematics(arm, place.ravel(), axes)
        most = max(most, len(solutions))
        assert np.min(apart(solutions, given)) < 1e-8
        for q in solutions:
            again, turned = (part.full() for part in tool(q))
            assert np.max(np.abs(again - place)) < 1e-8
            assert np.max(np.abs(turned - axes)) < 1e-8
            assert np.all(q >= np.array(arm.limits["q"][0]) - 1e-8)
            assert np.all(q <= np.array(arm.limits["q"][1]) + 1e-8)
    assert most == branches


def test_four_positions_of_three_axes_as_in_closed_form():
    # The closed form of the torus knows all four branches.
    arm = torus()
    point = np.array([0.7, 0.3, 0.4])
    closed = arm.inverse(point[None]).q[0]
    found = inverse_kinematics(arm, point)
    assert len(found) == 4
    for q in closed:
        assert np.min(apart(found, q)) < 1e-7


def test_a_redundant_arm_stays_near_what_is_wanted():
    arm = robots.panda()
    near = np.array([0.2, 0.3, -0.1, -1.6, 0.1, 1.9, 0.3])
    place, axes = (part.full() for part in tool_of(arm)(near))
    found = inverse_kinematics(arm, place.ravel(), axes, near=near)
    assert np.max(np.abs(found[0] - near)) < 1e-6  # it is itself a solution
    away = inverse_kinematics(arm, place.ravel(), axes)
    assert len(away) > 0
    assert np.linalg.norm(away[0] - near) > 1e-3


def test_points_out_of_reach_have_no_solution():
    assert inverse_kinematics(robots.ur5(), (3.0, 0.0, 0.0)).shape == (0, 6)


def test_a_path_never_jumps_and_a_jump_is_refused():
    arm = robots.ur5()
    begin = np.array([0.0, -1.0, 1.0, 0.0, 0.5, 0.0])
    place, axes = (part.full() for part in tool_of(arm)(begin))
    points = place.ravel() + np.linspace(0, 1, 30)[:, None] * np.array([0.0, 0.2, -0.1])
    path = along_poses(arm, points, [axes] * 30, near=begin)
    assert np.allclose(path[0], begin, atol=1e-7)
    assert np.max(np.abs(np.diff(path, axis=0))) < 0.1
    reached = np.array([tool_of(arm)(q)[0].full().ravel() for q in path])
    assert np.max(np.abs(reached - points)) < 1e-8
    far = place.ravel() + np.linspace(0, 1, 10)[:, None] * np.array([2.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="every branch jumps, ends or leaves the limits at point"):
        along_poses(arm, far, [axes] * 10, near=begin)


def test_parameters_that_stay_symbols_are_refused():
    with pytest.raises(ValueError, match=r"m_3 stay symbols"):
        inverse_kinematics(torus(m_3=Parameter(18.0)), (0.7, 0.3, 0.4))


@pytest.mark.slow
def test_a_motion_ends_at_a_pose_of_the_tool():
    machine = robots.ur5()
    arm = canonical(machine, [Gravity()])
    q0 = np.array([0.0, -1.0, 1.0, 0.0, 0.5, 0.0])
    place, axes = (part.full() for part in tool_of(machine)(np.array([0.6, -0.7, 0.8, 0.2, 0.3, 0.2])))
    goal = inverse_kinematics(machine, place.ravel(), axes, near=q0)[0]
    rest = arm["rest"]
    problem = Problem(arm, Free(guess=0.5), Bolza(time=1.0), (
        start(arm["q"], q0), start(rest, 0.0), end(arm["tool"], place.ravel()), end(orientation_error(arm, axes), 0.0),
        end(rest, 0.0), along(arm["tau"], *machine.limits["tau"]), along(arm["q"], *machine.limits["q"]),
    ))  # fmt: skip
    share = np.linspace(0.0, 1.0, 11)
    x = np.hstack([q0 + (goal - q0) * share[:, None], np.zeros((11, 6))])
    solution = solve(problem, grid=uniform(15), guess=Guess(share, x, np.zeros((11, 6)), 0.5, np.zeros(0)))
    assert solution.ok
    reached, turned = (part.full() for part in tool_of(machine)(solution.signal("q", solution.t[-1:])[0]))
    assert np.max(np.abs(reached - place)) < 1e-6
    assert np.max(np.abs(turned - axes)) < 1e-5
