"""Limits of acceleration, jerk and tool speed against closed-form durations of a slide, and in every form."""

import numpy as np
import pytest

from models import Joint, Kind, Link, Parameter, cylindrical, path_through, serial
from models.effects import Gravity, LaggedDrive, MotionLimits, TorqueRate
from models.forms import canonical, hamel, lagrange
from models.mechanics.contributions import Sizes, SolvedMotion
from models.motions.path_timing import path_system
from models.scenes.task_file import of_text
from models.scenes.toml_document import SceneError
from ocp import Bolza, Free, Problem, along, end, point_to_point, solve, start, uniform

DISTANCE = 0.5


def slide(effects, form=lagrange):
    """Return the duration of a mass of 2 kg that moves half a metre from rest to rest without other limits."""
    arm = form(serial([Joint("x", Kind.PRISMATIC, link=Link(2.0))], tool=(0.0, 0.0, 0.0)), effects)
    return solve(point_to_point(arm, [0.0], [DISTANCE], tau=1e3), grid=uniform(40))


@pytest.mark.parametrize("form", [canonical, lagrange, hamel])
def test_a_slide_with_limited_acceleration(form):
    assert slide([MotionLimits(acceleration=5.0)], form).duration == pytest.approx(
        2 * np.sqrt(DISTANCE / 5.0), rel=1e-5
    )


def test_a_slide_with_limited_tool_speed():
    solution = slide([MotionLimits(acceleration=5.0, tool_speed=0.8)])
    assert solution.duration == pytest.approx(DISTANCE / 0.8 + 0.8 / 5.0, rel=1e-3)
    assert np.max(solution.signal("tool_speed", solution.t)) == pytest.approx(0.8, rel=1e-5)


def test_a_slide_with_limited_jerk():
    # Four pieces of constant jerk: DISTANCE = j T^3 / 32.
    solution = slide([TorqueRate(1e4), MotionLimits(jerk=10.0)])
    assert solution.duration == pytest.approx((32 * DISTANCE / 10.0) ** (1 / 3), rel=1e-4)


def test_limits_that_are_parameters():
    solution = slide([MotionLimits(acceleration=Parameter(5.0), tool_speed=Parameter(0.8))])
    assert solution.duration == pytest.approx(DISTANCE / 0.8 + 0.8 / 5.0, rel=1e-3)


@pytest.mark.slow
def test_acceleration_and_jerk_are_the_rates_of_the_velocity():
    arm = cylindrical()
    limits = MotionLimits(acceleration=20.0, jerk=1e3)
    for drives in (TorqueRate((2e3, 2e4, 6e3)), LaggedDrive(0.02)):
        system = canonical(arm, [Gravity(), drives, limits])
        limit = {"tau": [150.0, 1000.0, 300.0]}
        solution = solve(point_to_point(system, [0.0, 0.2, 0.6], [1.0, 0.6, 0.8], **limit), grid=uniform(15))
        assert solution.ok
        middle, h = 0.37 * solution.duration, 1e-5
        around = middle + np.array([-h, 0.0, h])
        v, a, jerk = (solution.signal(name, around) for name in ("v", "acceleration", "jerk"))
        scale = np.max(np.abs(solution.signal("acceleration", solution.t)))
        assert np.max(np.abs((v[2] - v[0]) / (2 * h) - a[1])) < 1e-2 * scale
        assert np.max(np.abs((a[2] - a[0]) / (2 * h) - jerk[1])) < 2e-2 * max(np.max(np.abs(jerk[1])), scale)


def test_a_jerk_needs_drives_without_jumps():
    with pytest.raises(ValueError, match="torques of drives may jump; add TorqueRate"):
        canonical(cylindrical(), [MotionLimits(jerk=10.0)])
    with pytest.raises(ValueError, match="acceleration"):
        MotionLimits(acceleration=-1.0)


@pytest.mark.slow
def test_paths_are_timed_within_them():
    arm = cylindrical()
    path = path_through([[0.0, 0.2, 0.6], [1.0, 0.6, 0.8]])
    system = path_system(arm, [MotionLimits(acceleration=2.0, tool_speed=0.5)], path)
    assert system.notes == ()
    ends = (start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0))
    free = (along(system["tau"], -1e4, 1e4), along(system["ds"], 0.0, 100.0))
    solution = solve(Problem(system, Free(guess=1.0), Bolza(time=1.0), (*ends, *free)), grid=uniform(40))
    assert solution.ok
    assert np.max(np.abs(solution.signal("acceleration", solution.t))) < 2.0 * 1.02
    assert np.max(solution.signal("tool_speed_share", solution.t)) == pytest.approx(1.0, rel=2e-2)


SCENE = """machine = "cylindrical"
[effects.torque_rate]
rate = [2000.0, 20000.0, 6000.0]
[effects.motion_limits]
acceleration = {acceleration}
jerk = 300.0
tool_speed = 1.0
[limits]
tau = [150.0, 1000.0, 300.0]
[task]
from = [0.0, 0.2, 0.6]
to = [1.0, 0.6, 0.8]
"""


@pytest.mark.slow
def test_keys_of_a_scene_file():
    scene, task = of_text(SCENE.format(acceleration="[8.0, 6.0, 6.0]"), "scene.toml")
    assert set(scene.system.limits) == {"torque_rate", "acceleration", "jerk", "tool_speed_share"}
    assert "acceleration" in scene.card()
    solution = solve(task.problem(scene.system), grid=uniform(20))
    assert solution.ok
    assert np.max(np.abs(solution.signal("acceleration", solution.t)).T[0]) < 8.0 * 1.02
    with pytest.raises(SceneError, match="acceleration"):
        of_text(SCENE.format(acceleration="-1.0"), "scene.toml")


def test_the_share_of_a_rate_is_that_of_the_steepest_torque_and_infinite_at_a_jump():
    arm, t = cylindrical(), np.array([0.0, 0.5, 1.0, 1.0, 2.0])
    still = np.zeros((3, 5))
    ramp = np.vstack([np.zeros(5), 100.0 * t, 30.0 * t])
    sizes = Sizes.of(arm, ramp, still)
    motion = SolvedMotion(t, still, still, still, ramp, {})
    effect = TorqueRate((10.0, 200.0, 40.0))
    part = effect.contribution(sizes, motion, [])
    assert part.use == pytest.approx(0.75)
    assert not part.torque.any()
    assert TorqueRate((None, 200.0, None)).contribution(sizes, motion, []).use == pytest.approx(0.5)
    jump = ramp + np.outer([0.0, 0.0, 1.0], [0, 0, 0, 5, 5])
    assert effect.contribution(sizes, SolvedMotion(t, still, still, still, jump, {}), []).use == np.inf
