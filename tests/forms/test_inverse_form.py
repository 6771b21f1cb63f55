"""The form with accelerations as controls: against the other forms, its limits, and optima known from elsewhere."""

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import evaluate, relative

from models import Motion, inverse_dynamics, robots, spherical, states_along, torus
from models.effects import (
    Coulomb,
    ElasticDrive,
    GearEfficiency,
    Gravity,
    LaggedDrive,
    MotionLimits,
    MotorDrive,
    Payload,
    RotorInertia,
    TorqueRate,
    Viscous,
)
from models.forms import canonical, inverse, lagrange
from ocp import Control, Ipopt, gentle, point_to_point, polish, smooth, solve, solve_to_accuracy, uniform, verify
from ocp.accuracy.control_shape import scheme_for
from ocp.arcs.least_effort import slack

QUIET = Ipopt(progress=False)
EFFECTS = [Gravity(), Payload(2.0, (0.1, 0.0, 0.05)), RotorInertia(0.2), Viscous(1.5), Coulomb(2.0)]
SPHERICAL = {"q": ([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]), "tau": [260.0, 160.0, 3.0, 400.0]}


@pytest.mark.parametrize("make", [spherical, torus, robots.puma560], ids=lambda make: make.__name__)
def test_the_torques_cause_the_accelerations_of_the_other_forms(make):
    machine = make()
    n = len(machine.coordinates)
    other, own = lagrange(machine, EFFECTS), inverse(machine, EFFECTS)
    random = np.random.default_rng(3)
    q, v = np.full((n, 6), 0.3) + 0.2 * random.normal(size=(n, 6)), random.normal(size=(n, 6))
    tau = 10.0 * random.normal(size=(n, 6))
    x = np.vstack([q, v])
    (rate,) = evaluate([other.x, other.u], [other.rate], x, tau)
    signals = ("tau", "energy", "power", "loss", "tool")
    expected = evaluate([other.x, other.u], [other[name] for name in signals], x, tau)
    found = evaluate([own.x, own.u], [own[name] for name in signals], x, rate[n:])
    for got, wanted in zip(found, expected, strict=True):
        assert relative(got, wanted) < 1e-11
    (own_rate,) = evaluate([own.x, own.u], [own.rate], x, rate[n:])
    assert np.array_equal(own_rate, rate)
    assert str(own.labels["u"][0]) == f"d2{machine.coordinates[0].name}/dt2 [rad/s^2]"


def test_motors_and_gears_that_have_no_states_follow():
    machine = robots.arm_3r()
    motor = MotorDrive(constant=0.05, resistance=1.2, ratio=100.0)
    for effects, name in (([Gravity(), motor], "voltage"), ([Gravity(), GearEfficiency(0.8)], "motor_tau")):
        other, own = canonical(machine, effects), inverse(machine, effects)
        x, control = np.array([0.2, 0.4, -0.3, 0.8, -0.5, 0.9]), np.array([20.0, -11.0, 7.0])
        v = ca.Function("v", [other.x], [other["v"]])
        a = ca.Function("a", [other.x, other.u], [ca.jtimes(other["v"], other.x, other.rate)])
        kept = np.append(x[:3], np.array(v(x)).ravel())
        found = ca.Function("found", [own.x, own.u], [own[name]])(kept, a(x, control))
        assert np.array(found).ravel() == pytest.approx(control, rel=1e-12)


@pytest.mark.parametrize(
    ("effect", "named"),
    [(ElasticDrive(1e4, 1.0), "elastic_drive"), (ElasticDrive(1e4, 1.0, 0.5), "elastic_drive"),
     (LaggedDrive(0.01), "lagged_drive"), (TorqueRate(100.0), "torque_rate"),
     (MotorDrive(0.05, 1.0, 1e-3, 100.0), "motor_drive"), (MotionLimits(jerk=3.0), "motion_limits")],
)  # fmt: skip
def test_drives_with_states_are_refused(effect, named):
    with pytest.raises(ValueError, match=rf"inverse: {named} .*canonical"):
        inverse(robots.arm_3r(), [effect])


