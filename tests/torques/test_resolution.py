"""Loads between the rows, means over time, shafts and gears: against dense evaluations and closed forms."""

import casadi as ca
import numpy as np
import pytest

from models import Motion, Motor, along_tool_path, inverse_dynamics, line, size_gears, torus
from models.effects import GearEfficiency, Gravity, MotorDrive, RotorInertia

Q0, Q1 = [0.0, 0.4, -0.9], [2.0, 0.8, -1.3]


GRAVITY = (Gravity(),)


def dense(motion, effects=GRAVITY, count=100_001):
    """Return times and torques of a motion at very many times, by the function alone."""
    t = np.linspace(motion.start, motion.end, count)
    function = inverse_dynamics(torus(), effects).map(count)
    return t, np.array(function(motion.q(t).T, motion.v(t).T, motion.a(t).T, np.zeros((0, count)))).T


def test_three_rows_have_the_loads_of_the_motion():
    exact = Motion.quintic(Q0, Q1, 1.0)
    t = np.array([0.0, 0.5, 1.0])
    table = Motion.from_samples(t, exact.q(t), exact.v(t), exact.a(t)).torques(torus(), [Gravity()])
    fine, tau = dense(exact)
    power = np.maximum(tau * exact.v(fine), 0.0)
    for i, load in enumerate(table.loads):
        assert abs(load.peak) == pytest.approx(np.max(np.abs(tau[:, i])), rel=1e-4)
        assert load.rms == pytest.approx(np.sqrt(np.trapezoid(tau[:, i] ** 2, fine)), rel=1e-4)
        assert load.motor_energy == pytest.approx(np.trapezoid(power[:, i], fine), rel=1e-4, abs=1e-2)
    assert table.loads[0].peak == pytest.approx(274.76, abs=0.05)  # Pinocchio, a model of its own
    assert len(table.t) == 3


def test_means_are_over_time_not_over_rows():
    move, pause = Motion.quintic(Q0, Q1, 1.35), 4.0
    rows = np.linspace(0.0, 1.35, 300)
    t = np.append(rows, 1.35 + pause)
    parts = [np.vstack([part(rows), last]) for part, last in
             ((move.q, [Q1]), (move.v, np.zeros((1, 3))), (move.a, np.zeros((1, 3))))]  # fmt: skip
    effects = [Gravity(), MotorDrive(0.2, 1.0, 0.0, 100.0)]
    table = Motion.from_samples(t, *parts).torques(torus(), effects).resolved
    fine, tau = dense(move)
    still = np.array(inverse_dynamics(torus(), [Gravity()])(Q1, [0] * 3, [0] * 3, [])).ravel()
    squares = np.trapezoid(tau**2, fine, axis=0) + pause * still**2
    expected = np.sqrt(squares / (1.35 + pause))
    np.testing.assert_allclose([load.rms for load in table.loads], expected, rtol=1e-4)
    np.testing.assert_allclose(table.rms(table.drives["motor_tau"]), expected, rtol=1e-4)
    np.testing.assert_allclose(table.rms(table.drives["current"]), expected / 20.0, rtol=1e-4)


def test_a_stop_in_a_singular_position_is_told():
    arm = torus()
    tool = ca.Function("tool", [arm.q], [arm.tool])
    stretched = np.array(tool([0.0, 0.3, 0.0])).ravel()
    path = line(0.7 * stretched, stretched)
    motion = along_tool_path(arm, path, Motion.quintic(0.0, path.length, 1.0))
    assert any("grows without bound" in note for note in motion.torques(arm, [Gravity()]).resolved.notes)
    calm = Motion.quintic(Q0, Q1, 1.0).torques(arm, [Gravity()]).resolved
    assert calm.notes == ()


def test_shafts_and_gears_against_hand_calculation():
    motion, effects = Motion.quintic(Q0, Q1, 1.0), [Gravity()]
    fine, tau = dense(motion)
    v, a = motion.v(fine)[:, 1], motion.a(fine)[:, 1]
    motor, ratio, eta = Motor("m", inertia=3e-4, rated=3.0, peak=9.0, speed=400.0, constant=0.5), 120.0, 0.8
    (one,) = size_gears(motion.torques(torus(), effects), 1, [motor], [ratio], eta)
    torque = 3e-4 * ratio * a + tau[:, 1] / ratio * np.where(tau[:, 1] * v >= 0.0, 1 / eta, eta)
    assert one.peak == pytest.approx(np.max(np.abs(torque)), rel=1e-3)
    assert one.rms == pytest.approx(np.sqrt(np.trapezoid(torque**2, fine)), rel=1e-3)
    assert one.speed == pytest.approx(ratio * np.max(np.abs(v)), rel=1e-4)
    assert one.current == pytest.approx(one.rms / 0.5)
    table = motion.torques(torus(), [*effects, RotorInertia(3e-4, ratio), GearEfficiency(1.0)]).resolved
    lossless = 3e-4 * ratio * a + tau[:, 1] / ratio
    assert np.max(np.abs(table.shaft.torque[:, 1])) == pytest.approx(np.max(np.abs(lossless)), rel=1e-3)
    assert np.max(np.abs(table.shaft.rpm[:, 1])) == pytest.approx(ratio * np.max(np.abs(v)) * 30 / np.pi, rel=1e-4)


def test_gear_losses_depend_on_the_direction_of_power():
    arm, eta = torus(), 0.7
    effects = [Gravity(), GearEfficiency(eta, 1e-4, 1e-4)]
    table = Motion.quintic(Q0, Q1, 1.0).torques(arm, effects, times=np.linspace(0.01, 0.99, 500))
    driving = table.tau * table.v > 0.0
    clear = (np.abs(table.v) > 1e-2) & (np.abs(table.tau) > 1.0)
    expected = np.where(driving, table.tau / eta, table.tau * eta)
    np.testing.assert_allclose(table.drives["motor_tau"][clear], expected[clear], rtol=1e-3)
