"""Pictures: what is drawn is what was computed; axes of a drawing are those of the kinematics."""

import casadi as ca
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from models import Motion, Parameter, cylindrical, plots, spherical, torus
from models.effects import Gravity, TorqueSpeed
from models.forms import canonical
from models.plots import signals, surfaces
from models.plots.machines import joint_axes
from models.plots.style import pretty
from ocp import (
    Ball,
    Bolza,
    Box,
    Cylinder,
    Free,
    HalfSpace,
    Problem,
    Sequence,
    Solution,
    Study,
    end,
    point_to_point,
    solve,
    uniform,
)  # fmt: skip

matplotlib.use("Agg")
LIMIT, STALL, FASTEST = 150.0, np.array([300.0, 2000.0, 600.0]), np.array([4.0, 1.5, 2.0])


@pytest.fixture(scope="module")
def lifted() -> Solution:
    arm = canonical(cylindrical(), [Gravity(), TorqueSpeed(tuple(STALL), tuple(FASTEST))])
    limits = {"tau": [LIMIT, 1000.0, 300.0], "q": ([-3.0, 0.0, 0.3], [3.0, 1.2, 1.0])}
    solution = solve(point_to_point(arm, [0.0, 0.2, 0.6], [2.0, 0.8, 0.8], **limits), grid=uniform(12))
    assert solution.ok
    return solution


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def test_curves_and_limits_are_those_of_the_solution(lifted):
    q, v, tau = signals.curves(lifted)
    assert (q.heading, v.heading, tau.heading) == ("position", "velocity", "drive")
    inside = np.ptp(q.t) * np.array([0.1, 0.33, 0.77])
    for one in (q, v):
        for t in inside:
            k = np.argmin(np.abs(one.t - t))
            np.testing.assert_allclose(one.values[k], lifted.signal(one.name, one.t[k]), atol=1e-9)
    np.testing.assert_array_equal(q.lower[0], [-3.0, 0.0, 0.3])
    # The torque that is left at a speed: stall (1 - |v| / no-load) where it drives, the peak elsewhere.
    left = STALL * (1.0 - v.values / FASTEST)
    np.testing.assert_allclose(tau.upper, np.minimum([LIMIT, 1000.0, 300.0], left), rtol=1e-9)
    left = -STALL * (1.0 + v.values / FASTEST)
    np.testing.assert_allclose(tau.lower, np.maximum([-LIMIT, -1000.0, -300.0], left), rtol=1e-9)
    nodes = slice(None, None, len(signals.SHARES))  # between them a coarse grid may exceed the torque that is left
    assert np.all(tau.values[nodes] <= tau.upper[nodes] + 1e-5 * LIMIT)


def test_a_motion_is_drawn_with_its_limits_obstacles_and_arm(lifted, tmp_path):
    figure = plots.motion(lifted, cylindrical(), obstacles=[Cylinder([-0.5, 0.9, 0.4], [0, 0, 1], 0.1)])
    panels, space = figure.axes[:-1], figure.axes[-1]
    assert len(panels) == 9
    assert "Shortest time" in figure.get_suptitle()
    np.testing.assert_allclose(panels[0].lines[0].get_ydata(), signals.curve(lifted, "q").values[:, 0])
    assert len(space.collections) == 1  # the obstacle
    tool = np.array(space.lines[7].get_data_3d()).T  # behind seven poses
    np.testing.assert_allclose(tool[[0, -1]], lifted.signal("tool", np.array([0.0, lifted.duration])), atol=1e-12)
    for suffix, start in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        plots.motion(lifted, path=tmp_path / f"motion.{suffix}")
        assert (tmp_path / f"motion.{suffix}").read_bytes().startswith(start)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_failed_write_leaves_the_old_picture(lifted, tmp_path):
    path = tmp_path / "motion.nonsense"
    path.write_text("old")
    with pytest.raises(ValueError, match="nonsense"):
        plots.motion(lifted, path=path)
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


def test_legs_of_a_sequence_and_systems_without_an_arm():
    arm = canonical(cylindrical(), [Gravity()])
    task = point_to_point(arm, [0.0, 0.2, 0.6], [1.0, 0.5, 0.7], tau=[150.0, 1000.0, 300.0])
    first = [c for c in task.subject_to if c.where.name != "END"]
    along = [c for c in first if c.where.name == "ALONG"]
    last = [c for c in task.subject_to if c.where.name == "END"]
    legs = (
        Problem(arm, Free(0.5), Bolza(time=1.0), (*first, end(arm["q"], [0.5, 0.4, 0.6]))),
        Problem(arm, Free(0.5), Bolza(time=1.0), (*along, *last)),
    )
    solution = solve(Sequence(legs, ((arm.x, arm.x),)), grid=uniform(6))
    figure = plots.motion(solution, cylindrical())
    via = figure.axes[-1].lines[-1].get_data_3d()
    wanted = signals.skeleton(cylindrical(), np.array([[0.5, 0.4, 0.6]]))[0, -1]
    np.testing.assert_allclose(np.array(via).ravel(), wanted, atol=1e-6)


