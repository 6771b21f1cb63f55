"""Inverse kinematics in closed form, and motions of the tool along paths in space."""

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import NAMES, evaluate, machine, states

from models import Motion, cylindrical, spherical, torus
from models.machines.inverse_kinematics import wrapped
from models.motions.tool_motion import along_tool_path
from models.motions.tool_paths import arc, line, sampled

RNG = np.random.default_rng(5)


def tool(arm, q):
    return evaluate([arm.q], [arm.tool], q.T)[0].T


def reached(arm, points, configurations):
    """Return the largest error of the tool over all solutions relative to its distance; free coordinates are random."""
    size = 1.0 + np.linalg.norm(points, axis=1).max()
    worst = 0.0
    for branch in range(configurations.q.shape[1]):
        q = configurations.q[:, branch]
        q = np.where(np.isnan(q), RNG.uniform(-np.pi, np.pi, q.shape), q)
        worst = max(worst, np.max(np.abs(tool(arm, q) - points)) / size)
    return worst


@pytest.mark.parametrize("name", NAMES)
def test_round_trip_over_ten_thousand_poses(name):
    arm = machine(name)
    q = states(arm, 10_000, seed=3)[0].T
    points = tool(arm, q)
    configurations = arm.inverse(points)
    assert np.all(configurations.reachable)
    assert configurations.q.shape[1] == len(configurations.branches)
    assert reached(arm, points, configurations) < 1e-12
    # The pose that the point was made from is among the solutions.
    angular = np.array([c.unit == "rad" for c in arm.coordinates])
    step = configurations.q - q[:, None]
    step = np.nan_to_num(np.where(angular, wrapped(step), step))
    assert np.max(np.min(np.linalg.norm(step, axis=2), axis=1)) < 1e-6
    assert np.all(np.abs(configurations.q[..., angular][~np.isnan(configurations.q[..., angular])]) <= np.pi)


def at_singularities():
    centred, offset = cylindrical(A=0.0), cylindrical(A=0.3)
    ball, straight, bent = spherical(), torus(), torus(B=0.2)
    l_t, equal = ball.nominal["l_T"], torus(L_2=0.8, L_3=0.8)
    yield centred, [0.7, 0.4, -centred.nominal["l_T"]], "r + l_T = 0"
    yield offset, [-2.0, 0.1, -offset.nominal["l_T"]], "r + l_T = 0"
    yield ball, [0.0, 0.3, 0.0, 0.8], "vertical axis"
    yield ball, [np.pi, 0.3, 0.0, 0.8], "vertical axis"
    yield ball, [0.5, 0.3, 0.0, -l_t], "centre of rotation"
    for arm in (straight, bent):
        yield arm, [0.4, 0.9, 0.0], "stretched"
        yield arm, [0.4, 0.9, np.pi], "folded"
        outer = arm.nominal["L_3"] / 2 + arm.nominal["l_T"]
        yield arm, [0.4, 1.1, np.arccos(-arm.nominal["L_2"] * np.cos(1.1) / outer) - 1.1], "above the shoulder"
    yield equal, [0.4, 0.9, np.pi], "folded"


@pytest.mark.parametrize(("arm", "q", "name"), list(at_singularities()), ids=lambda value: str(value)[:24])
def test_every_named_singularity(arm, q, name):
    points = tool(arm, np.array([q]))
    configurations = arm.inverse(points)
    assert configurations.reachable[0]
    assert any(name in known for known in configurations.singularities(0))
    assert reached(arm, points, configurations) < 1e-12
    # The name tells the truth: the Jacobian of the tool has lost a rank.
    jacobian = np.array(ca.Function("J", [arm.q], [ca.jacobian(arm.tool, arm.q)])(q))
    assert np.linalg.svd(jacobian)[1][2] < 1e-7
    ordinary = arm.inverse(tool(arm, np.array([q]) + 0.2 * np.arange(1, len(q) + 1)))
    assert ordinary.singularities(0) == ()


@pytest.mark.parametrize(
    ("arm", "point", "reason"),
    [
        (cylindrical(A=0.3), [0.1, 0.1, 0.0], "nearer to the vertical axis than the offset A"),
        (torus(), [1.0, 1.0, 1.0], "farther than the stretched arm"),
        (torus(), [0.05, 0.0, 0.0], "nearer to the shoulder"),
        (torus(B=0.4), [0.2, 0.2, 0.3], "offset B"),
    ],
)
def test_points_out_of_reach_are_named(arm, point, reason):
    configurations = arm.inverse(np.array([point]))
    assert not configurations.reachable[0]
    assert reason in configurations.why(0)


PATHS = {
    "line": lambda x: line(x, x + np.array([0.1, -0.25, 0.12])),
    "arc": lambda x: arc(x, x + np.array([0.1, -0.1, 0.1]), x + np.array([0.15, -0.3, 0.05])),
    "sampled": lambda x: sampled(x + np.array([[0, 0, 0], [0.05, -0.06, 0], [0.1, -0.1, 0.06], [0.1, -0.2, 0.1]])),
}


