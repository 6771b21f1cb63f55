"""Tools of arms along paths in space: on the path, consistent derivatives, torques of another way, refusals."""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from models import Motion, along_tool_path, arc, inverse_dynamics, line, robots, spherical, through_tool_points
from models.effects import Gravity
from models.rigid_bodies.joint import roll_pitch_yaw

READY = {
    "ur5": [0.0, -1.2, 1.5, -1.9, -1.57, 0.0],
    "panda": [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785],
    "puma560": [0.0, 0.5, -0.5, 0.1, 0.6, 0.0],
}


@cache
def arm_at(name):
    """Return an arm, a function q -> tool and its axes, and both at a usual position."""
    arm = getattr(robots, name)()
    place = ca.Function("tool", [arm.q], [arm.tool, ca.densify(arm.tool_axes)])
    point, axes = (part.full() for part in place(READY[name]))
    return arm, place, point.ravel(), axes


def places(place, q):
    values = [place(one) for one in q]
    return np.array([one[0].full().ravel() for one in values]), np.array([one[1].full() for one in values])


@pytest.mark.parametrize("name", READY)
@pytest.mark.parametrize("kind", ["free", "held", "turning"])
def test_the_tool_runs_along_a_line(name, kind):
    arm, place, point, axes = arm_at(name)
    path = line(point, point + np.array([0.1, 0.15, -0.1]))
    law = Motion.s_curve(0.0, path.length, 0.5, 2.0, 20.0)
    last = axes @ roll_pitch_yaw([0.3, -0.2, 0.4])
    rotation = {"free": None, "held": axes, "turning": (axes, last)}[kind]
    motion = along_tool_path(arm, path, law, near=READY[name], rotation=rotation)
    assert np.allclose(motion.q(0.0), READY[name], atol=1e-9)
    t = np.linspace(0.02, 0.98, 60) * motion.duration
    points, turned = places(place, motion.q(t))
    s = law.derivative(t, 0)[:, 0]
    assert np.max(np.abs(points - path(s, 0))) < 1e-12
    if kind == "held":
        assert np.max(np.abs(turned - axes)) < 1e-12
    if kind == "turning":
        angle = np.arccos((np.trace(axes.T @ last) - 1.0) / 2.0)
        along = np.arccos((np.einsum("ij,kij->k", axes, turned) - 1.0) / 2.0)
        assert np.allclose(along, angle * s / path.length, atol=1e-7)
        assert np.max(np.abs(places(place, [motion.q(motion.duration)])[1][0] - last)) < 1e-12
    h = 1e-5
    for order, most in ((0, 1e-8), (1, 1e-8), (2, 1e-6)):
        change = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2.0 * h)
        exact = motion.derivative(t, order + 1)
        off = np.abs(change - exact).max(axis=1) / np.max(np.abs(exact))
        assert np.quantile(off, 0.9) < most  # the third derivative of the law jumps at seven times
        assert np.max(off) < most or order == 2


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_joints_that_are_left_over_move_as_little_as_they_can(name):
    arm, _, point, _ = arm_at(name)
    path = line(point, point + np.array([0.1, 0.1, 0.0]))
    motion = along_tool_path(arm, path, Motion.quintic(0.0, path.length, 1.0), near=READY[name])
    slope = ca.Function("J", [arm.q], [ca.jacobian(arm.tool, arm.q)])
    for t in (0.2, 0.5, 0.8):
        jacobian = slope(motion.q(t)).full()
        needed = np.linalg.pinv(jacobian) @ (jacobian @ motion.v(t))
        assert np.max(np.abs(needed - motion.v(t))) < 1e-9 * np.max(np.abs(motion.v(t)))


def test_torques_of_a_circle_are_those_of_its_joints():
    arm, _, point, axes = arm_at("ur5")
    path = arc(point, *(point + np.array([[0.05, 0.05, 0.0], [0.1, 0.0, 0.0]])))
    motion = along_tool_path(arm, path, Motion.quintic(0.0, path.length, 1.5), near=READY["ur5"], rotation=axes)
    table = motion.torques(arm, [Gravity()], times=np.linspace(0.0, 1.5, 31))
    exact = inverse_dynamics(arm, [Gravity()])
    needed = [exact(motion.q(t), motion.v(t), motion.a(t), []).full().ravel() for t in table.t]
    assert np.allclose(table.tau, needed, rtol=1e-10, atol=1e-9)


def test_points_at_times():
    arm, place, point, axes = arm_at("panda")
    times = np.array([0.0, 0.5, 1.2, 2.0])
    points = point + np.array([[0.0, 0.0, 0.0], [0.05, 0.05, 0.0], [0.1, 0.0, 0.05], [0.1, -0.1, 0.05]])
    motion = through_tool_points(arm, times, points, near=READY["panda"], rotation=axes)
    found, turned = places(place, motion.q(times))
    assert np.max(np.abs(found - points)) < 1e-12
    assert np.max(np.abs(turned - axes)) < 1e-12
    assert np.max(np.abs(motion.v([0.0, 2.0]))) < 1e-10
    assert motion.notes == ("inverse kinematics: solution 1 of 9 that were found at the start, nearest first",)


LAW = Motion.quintic(0.0, 0.3, 1.0)


def lifted(length, **options):
    arm, _, point, _ = arm_at("ur5")
    path = line(point, point + np.array([0.0, 0.0, length]))
    return along_tool_path(arm, path, Motion.quintic(0.0, path.length, 1.0), near=READY["ur5"], **options)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: along_tool_path(robots.ur5(), line([2, 0, 0], [2, 0, 0.3]), LAW), "at the start cannot be reached"),
        (lambda: lifted(1.5), "along the path: the arm is singular there, or out of reach"),
        (lambda: lifted(0.1, hold={"elbow_joint": 0.0}), "hold: UR5 is an arm of links, whose beginning `near` choos"),
        (lambda: lifted(0.1, branch="elbow up"), "branch: UR5 is an arm of links"),
        (lambda: lifted(0.1, rotation=[1.0, 2.0]), "rotation"),
        (
            lambda: along_tool_path(spherical(), line([0, 1, 0], [0, 1, 0.3]), LAW, rotation=[0.0, 0.0, 0.0]),
            "as spherical has no joints to turn its tool",
        ),
    ],
)  # fmt: skip
def test_paths_that_cannot_be_followed(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_limits_are_those_of_the_arm_or_given():
    arm, _, point, _ = arm_at("ur5")
    path, law = line(point, point + np.array([0.0, 0.0, 0.3])), Motion.quintic(0.0, 0.3, 1.0)
    free = along_tool_path(arm, path, law, near=READY["ur5"])
    low, high = free.q(0.0) - 0.05, free.q(0.0) + 0.05
    with pytest.raises(ValueError, match="along the path: a joint would leave its limits there"):
        along_tool_path(arm, path, law, near=READY["ur5"], limits=(low, high))
