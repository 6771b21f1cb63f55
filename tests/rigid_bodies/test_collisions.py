"""Links, obstacles, floor and self-collision: constraints cover the capsules, distances are those of geometry."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import Joint, Kind, Link, serial, spherical
from models.effects import Gravity
from models.forms import canonical
from models.rigid_bodies import Capsule, body_capsule, keep_clear, least_clearance, with_shapes
from ocp import Ball, Box, Cylinder, HalfSpace, Problem, point_to_point, solve, uniform


def planar():
    """Return an arm of two links of 0.5 m that turn about vertical axes, with capsules of 5 cm."""
    link = Link(4.0, (0.25, 0.0, 0.0), (0.01, 0.1, 0.1), (Capsule((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.05),))
    joints = [
        Joint("q1", link=link, effort=20.0),
        Joint("q2", origin=(0.5, 0.0, 0.0), link=link, effort=10.0),
    ]
    return serial(joints, tool=(0.5, 0.0, 0.0))


def test_distances_are_those_of_geometry():
    arm = planar()
    straight = [[0.0, 0.0]]
    assert least_clearance(arm, straight, [Ball((0.75, 0.3, 0.0), 0.1)]) == {"Ball_1": pytest.approx(0.15)}
    assert least_clearance(arm, straight, [HalfSpace((0, 0, -0.2), (0, 0, 1))])["HalfSpace_1"] == pytest.approx(0.15)
    assert least_clearance(arm, straight, [Box((0.7, 0.2, -1), (0.8, 0.4, 1))])["Box_1"] == pytest.approx(0.15)
    post = Cylinder((0.75, 0.4, 0.0), (0, 0, 1), 0.1, 2.0)
    assert least_clearance(arm, straight, [post])["Cylinder_1"] == pytest.approx(0.25)
    assert least_clearance(arm, straight, floor=-0.3)["floor"] == pytest.approx(0.25)
    folded = least_clearance(arm, [[0.0, np.pi]], pairs=[("q1", "q2")])
    assert folded["q1, q2"] == pytest.approx(-0.1)
    assert least_clearance(arm, [[0.0, 0.0]], [Ball((0.75, 0.0, 0.0), 0.1)])["Ball_1"] < 0.0


def test_capsules_of_fixed_joints_ride_along():
    shape = Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.2), 0.03)

    arm = serial([
        Joint("q1", link=Link(1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))),
        Joint("hand", Kind.FIXED, origin=(0.3, 0.0, 0.0), link=Link(0.5, capsules=(shape,))),
    ])  # fmt: skip
    (own,) = arm.shapes
    ends = [ca.Function("end", [arm.q], [end])(np.pi / 2).full().ravel() for end in (own.start, own.end)]
    assert np.allclose(ends, [[0.0, 0.3, 0.0], [0.0, 0.3, 0.2]], atol=1e-15)


def test_spheres_contain_the_capsule():
    arm = planar()
    ball = Ball((0.75, 0.3, 0.0), 0.1)
    constraints = keep_clear(arm, [ball], clearance=0.01)
    values = ca.vertcat(*(c.expression for c in constraints))
    function = ca.Function("c", [arm.q], [ca.mmin(values)])
    rng = np.random.default_rng(0)
    for q in rng.uniform(-1.5, 1.5, (200, 2)):
        if float(function(q)) >= 1.0:  # allowed by the constraints: then really clear
            assert least_clearance(arm, q, [ball])["Ball_1"] >= 0.01 - 1e-9
    assert any(float(function(q)) < 1.0 for q in rng.uniform(-1.5, 1.5, (50, 2)))


@pytest.mark.slow
def test_a_motion_keeps_clear_between_the_nodes():
    machine = planar()
    arm = canonical(machine, [Gravity()])
    ball = Ball((0.75, 0.35, 0.0), 0.1)
    free = point_to_point(arm, [0.0, 0.0], [1.2, 0.3], limits=machine.limits)
    clear = replace(free, subject_to=(*free.subject_to, *keep_clear(machine, [ball], clearance=0.02)))
    assert isinstance(clear, Problem)
    found = {}
    for name, problem in (("free", free), ("clear", clear)):
        solution = solve(problem, grid=uniform(30))
        assert solution.ok
        q = solution.signal("q", np.linspace(0.0, float(solution.duration), 2001))
        found[name] = solution.duration, least_clearance(machine, q, [ball])["Ball_1"]
    assert found["free"][1] < 0.0
    assert found["clear"][1] > 0.015  # 2 cm at the nodes, 5 mm are left for what lies between them
    assert found["clear"][0] > found["free"][0]


def test_the_machines_of_the_paper_take_capsules_too():
    machine = spherical()
    shaped = with_shapes(machine, [body_capsule(machine, "arm", Capsule((0, 0, -0.4), (0, 0, 0.45), 0.06))])
    distance = least_clearance(shaped, [[0.0, 0.0, 0.0, 0.9]], [Ball((0.0, 0.0, 2.0), 0.1)])["Ball_1"]
    assert distance == pytest.approx(2.0 - 0.1 - (0.9 + 0.45) - 0.06)
    assert keep_clear(shaped, [Ball((0.0, 0.0, 2.0), 0.1)], floor=0.1)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: keep_clear(spherical()), "spherical has no capsules"),
        (lambda: keep_clear(planar(), [1.0]), "expected a Ball, Box, Cylinder or HalfSpace"),
        (lambda: keep_clear(planar(), pairs=[("q1", "q9")]), "expected two bodies with capsules of q1, q2"),
        (lambda: keep_clear(planar(), clearance=-0.1), "clearance"),
        (lambda: body_capsule(planar(), "q9", Capsule((0, 0, 0), (0, 0, 1), 0.1)), "has no body 'q9'"),
        (lambda: Capsule((0, 0, 0), (0, 0, 1), 0.0), "a radius > 0"),
    ],
)
def test_wrong_arguments(call, words):
    with pytest.raises((ValueError, TypeError), match=words):
        call()