def test_a_frame_is_refused():
    with pytest.raises(ValueError, match="frame is 'innovations', expected None or 'coordinate'"):
        inverse(robots.arm_3r(), [], "innovations")
    assert inverse(robots.arm_3r(), [], "coordinate").x.numel() == 6


def test_the_graph_has_nothing_but_the_torques():
    machine = robots.ur5()
    system = inverse(machine, [Gravity()])
    assert not ca.depends_on(system.rate, system["q"])
    count = ca.Function("tau", [system.x, system.u], [system["tau"]]).n_instructions()
    torques = inverse_dynamics(machine, [Gravity()])
    assert count <= torques.n_instructions()
    assert f"torques by inverse dynamics, {count} instructions" in system.notes


def test_limited_expressions_hold_the_accelerations():
    arm = inverse(robots.arm_3r(), [Gravity()])
    problem = point_to_point(arm, [0.0, 0.0, 0.0], [1.0, 0.6, -0.5], tau=[60.0, 40.0, 20.0])
    assert scheme_for(problem).control is Control.CONSTANT
    first_two = point_to_point(arm, [0.0, 0.0, 0.0], [1.0, 0.6, -0.5], M_q1=60.0, M_q2=40.0)
    assert scheme_for(first_two).control is Control.COLLOCATED


def test_speed_and_torque_limits_hold_everywhere():
    machine = robots.arm_3r()
    arm = inverse(machine, [Gravity(), Coulomb(1.0, 0.01)])
    problem = point_to_point(arm, [0.0, 0.0, 0.0], [1.5, 0.8, -0.9], tau=[60.0, 40.0, 20.0], v=[1.5, 1.0, 1.5])
    solution = solve(problem, grid=uniform(40), solver=QUIET)
    report = verify(solution)
    assert solution.ok
    assert report.ok, report.failures
    t = np.linspace(0.0, solution.duration, 2001)
    assert np.max(np.abs(solution.signal("v", t)) / [1.5, 1.0, 1.5]) < 1.0 + 1e-8
    table = Motion.of(solution).torques(machine, [Gravity(), Coulomb(1.0, 0.01)])
    assert np.max(np.max(np.abs(table.tau), axis=0) / [60.0, 40.0, 20.0]) < 1.004


def test_the_smooth_guess_lasts_long_enough_for_all_limits():
    arm = inverse(robots.arm_3r(), [Gravity()])
    limits = {"tau": [60.0, 60.0, 20.0], "v": [1.5, 1.0, 1.5]}
    problem = point_to_point(arm, [0.0, 0.0, 0.0], [1.5, 0.8, -0.9], limits=limits)
    guess = smooth(problem, [])
    assert np.all(np.max(np.abs(guess.x[:, 3:]), axis=0) <= limits["v"])
    torques = ca.Function("tau", [arm.x, arm.u], [arm["tau"]])
    tau = np.array([np.array(torques(x, u)).ravel() for x, u in zip(guess.x, guess.u, strict=True)])
    assert np.all(np.max(np.abs(tau), axis=0) <= limits["tau"])
    assert guess.duration < 6.0


def test_gentle_reduces_the_torques_that_hold_the_accelerations():
    machine = robots.arm_3r()
    arm = inverse(machine, [Gravity()])
    problem = point_to_point(arm, [0.0, 0.0, 0.0], [1.5, 0.8, -0.9], tau=[60.0, 60.0, 20.0], v=[1.5, 1.0, 1.5])
    assert scheme_for(gentle(problem)).control is Control.CONSTANT
    fast, soft = solve(problem, grid=uniform(20), solver=QUIET), solve(gentle(problem), grid=uniform(20), solver=QUIET)
    efforts = []
    for solution in (fast, soft):
        shares = solution.signal("tau", np.linspace(0.0, solution.duration, 2001)) / [60.0, 60.0, 20.0]
        efforts.append(solution.duration * np.mean(shares**2))
    assert -1e-9 < soft.duration - fast.duration < 0.01 * (efforts[0] - efforts[1]) + 1e-9
    assert efforts[1] < 0.95 * efforts[0]


