"""Links, obstacles, floor and self-collision: constraints cover the capsules, distances are those of geometry."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import Joint, Kind, Link, Parameter, cylindrical, robots, serial, spherical, torus, tree
from models.effects import Gravity
from models.forms import canonical
from models.rigid_bodies import (
    Capsule,
    body_capsule,
    keep_clear,
    least_clearance,
    self_pairs,
    skeleton_shapes,
    with_shapes,
)
from models.rigid_bodies.region_distances import nearness, signed_distance
from ocp import Ball, Box, Cylinder, HalfSpace, Problem, along, point_to_point, solve, uniform, verify


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


@pytest.mark.parametrize(
    "region",
    [
        Ball((0.75, 0.3, 0.0), 0.1),
        Box((0.7, 0.25, -0.4), (0.8, 0.35, 0.4)),
        Cylinder((0.75, 0.3, 0.0), (0, 0, 1), 0.05, 0.6),
        Cylinder((0.75, 0.3, 0.0), (0, 0, 1), 0.05),
        HalfSpace((0.0, 0.3, 0.0), (0.0, -1.0, 0.0)),
    ],
)
def test_what_is_allowed_between_the_nodes_is_the_margin(region):
    arm = planar()
    constraints = keep_clear(arm, [region], clearance=0.02, margin=0.004)
    slack = ca.vertcat(*(c.expression - (1.0 - c.between) for c in constraints))
    function = ca.Function("slack", [arm.q], [ca.mmin(slack)])
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (3000, 2))
    left = function.map(len(q))(q.T).full().ravel()
    nearest = q[np.argsort(np.where(left >= 0.0, left, np.inf))[:60]]
    least = [next(iter(least_clearance(arm, one, [region]).values())) for one in nearest]
    assert 60 < np.count_nonzero(left >= 0.0) < 2940
    assert 0.02 - 1e-12 <= min(least) < 0.07  # balls along the capsule and rounded edges keep a few centimetres more


@pytest.mark.parametrize(
    "region",
    [
        Ball((0.1, 0.2, 0.3), 0.2),
        Box((-0.5, -0.4, 0.0), (0.5, 0.4, 0.02)),
        Box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)),
        Cylinder((0.1, 0.0, 0.2), (0.3, 0.1, 1.0), 0.05, 0.8),
        Cylinder((0.1, 0.0, 0.2), (0.0, 1.0, 1.0), 0.4, 0.1),
        Cylinder((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1),
        HalfSpace((0.0, 0.0, 0.1), (0.2, 0.0, 1.0)),
    ],
)
@pytest.mark.parametrize("by", [0.02, 0.1])
def test_nearness_is_reached_only_at_the_distance(region, by):
    point = ca.SX.sym("point", 3)
    ratio, scale = nearness(region, by, point)
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (40_000, 3))
    apart = signed_distance(region)(points)
    values = ca.Function("ratio", [point], [ratio]).map(len(points))(points.T).full().ravel()
    assert np.min(apart[values >= 1.0]) >= by - 1e-9
    # A spare distance as a share of the scale is not exceeded.
    assert np.min(apart[values >= 1.0 - 0.01 / scale]) >= by - 0.01 - 1e-9
    # What is excluded in excess is small: at most 5 % of the widest half, and 3 cm at corners.
    assert np.max(apart[values < 1.0]) <= by + 0.05 * scale + 0.03


def test_the_least_distance_from_a_corner_is_exact():
    # The edge of a thin box is nearest between two of the points that are sampled along a capsule.
    arm, post = planar(), Box((0.7062, 0.12, -1.0), (0.7063, 0.2, 1.0))
    assert least_clearance(arm, [0.0, 0.0], [post])["Box_1"] == pytest.approx(0.07, abs=1e-12)
    corners = [np.array([x, 0.12])[:, None] - _arm_points(-0.5) for x in (0.7062, 0.7063)]
    apart = min(float(np.min(np.hypot(*one))) for one in corners) - 0.05
    assert least_clearance(arm, [0.0, -0.5], {"post": post})["post"] == pytest.approx(apart, abs=1e-7)


def _arm_points(turn):
    share = np.linspace(0.0, 0.5, 1_000_001)
    second = np.array([0.5 + share * np.cos(turn), share * np.sin(turn)])
    return np.hstack([np.array([share, 0.0 * share]), second])


def test_lines_of_a_skeleton_are_as_long_as_slides_let_them_be():
    for within, length in ((None, 1.55), (((0, 0, 0, 0.5), (1, 1, 1, 0.9)), 0.75)):
        shapes = skeleton_shapes(spherical(s_2=0.15), 0.05, within)
        assert shapes[1].length == pytest.approx(max(length, 0.0) if within else 2.15, abs=1e-9)
    with pytest.raises(ValueError, match="l_T: stays a symbol"):
        skeleton_shapes(spherical(l_T=Parameter(0.4)), 0.05)
    heavy = spherical(m_3=Parameter(15.0))
    shaped = with_shapes(heavy, skeleton_shapes(heavy, 0.05))
    assert least_clearance(shaped, [[0.5, 0.0, 0.0, 0.9]], floor=-2.0)["floor"] > 0.0
    assert keep_clear(shaped, floor=-2.0)


def test_what_is_allowed_between_the_nodes_for_floor_and_pairs():
    arm = planar()
    floor, pair = keep_clear(arm, floor=-0.1, pairs=[("q1", "q2")], clearance=0.03, margin=0.005)
    assert floor.between == 0.005
    assert np.allclose(floor.lower, -0.1 + 0.035)
    q = np.random.default_rng(3).uniform(1.5, 3.2, (500, 2)) * [0.0, 1.0]
    function = ca.Function("pair", [arm.q], [ca.mmin(pair.expression)])
    allowed = q[function.map(len(q))(q.T).full().ravel() >= 1.0 - pair.between]
    assert len(allowed) == 0  # neighbours touch at their joint, whatever the angle


@pytest.mark.slow
@pytest.mark.parametrize("elements", [10, 30])
def test_a_motion_keeps_clear_between_the_nodes(elements):
    machine = planar()
    arm = canonical(machine, [Gravity()])
    ball = Ball((0.75, 0.35, 0.0), 0.1)
    free = point_to_point(arm, [0.0, 0.0], [1.2, 0.3], limits=machine.limits)
    clear = replace(free, subject_to=(*free.subject_to, *keep_clear(machine, [ball], clearance=0.02)))
    assert isinstance(clear, Problem)
    found = {}
    for name, problem in (("free", free), ("clear", clear)):
        solution = solve(problem, grid=uniform(elements))
        assert solution.ok
        q = solution.signal("q", np.linspace(0.0, float(solution.duration), 4001))
        found[name] = solution.duration, least_clearance(machine, q, [ball])["Ball_1"]
    assert found["free"][1] < 0.0
    assert found["clear"][1] >= 0.02
    assert found["clear"][0] > found["free"][0]
    assert verify(solution).violation < 1e-3


def test_robots_have_the_shapes_of_their_makers():
    panda = robots.panda()
    ends = ca.Function("ends", [panda.q], [ca.horzcat(*(p for s in panda.shapes for p in (s.start, s.end)))])
    points = ends([0.0] * 7).full().T.reshape(-1, 2, 3)
    # Upright at q = 0: link 1 below the shoulder, the flange 0.107 m below joint 7, fingers along the diagonal.
    assert np.allclose(points[0, :, 2], [0.333 - 0.1915 - 0.1415, 0.333 - 0.1915 + 0.1415])
    assert np.allclose(points[-1].mean(axis=0), [0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.207])
    assert np.linalg.norm(points[-1, 1] - points[-1, 0]) == pytest.approx(0.1)
    assert np.allclose(np.abs((points[-1, 1] - points[-1, 0]) / 0.1), [np.sqrt(0.5), np.sqrt(0.5), 0.0])
    pairs = self_pairs(panda)
    assert ("panda_joint2", "panda_joint7") in pairs
    assert not any(abs(int(a[-1]) - int(b[-1])) < 2 for a, b in pairs)
    ready = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]  # the pose that the maker calls ready
    assert min(least_clearance(panda, ready, pairs=pairs, floor=0.0).values()) > 0.01
    for make in (robots.ur5, robots.ur10):
        arm = make()
        elbow = [0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0]
        assert min(least_clearance(arm, elbow, pairs=self_pairs(arm), floor=0.0).values()) > 0.0
        folded = [0.0, -np.pi / 2, np.pi - 0.2, 0.0, 0.0, 0.0]
        assert min(least_clearance(arm, folded, pairs=self_pairs(arm)).values()) < 0.0
    assert self_pairs(robots.arm_3r()) == ()


def test_skeletons_get_capsules():
    for machine in (spherical(), torus(), cylindrical()):
        shaped = with_shapes(machine, skeleton_shapes(machine, 0.05))
        tool = ca.Function("tool", [machine.q], [machine.tool])
        q = [0.4, 0.3, 0.5, 0.9][: len(machine.coordinates)]
        above = float(tool(q)[2]) - 0.05
        assert least_clearance(shaped, [q], floor=-1.0)["floor"] <= above + 1.0 + 1e-12
        assert keep_clear(shaped, [Ball((2.0, 0.0, 1.0), 0.1)], floor=-1.0)
    with pytest.raises(ValueError, match="radius"):
        skeleton_shapes(spherical(), 0.0)


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
        (lambda: keep_clear(planar(), margin=0.0), "margin"),
        (lambda: along(ca.SX.sym("x"), 0.0, between=0.0), "between"),
        (lambda: body_capsule(planar(), "q9", Capsule((0, 0, 0), (0, 0, 1), 0.1)), "has no body 'q9'"),
        (lambda: Capsule((0, 0, 0), (0, 0, 1), 0.0), "a radius > 0"),
    ],
)
def test_wrong_arguments(call, words):
    with pytest.raises((ValueError, TypeError), match=words):
        call()


@pytest.mark.parametrize("make", [robots.manutec_r3, torus], ids=["manutec", "torus"])
def test_the_link_at_the_base_is_kept_clear_as_well(make):
    # The first line of these skeletons is a link that swings; it was left out before.
    machine = make()
    shaped = with_shapes(machine, skeleton_shapes(machine, 0.06))
    line = shaped.shapes[0]
    q = [0.3, 0.4, 0.5]
    middle = ca.Function("m", [machine.q], [(line.start + line.end) / 2])(q).full().ravel()
    ball = Ball(tuple(middle), 0.05)
    assert least_clearance(shaped, [q], [ball])["Ball_1"] == pytest.approx(-0.11)
    rows = {c.name: c.expression for c in keep_clear(shaped, [ball])}
    values = {name: float(ca.Function("r", [machine.q], [row])(q)) for name, row in rows.items()}
    assert values["clearance of line 1 from Ball_1 (1 at its surface)"] < 1.0
    # Where the arm stands on its base it may stand on the floor; the other end may not go below.
    (floor,) = keep_clear(shaped, floor=0.0)
    assert all(ca.depends_on(row, machine.q) for row in ca.vertsplit(floor.expression))
    height = float(ca.Function("z", [machine.q], [line.end[2]])(q))
    assert least_clearance(shaped, [q], floor=0.0)["floor"] <= height - 0.06 + 1e-12
    ends = ca.Function("f", [machine.q], [ca.mmin(floor.expression)])
    assert float(ends(q)) == pytest.approx(least_clearance(shaped, [q], floor=0.0)["floor"], abs=1e-12)
    with pytest.raises(ValueError, match="was made for another machine"):
        with_shapes(make(), skeleton_shapes(machine, 0.06))


def test_skeletons_of_trees_show_their_side_branches():
    link = Link(1.0, (0.2, 0.0, 0.0), (0.01, 0.01, 0.01))
    joints = [
        Joint("a", link=link),
        Joint("left", parent="a", origin=(0.5, 0.0, 0.0), link=link),
        Joint("beyond", parent="left", origin=(0.0, 0.4, 0.0), link=link),
        Joint("right", parent="a", origin=(0.5, 0.0, 0.0), axis=(0.0, 0.0, 1.0), link=link),
    ]
    machine = tree(joints, tip="right", tool=(0.3, 0.0, 0.0))
    corners = ca.Function("s", [machine.q], [machine.skeleton])([0.0] * 4).full().T[:, :2]
    wanted = [(0, 0), (0, 0), (0.5, 0), (0.5, 0.4), (0.7, 0.4), (0.5, 0.4), (0.5, 0), (0, 0), (0.5, 0), (0.8, 0)]
    assert corners == pytest.approx(np.array(wanted, dtype=float))
    lengths = [shape.length for shape in skeleton_shapes(machine, 0.05)]
    assert lengths == pytest.approx([0.5, 0.4, 0.2, 0.3])
