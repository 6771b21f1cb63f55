"""Inverse kinematics without limits, beyond full turns, and at singular poses, against closed forms."""

import casadi as ca
import numpy as np
import pytest

from models import Joint, Kind, Link, Motion, along_poses, along_tool_path, inverse_kinematics, line, robots, serial

LINK = Link(1.0, (0.1, 0.0, 0.0), (0.01, 0.01, 0.01))
PLANAR = serial([Joint("a", link=LINK), Joint("b", origin=(0.5, 0.0, 0.0), link=LINK)], tool=(0.4, 0.0, 0.0))


def closed_form(x, y, sign):
    """Return the angles of a planar arm of 0.5 and 0.4 m by the law of cosines."""
    elbow = sign * np.arccos((x**2 + y**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    return np.array([np.arctan2(y, x) - np.arctan2(0.4 * np.sin(elbow), 0.5 + 0.4 * np.cos(elbow)), elbow])


def pose(arm, q):
    tool = ca.Function("tool", [arm.q], [ca.densify(arm.tool), ca.densify(arm.tool_orientation)])
    point, axes = (part.full() for part in tool(q))
    return point.ravel(), axes


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_slides_without_limits_reach_any_point(scale):
    directions = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.6, 0.8))
    gantry = serial([Joint(f"s{i}", Kind.PRISMATIC, axis=axis, link=LINK) for i, axis in enumerate(directions)])
    point = scale * np.array([3.5, -4.0, 2.0])
    (found,) = inverse_kinematics(gantry, point)
    assert found == pytest.approx(np.linalg.solve(np.array(directions).T, point), rel=1e-8)


def test_slides_with_one_limit_start_within_it():
    rail = serial([Joint("s", Kind.PRISMATIC, axis=(1.0, 0.0, 0.0), lower=2.0, link=LINK), Joint("b", link=LINK)],
                  tool=(0.4, 0.0, 0.0))  # fmt: skip
    found = inverse_kinematics(rail, (5.0, 0.24, 0.0))
    assert np.sort(found[:, 0]) == pytest.approx([4.68, 5.32])
    assert np.sort(inverse_kinematics(rail, (2.0, 0.24, 0.0))[:, 0]) == pytest.approx([2.32])


def test_angles_are_those_of_the_nearest_full_turn():
    near = np.array([7.0, 0.3])
    found = inverse_kinematics(PLANAR, (0.6, 0.3, 0.0), near=near)
    wanted = np.array([closed_form(0.6, 0.3, sign) for sign in (1, -1)]) + np.array([2 * np.pi, 0.0])
    order = np.argsort(np.linalg.norm(wanted - near, axis=1))
    assert found == pytest.approx(wanted[order], abs=1e-7)


def test_joints_without_limits_turn_on():
    angle = np.linspace(0.0, 8.0, 60)
    points = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.zeros(60)], axis=1)
    path = along_poses(PLANAR, points, near=(0.0, 1.0))
    assert path == pytest.approx(closed_form(0.6, 0.0, 1) + np.stack([angle, np.zeros(60)], axis=1), abs=1e-7)


@pytest.mark.slow
def test_a_path_begins_full_turns_away_where_the_limits_need_it():
    # The last joint turns by 11 rad, of 4 pi that it has.
    arm = robots.ur5()
    begin = np.array([0.3, -1.0, 1.0, 0.2, -0.4, 0.4])
    point, axes = pose(arm, begin)
    turns = [axes @ pose_about_z(angle) for angle in np.linspace(0.0, 11.0, 80)]
    path = along_poses(arm, np.tile(point, (80, 1)), turns, near=begin)
    assert path[:, :5] == pytest.approx(np.tile(begin[:5], (80, 1)), abs=1e-6)
    assert path[:, 5] == pytest.approx(np.linspace(0.0, 11.0, 80) + 0.4 - 2 * np.pi, abs=1e-6)
    # The same for a motion of the tool: from 5.9 the joint would leave its limit of 2 pi.
    point, axes = pose(arm, begin := np.array([0.3, -1.0, 1.0, 0.2, -0.4, 5.9]))
    path = line(point, point + np.array([0.0, 0.0, 0.01]))
    law = Motion.quintic(0.0, path.length, 1.0)
    motion = along_tool_path(arm, path, law, near=begin, rotation=(axes, axes @ pose_about_z(3.0)))
    assert motion.q(0.0)[5] == pytest.approx(5.9 - 2 * np.pi)
    assert np.max(motion.q(np.linspace(0.0, 1.0, 50))) <= 2 * np.pi


def pose_about_z(angle):
    return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])


def test_a_singular_wrist_is_one_branch_nearest_to_what_is_wanted():
    # With q5 = 0 only q4 + q6 = 0.8 matters; the nearest to equal angles has 0.4 each.
    arm = robots.puma560()
    begin = np.array([0.2, 0.3, 0.4, 0.5, 0.0, 0.3])
    point, axes = pose(arm, begin)
    found = inverse_kinematics(arm, point, axes)
    assert len(found) <= 8  # 76 points of the curves before
    assert found[0] == pytest.approx([0.2, 0.3, 0.4, 0.4, 0.0, 0.4], abs=1e-5)
    own = inverse_kinematics(arm, point, axes, near=begin)
    assert own[0] == pytest.approx(begin, abs=1e-6)


def test_a_stretched_arm_has_one_solution():
    found = inverse_kinematics(PLANAR, (0.9 * np.cos(1.0), 0.9 * np.sin(1.0), 0.0))
    assert found == pytest.approx(np.array([[1.0, 0.0]]), abs=1e-4)
    assert len(inverse_kinematics(PLANAR, (0.9 + 1e-6, 0.0, 0.0))) == 0


@pytest.mark.parametrize("rotation", [[1.0, 2.0], 2 * np.eye(3), [0.0, float("nan"), 0.0]])
def test_a_rotation_that_is_none_is_called_by_its_argument(rotation):
    with pytest.raises(ValueError, match=r"^rotation: "):
        inverse_kinematics(PLANAR, (0.6, 0.3, 0.0), rotation)
    with pytest.raises(ValueError, match=r"^tool_rotation: "):
        serial([Joint("a", link=LINK)], tool_rotation=rotation)