def test_accelerations_that_the_time_leaves_open_are_named():
    """Two joints travel a tenth of the way of the first, whose speed sets the time."""
    arm = inverse(robots.arm_3r(), [Gravity()])
    problem = point_to_point(arm, [0.0, 0.0, 0.0], [1.5, 0.1, -0.1], tau=[60.0, 60.0, 20.0], v=1.0)
    solution = solve(problem, grid=uniform(40), solver=QUIET)
    sentence = slack(problem, solution)
    assert "d2q2/dt2 (" in sentence
    assert "d2q3/dt2 (" in sentence
    assert "d2q1/dt2 (" not in sentence


@pytest.mark.slow
def test_torque_limited_motions_are_refined_with_linear_accelerations():
    arm = inverse(spherical(), [Gravity()])
    problem = point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], limits=SPHERICAL)
    *_, best = solve_to_accuracy(problem, 1e-3, solver=QUIET)
    assert best.accuracy.met
    assert best.scheme.control is Control.SEGMENTS
    assert verify(best).ok
    assert 0.0 < best.duration - 0.680912352604 < best.accuracy.error


@pytest.mark.slow
def test_polish_finds_the_optimum_of_the_canonical_form():
    """t_f = 0.680912352604 s, from switching times as unknowns in canonical form by two schemes (docs/accuracy.md)."""
    arm = inverse(spherical(), [Gravity()])
    problem = point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], limits=SPHERICAL)
    best = polish(solve(problem, grid=uniform(100), solver=QUIET), seconds=60.0)
    assert best.structure is not None, best.message
    assert best.duration == pytest.approx(0.680912352604, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.1, 0.01, 0.001])
def test_dry_friction_of_any_width_is_solved_on_small_wrists(width):
    machine = robots.ur5()
    effects = [Gravity(), Payload(3.0), Coulomb((6.0, 6.0, 6.0, 1.0, 1.0, 1.0), width)]
    ends = [0.0, -1.0, 1.0, 0.0, 0.5, 0.0], [1.0, -0.5, 0.5, 0.5, 0.0, 0.5]
    problem = point_to_point(inverse(machine, effects), *ends, limits=machine.limits)
    solution = solve(problem, grid=uniform(50), solver=QUIET)
    assert verify(solution).ok
    assert solution.duration == pytest.approx(0.399, abs=1e-3)


@pytest.mark.slow
def test_a_seven_axis_arm_with_speed_limits_is_solved_verified_and_refined():
    machine = robots.panda()
    ends = [0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0], [1.0, 0.2, 0.5, -1.2, 0.4, 2.2, 0.6]
    arm = inverse(machine, [Gravity()])
    problem = point_to_point(arm, *ends, limits=machine.limits)
    solution = solve(problem, grid=uniform(50), solver=QUIET)
    assert solution.iterations < 60
    assert verify(solution).ok
    *_, best = solve_to_accuracy(problem, 1e-3, grid=solution.grid, solver=QUIET, guess=solution)
    assert best.accuracy.met
    assert verify(best).ok
    share, x, u = states_along(Motion.of(best), canonical(machine, [Gravity()]), machine, [Gravity()])
    assert np.all(np.abs(u) <= 1.004 * np.array(machine.limits["tau"][1]))
    assert x.shape == (len(share), 14)
    # The first joint turns by 1 rad; at its limit of speed all the time that would take 1 / 2.175 s.
    shortest = 1.0 / machine.limits["v"][1][0]
    assert shortest < best.duration - best.accuracy.error
    assert best.duration < 1.005 * shortest
