"""Straight lines timed within limits: a closed-form duration, and the states that make them a guess."""

import numpy as np
import pytest
from casadi import Function

from models import Joint, Kind, Link, Motion, cylindrical, robots, serial, states_along, straight_path, timed
from models.effects import ElasticDrive, Gravity
from models.forms import canonical, hamel, lagrange
from ocp import Control, Guess, Ipopt, point_to_point, radau, solve, uniform


def test_a_slide_takes_the_time_of_full_force():
    machine = serial([Joint("x", Kind.PRISMATIC, link=Link(2.0))], tool=(0.0, 0.0, 0.0))
    path, problem = straight_path(machine, [], [0.0], [0.5], {"tau": 10.0})
    solution = solve(problem, scheme=radau(3, control=Control.LINEAR), grid=uniform(60))
    assert timed(path, solution).duration == pytest.approx(2 * np.sqrt(0.5 * 2.0 / 10.0), rel=2e-3)


@pytest.mark.parametrize("form", [canonical, lagrange, hamel])
@pytest.mark.parametrize("machine", [cylindrical(), robots.arm_3r()], ids=["cylindrical", "3R"])
def test_states_along_a_motion_obey_the_equations(machine, form):
    system = form(machine, [Gravity()])
    motion = Motion.quintic([0.1, 0.3, 0.6], [0.9, 0.5, 0.9], 1.2)
    share, x, u = states_along(motion, system, machine, [Gravity()], 801)
    rate = Function("rate", [system.x, system.u], [system.rate]).map(len(share))(x.T, u.T).full().T
    t = share * motion.duration
    moved = np.gradient(x, t, axis=0, edge_order=2)
    assert np.max(np.abs(moved - rate)) < 1e-4 * np.max(np.abs(rate))


@pytest.mark.slow
def test_the_straight_line_is_a_guess():
    machine, ends = robots.arm_3r(), ([0.0, 0.0, 0.0], [1.0, 0.6, -0.5])
    path, problem = straight_path(machine, [Gravity()], *ends, machine.limits)
    line = timed(path, solve(problem, scheme=radau(3, control=Control.LINEAR), grid=uniform(50)))
    arm = canonical(machine, [Gravity()])
    free = point_to_point(arm, *ends, limits=machine.limits)
    share, x, u = states_along(line, arm, machine, [Gravity()])
    guess = Guess(share, x, u, line.duration, np.zeros(0))
    best, usual = (solve(free, grid=uniform(20), guess=one, solver=Ipopt(progress=False)) for one in (guess, None))
    assert best.ok
    assert best.duration == pytest.approx(usual.duration, rel=1e-6)
    assert best.duration < line.duration


def test_what_a_motion_does_not_determine_is_refused():
    machine = robots.arm_3r()
    system = canonical(machine, [ElasticDrive(1e4, 0.5)])
    with pytest.raises(ValueError, match="a motion does not determine"):
        states_along(Motion.quintic([0.0] * 3, [1.0] * 3, 1.0), system, machine, [ElasticDrive(1e4, 0.5)])
    with pytest.raises(KeyError, match="no signal 'jerk'"):
        straight_path(machine, [], [0.0] * 3, [1.0] * 3, {"jerk": 1.0})
    with pytest.raises(ValueError, match="the same"):
        straight_path(machine, [], [0.0] * 3, [0.0] * 3, {})
