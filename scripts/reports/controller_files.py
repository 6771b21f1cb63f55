"""Motions at a fixed rate, for controllers: CSV tables and ROS JointTrajectory files."""

from __future__ import annotations

import json
from pathlib import Path

from models import Envelope, Motion, Scene
from models.motions.fixed_rate import times_at_rate
from models.motions.ros_trajectory import as_trajectory
from models.torques.table_text import PROGRAMS, TextFormat, columns_of, write_table
from reports.fastest_path import Limits, exceedance

NOTICED = 1e-3  # share by which interpolation between rows may exceed a limit without a note


def write_at_rate(
    folder: Path,
    stem: str,
    motion: Motion,
    scene: Scene,
    rate: float,
    limited: tuple[list[Envelope], Limits],
    style: TextFormat = PROGRAMS,
) -> list[str]:
    """Write a motion at a fixed rate from t = 0 as a CSV table and as a JointTrajectory; return notes about it.

    Args:
        folder: of the files.
        stem: first part of their names.
        motion: q(t).
        scene: machine and effects.
        rate: rows for a second [1/s].
        limited: limits of the drives, and limits on signals.
        style: of the table.
    """
    envelopes, limits = limited
    times = times_at_rate(motion, rate)
    table = motion.torques(scene.machine, scene.effects, times=times)
    header, columns = columns_of(table, tool=True)
    columns[0] = columns[0].copy()
    columns[0][:, 0] -= motion.start
    write_table(folder / f"{stem}_{rate:g}Hz.csv", header, columns, style)
    names = [c.name for c in scene.machine.coordinates]
    message = as_trajectory(times, table.q, table.v, table.a, names)
    (folder / f"{stem}_{rate:g}Hz.json").write_text(json.dumps(message), encoding="utf-8")
    notes = []
    if abs(motion.duration * rate - round(motion.duration * rate)) > 1e-6:
        notes.append(f"the motion takes {motion.duration:.9g} s, no multiple of 1/{rate:g} s: the last step is shorter")
    # A controller joins the rows by quintic polynomials of q, v and a.
    joined = Motion.from_samples(times, table.q, table.v, table.a, labels=motion.labels)
    before = exceedance(motion, scene.machine, scene.effects, envelopes, limits)
    after = exceedance(joined, scene.machine, scene.effects, envelopes, limits)
    if after > max(before, 1.0) + NOTICED:
        notes.append(
            f"joined by polynomials, rows at {rate:g} Hz exceed a limit by {100.0 * (after - 1.0):.2g} %, the motion "
            f"itself by {100.0 * (max(before, 1.0) - 1.0):.2g} %; take a higher rate"
        )
    return notes