@pytest.mark.parametrize("make", [spherical, cylindrical, torus])
def test_axes_of_a_drawing_move_the_tool_as_the_kinematics_do(make):
    """A tool that is carried along an axis moves by omega x (r - point), or along the axis."""
    arm = make()
    q = np.array([0.7, -0.4, 0.5, 0.6])[: len(arm.coordinates)]
    corners = signals.skeleton(arm, q[None])[0]
    for k, axis in enumerate(joint_axes(arm, q)):
        step = 1e-6 * np.eye(len(q))[k]
        ahead, behind = signals.skeleton(arm, np.vstack([q + step, q - step]))[:, -1]
        moved = (ahead - behind) / 2e-6
        carried = np.cross(axis.direction, corners[-1] - axis.point) if axis.turns else axis.direction
        np.testing.assert_allclose(moved, carried, atol=1e-8)
        assert axis.turns == (arm.coordinates[k].unit == "rad")


def test_a_drawing_names_coordinates_and_drives():
    figure = plots.machine(torus(L_2=Parameter(0.7)))
    words = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    assert words.count("turns about its axis") == 3
    assert "zero position" in words
    with pytest.raises(ValueError, match="q"):
        plots.machine(torus(), [0.1])


@pytest.mark.parametrize(
    "region", [Ball([0.1, 0.2, 0.3], 0.4), Box([0, 0, 0], [1, 2, 3]), Cylinder([0.1, 0, 0], [0, 1, 1], 0.2, 0.7)]
)
def test_surfaces_lie_on_their_regions(region):
    points, triangles = surfaces.mesh(region, np.zeros(3), 1.0)
    place = ca.SX.sym("r", 3)
    share = ca.Function("share", [place], [ca.mmax(ca.vertcat(region.within(place)))])
    on_surface = np.array([float(share(point)) for point in points])
    centres = {tuple(p) for p, s in zip(np.round(points, 9), on_surface, strict=True) if s < 1.0 - 1e-9}
    assert len(centres) == 0 or isinstance(region, Cylinder)
    assert np.all(on_surface <= 1.0 + 1e-9)
    # A closed surface encloses the volume of the region, up to the corners of its circles.
    a, b, c = points[triangles].transpose(1, 0, 2)
    assert np.max(triangles) == len(points) - 1
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
    known = {Ball: 4 * np.pi * 0.16, Box: 22.0, Cylinder: 2 * np.pi * 0.2 * 0.7 + 2 * np.pi * 0.04}
    assert area == pytest.approx(known[type(region)], rel=0.02)


def test_a_wall_stands_in_the_picture_and_unknown_regions_are_left_out():
    points, _ = surfaces.mesh(HalfSpace([0.0, 0.0, -0.5], [0.0, 0.0, 2.0]), np.array([0.3, 0.2, 0.1]), 1.0)
    np.testing.assert_allclose(points[:, 2], -0.5)
    np.testing.assert_allclose(points.mean(axis=0), [0.3, 0.2, -0.5])
    assert surfaces.mesh(object(), np.zeros(3), 1.0) is None


def test_torques_and_studies_draw_themselves(tmp_path):
    table = Motion.quintic([0.0, 0.2, 0.6], [1.0, 0.5, 0.7], 1.0).torques(cylindrical(), [Gravity()])
    figure = plots.torques(table)
    drawn = next(line for line in figure.axes[0].lines if line.get_label() == "tau")
    np.testing.assert_allclose(drawn.get_ydata(), table.tau[:, 0])
    study = Study(lambda width: {"area": width**2}, {"width": [1.0, 2.0, 3.0]}).run()
    figure = plots.study(study, "area", {"area": "m^2"})
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), [1.0, 4.0, 9.0])
    assert "m^2" in figure.axes[0].get_ylabel()
    with pytest.raises(ValueError, match="nothing to draw"):
        plots.study(Study(lambda kind: {"area": 1.0}, {"kind": ["a", "b"]}).run(), "area")


def test_labels_are_mathematics():
    assert pretty("dtheta/dt [rad/s]") == r"$\dot{\theta}$ [rad/s]"
    assert pretty("dq1/dt [rad/s]") == r"$\dot{q}_{1}$ [rad/s]"
    assert pretty("dshoulder_pan_joint/dt [rad/s]") == r"d $\mathrm{shoulder\_pan\_joint}$/dt [rad/s]"
    assert pretty("delbow/dt [rad/s]") == r"d $\mathrm{elbow}$/dt [rad/s]"
    assert pretty("tau_q1 [N m]") == r"$\tau_{q_1}$ [N m]"
    assert pretty("tau_elbow [N m]") == r"$\tau_{\mathrm{elbow}}$ [N m]"
