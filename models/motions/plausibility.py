"""Slips in recorded motions that give wrong torques without any error: wrapped angles, degrees, wrong velocities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.machines.manipulator import Manipulator
from models.motions.recording import Recording
from models.torques.torque_table import TorqueTable
from ocp.checks import Array
from ocp.system import Label

TURN = 2.0 * np.pi
# A step belongs to a wrapped angle if it is closer to its neighbours by this factor once a turn is taken off.
CLOSER = 0.25
# The mean velocity between samples may differ from dq/dt by this share before v is taken for wrong.
MISMATCH = 0.5
RESOLVED = 0.2  # share by which dq/dt may change from step to step where the mean velocity must agree with it
FEW = 8  # points below which velocities may be anything but degrees
STOPS = 50  # points up to which velocities of zero at all of them are stops, not missing values
# Beyond these a motion is taken for a slip of units: angle [rad], multiple of the size of the machine, speed [rad/s or
# m/s], acceleration [rad/s^2 or m/s^2], torque as a multiple of weight times size of the machine.
ANGLE, SIZES, SPEED, ACCELERATION, TORQUE = 4.0 * np.pi, 50.0, 100.0, 1e4, 1e3


def checked(recording: Recording) -> Recording:
    """Return a recording with unwrapped angles and plausible velocities; its notes tell every change.

    Raises:
        ValueError: velocities that are not the rate of the positions, such as deg/s beside rad.
    """
    return _checked_velocities(_unwrapped(recording))


def _unwrapped(recording: Recording) -> Recording:
    """Return a recording whose angles have no jumps by a turn; coordinates in metres are left as they are."""
    q, notes = recording.q.copy(), []
    steps = np.diff(q, axis=0)
    if len(steps) < 2:
        return recording
    for i, label in enumerate(recording.labels):
        jumps = np.abs(steps[:, i]) > np.pi
        if label.unit not in ("rad", "") or not np.any(jumps) or np.ptp(q[:, i]) > TURN * 1.001:
            continue
        turns = TURN * np.round(steps[:, i] / TURN)
        expected = _expected_steps(recording, i, jumps)
        closer = np.abs(steps[:, i] - turns - expected) <= CLOSER * np.abs(steps[:, i] - expected)
        if not np.all(closer[jumps]):
            continue
        q[1:, i] -= np.cumsum(np.where(jumps, turns, 0.0))
        k = int(np.argmax(jumps))
        notes.append(
            f"{label.name} steps by a turn at {np.sum(jumps)} points, first at {recording.t[k + 1]:.6g} s: an angle "
            "wrapped at half or at full turns; it is unwrapped"
        )
    return replace(recording, q=q, notes=(*recording.notes, *notes)) if notes else recording


def _expected_steps(recording: Recording, i: int, jumps: Array) -> Array:
    """Return the steps (K - 1,) of coordinate i by its velocities, or by the steps beside the jumps."""
    width = np.diff(recording.t)
    if recording.v is not None:
        return np.asarray((recording.v[:-1, i] + recording.v[1:, i]) / 2.0 * width)
    good = np.flatnonzero(~jumps)
    if not len(good):
        return np.zeros(len(width))
    slopes = np.diff(recording.q[:, i])[good] / width[good]
    return np.asarray(np.interp(np.arange(len(width)), good, slopes) * width)


def _checked_velocities(recording: Recording) -> Recording:
    v = recording.v
    if v is None:
        return recording
    names = ", ".join(label.name for label in recording.labels)
    slope = np.diff(recording.q, axis=0) / np.diff(recording.t)[:, None]
    if not np.any(v) and np.any(slope):
        if len(recording.t) > STOPS:
            note = f"the velocities of {names} are zero in all {len(v)} samples, as if they had not been recorded"
            return replace(recording, v=None, a=None, notes=(*recording.notes, f"{note}; they are not used"))
        note = "the velocities are zero at all points: the motion stops at each of them"
        return recording if len(v) == 2 else replace(recording, notes=(*recording.notes, note))
    mean = (v[:-1] + v[1:]) / 2.0
    for i, label in enumerate(recording.labels):
        size, own = np.linalg.norm(slope[:, i]), np.linalg.norm(mean[:, i])
        ratio = float(np.sum(mean[:, i] * slope[:, i]) / max(np.sum(slope[:, i] ** 2), 1e-300))
        apart = np.linalg.norm(mean[:, i] - slope[:, i])
        change = np.linalg.norm(np.diff(slope[:, i])) if len(slope) > 2 else np.inf
        stops = np.sum((v[1:-1, i] == 0.0) & (slope[1:, i] != 0.0)) > 0.1 * len(v)
        # Between coarse points the mean of the two velocities says little; only a factor is then a slip.
        fine = change <= RESOLVED * size and not stops
        several = len(v) >= FEW
        wrong = several and ((fine and apart > MISMATCH * max(size, own) + 1e-9) or own > 10.0 * size + 1e-6)
        degrees = abs(ratio - 180.0 / np.pi) < 5.0 and ratio * size > 0.9 * own
        if wrong or degrees or (several and ratio < -0.5):
            hint = " (deg/s beside rad?)" if abs(ratio - 180.0 / np.pi) < 5.0 else ""
            raise ValueError(
                f"velocity {i + 1} is not the rate of coordinate {i + 1}, {label.name}: about {ratio:.3g} times{hint}"
            )
    return recording


def implausible(table: TorqueTable) -> list[str]:
    """Return sentences about positions, speeds, accelerations and torques that no such machine has, positions first.

    Args:
        table: of a motion.
    """
    machine, rows = table.machine, table
    size = _size(machine)
    weight = 9.81 * float(sum(value for name, value in machine.nominal.items() if name.startswith("m_")))
    positions, sentences = [], []
    for i, c in enumerate(machine.coordinates):
        angle = c.unit == "rad"
        farthest = float(np.max(np.abs(rows.q[:, i])))
        if angle and farthest > ANGLE:
            cause = "a curve that swings out between its points?" if _swings(table, i) else "degrees?"
            positions.append(f"{c.name} reaches {farthest:.4g} rad, {farthest / TURN:.3g} turns: {cause}")
        elif not angle and farthest > SIZES * size:
            positions.append(f"{c.name} reaches {farthest:.4g} m, the machine is about {size:.3g} m long: millimetres?")
        torque = TORQUE * max(weight, 10.0) * (size if angle else 1.0)
        for symbol, part, most, unit in (
            (f"d{c.name}/dt", rows.v, SPEED, f"{c.unit}/s"), (f"d2{c.name}/dt2", rows.a, ACCELERATION, f"{c.unit}/s^2"),
            (f"tau_{c.name}", rows.tau, torque, c.force_unit),
        ):  # fmt: skip
            k = int(np.argmax(np.abs(part[:, i])))
            if abs(part[k, i]) > most:
                sentences.append(
                    f"{symbol} is {part[k, i]:.4g} {unit} at {rows.t[k]:.6g} s: wrong units, a wrapped angle, or times "
                    "too close?"
                )
    return [*positions, *sentences]


def _swings(table: TorqueTable, i: int) -> bool:
    """Whether coordinate i is far out between the points of a spline only."""
    points = table.knots if len(table.knots) else table.t
    return bool(np.max(np.abs(table.derivative(points, 0)[:, i])) <= ANGLE)


def _size(machine: Manipulator) -> float:
    """Return the sum of the lengths of a machine, at least 1 [m]."""
    lengths = (abs(value) for name, value in machine.nominal.items() if name[:2].lower() in ("l_", "s_", "d_", "a_"))
    return max(float(sum(lengths)), 1.0)


def stated_by(labels: tuple[Label, ...]) -> bool:
    """Whether labels that a user gave state a unit for every coordinate."""
    return bool(labels) and all(label.unit for label in labels)
