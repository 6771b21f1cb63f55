"""Torques that drives have: by their own limits, by effects, by a scene; against the lines by hand."""

from __future__ import annotations

import numpy as np

from models import Envelope, Motion, cylindrical
from models.effects import Gravity, LaggedDrive, TorqueSpeed
from models.plots.torque_bounds import drive_limits

MOTION = Motion.quintic([0.0, 0.2, 0.6], [1.0, 0.5, 0.7], 1.0)
STALL, IDLE = np.array([260.0, 1700.0, 520.0]), np.array([5.0, 3.0, 4.0])


def test_nothing_limits_a_drive_without_limits() -> None:
    low, high = drive_limits(MOTION.torques(cylindrical(), [Gravity()]))
    assert np.all(low == -np.inf)
    assert np.all(high == np.inf)


def test_the_torque_left_at_a_speed_and_the_limit_of_a_scene() -> None:
    table = MOTION.torques(cylindrical(), [Gravity(), TorqueSpeed(tuple(STALL), tuple(IDLE))])
    low, high = drive_limits(table, {"tau": (-200.0, [160.0, 2000.0, 320.0])})
    share = table.v / IDLE
    np.testing.assert_allclose(high, np.minimum((1.0 - share) * STALL, [160.0, 2000.0, 320.0]), rtol=1e-12)
    np.testing.assert_allclose(low, np.maximum((-1.0 - share) * STALL, -200.0), rtol=1e-12)


def test_limits_of_the_drives_themselves_come_on_top() -> None:
    limits = [Envelope(peak=100.0, speed=2.0, corner=0.5), Envelope(), Envelope(peak=300.0)]
    table = MOTION.torques(cylindrical(), [Gravity()], limits=limits)
    low, high = drive_limits(table, {"tau": (-1e3, 1e3)})
    np.testing.assert_allclose(high[:, 0], limits[0].torque(table.v[:, 0]))
    np.testing.assert_allclose(low[:, 1], -1e3)
    np.testing.assert_allclose(high[:, 2], 300.0)


def test_drives_with_states_have_no_line() -> None:
    table = MOTION.torques(cylindrical(), [Gravity(), LaggedDrive(0.01)])
    low, high = drive_limits(table, {"q": (-3.0, 3.0)})
    assert np.all(np.isinf(low) & np.isinf(high))