@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize(
    ("arm", "q"),
    [(cylindrical(), [0.4, 0.3, 0.5]), (spherical(), [1.0, 0.5, 0.0, 0.7]), (torus(B=0.1), [3.0, 0.5, -1.2])],
    ids=lambda value: getattr(value, "name", ""),
)
def test_the_tool_follows_its_path(arm, q, kind):
    path = PATHS[kind](tool(arm, np.array([q]))[0])
    law = Motion.s_curve(0.0, path.length, 0.5, 2.0, 10.0)
    motion = along_tool_path(arm, path, law, near=q)
    t = np.linspace(0.0, motion.end, 301)[1:-1] + 1e-5  # away from the jumps of the jerk
    s = law.q(t)[:, 0]
    assert np.max(np.abs(tool(arm, motion.q(t)) - path(s, 0))) < 1e-12
    assert np.max(np.abs(motion.q(0.0) - q)) < 1e-9
    # v, a and the jerk are derivatives of q, by central differences that converge.
    h = 1e-5
    for order in (0, 1, 2):
        slope = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2.0 * h)
        assert np.max(np.abs(slope - motion.derivative(t, order + 1))) < 1e-4 * (
            1.0 + np.max(np.abs(motion.derivative(t, order + 1)))
        )
    # The speed of the tool is that of the law.
    rate = evaluate([arm.q, arm.v], [ca.jtimes(arm.tool, arm.q, arm.v)], motion.q(t).T, motion.v(t).T)[0].T
    if kind != "sampled":
        assert np.max(np.abs(np.linalg.norm(rate, axis=1) - law.v(t)[:, 0])) < 1e-12


def test_through_the_vertical_and_across_pi():
    # A line through the vertical axis: theta changes its sign and psi stays.
    path = line([0.0, -0.4, 0.9], [0.0, 0.5, 0.9])
    motion = along_tool_path(spherical(), path, Motion.quintic(0.0, path.length, 1.0))
    q = motion.q(np.linspace(0.0, 1.0, 201))
    assert np.ptp(q[:, 1]) < 1e-9
    assert q[0, 0] * q[-1, 0] < 0.0
    # A turn past pi is continued, not wrapped.
    turn = arc([-0.5, 0.4, 0.2], [-0.7, 0.0, 0.2], [-0.5, -0.4, 0.2])
    motion = along_tool_path(torus(), turn, Motion.quintic(0.0, turn.length, 1.0))
    q = motion.q(np.linspace(0.0, 1.0, 201))
    assert np.max(np.abs(np.diff(q[:, 0]))) < 0.1


LAW = Motion.quintic(0.0, 0.3, 1.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: line([0, 0, 1], [0, 0, 1]), "same point"),
        (lambda: line([0, 0], [0, 0, 1]), r"expected a point"),
        (lambda: line([0, 0, np.nan], [0, 0, 1]), r"expected a point"),
        (lambda: arc([0, 0, 0], [1, 0, 0], [2, 0, 0]), "on a line"),
        (lambda: sampled([[0, 0, 0], [0, 0, 0], [1, 0, 0]]), "are the same"),
        (lambda: sampled([[0, 0, 0], [1, 0, 0]]), "at least three"),
        (lambda: along_tool_path(torus(), line([1, 0, 0], [2, 0, 0]), Motion.quintic(0, 1, 1)), "cannot be reached"),
        (lambda: along_tool_path(torus(), line([1, 0, 0], [1, 0, 0.3]), Motion.quintic([0, 0], [1, 1], 1)), "law"),
        (lambda: along_tool_path(torus(), line([1, 0, 0], [1, 0, 0.2]), LAW), "s runs from 0 to 0.3"),
        (lambda: along_tool_path(torus(), line([1, 0, 0], [1, 0, 0.3]), LAW, near=[1.0]), "near"),
        (lambda: along_tool_path(torus(), line([1, 0, 0], [1, 0, 0.3]), LAW, hold={"q1": 0}), "hold"),
        (
            lambda: along_tool_path(
                torus(), line([1, 0, 0], [1, 0, 0.3]), LAW, limits=([-1, -1, 0.1], [1, 1, 0.2])
            ),
            "within the limits",
        ),
    ],
)  # fmt: skip
def test_wrong_paths_are_refused_in_words(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_a_corner_in_a_singularity_is_refused():
    # Along the axis of the arm into the fully stretched position and on: no arm follows.
    arm = torus()
    far = arm.nominal["L_2"] + arm.nominal["L_3"]
    path = line([far - 0.2, 0.0, 0.0], [far, 0.0, 0.0])
    law = Motion.of_time(lambda t: 0.2 * t, 1.0)  # arrives with a velocity
    with pytest.raises(ValueError, match="stretched"):
        along_tool_path(arm, path, law)
