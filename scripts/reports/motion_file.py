"""Motions from files of every kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from models import Motion, Scene, through_tool_points
from models.motions.coordinate_labels import labels_of
from models.motions.csv_tables import column_names, read_csv, read_waypoints
from models.motions.recording import Recording
from models.scenes import catalogue
from ocp import load
from ocp.system import Label
from reports.fastest_path import fastest

TOOL = ("x", "y", "z")  # columns of a path of the tool
Noise = float | Sequence[float] | None
Say = Callable[[str], None]


def read_motion(
    path: Path, scene: Scene, noise: Noise, torque: Sequence[float] | None, speed: Sequence[float] | None, say: Say
) -> Motion:
    """Return the motion in a file, whatever its kind.

    Args:
        path: .csv with the columns t, q; t, x, y, z of the tool; or q only (waypoints); .json, .yaml, .yml; .npz.
        scene: machine and effects.
        noise: of samples; None: estimated.
        torque, speed: limits of the drives, for waypoints without times.
        say: told what is worth knowing.

    Raises:
        OSError, ValueError, ImportError: no motion in the file; one sentence says why.
    """
    machine = scene.machine
    kind = path.suffix.lower()
    if kind in (".json", ".yaml", ".yml"):
        return Motion.from_trajectory(path, machine, noise=noise)
    if kind == ".npz":
        return from_npz(path, scene, noise)
    if kind != ".csv":
        raise ValueError(f"{path}: the kind {kind!r} is unknown, expected .csv, .json, .yaml, .yml or .npz")
    names = column_names(path)
    if names[0] == "t" and set(TOOL) <= set(names):
        points = read_csv(path, [Label(axis, "m") for axis in TOOL])
        return through_tool_points(machine, points.t, points.q)
    if names[0] == "t":
        return Motion.from_csv(path, machine, noise=noise)
    if torque is None:
        raise ValueError(f"{path}: has no column t; give --limit to run through its waypoints in minimum time")
    waypoints = read_waypoints(path, labels_of(machine))
    motion, solution = fastest(machine, scene.effects, waypoints, torque, speed)
    if not solution.ok:
        raise ValueError(f"{path}: no timing of the waypoints was found: {solution.message}")
    say(f"waypoints    run through in {motion.duration:.6g} s, minimum time ({solution.iterations} iterations)")
    return motion


def from_npz(path: Path, scene: Scene, noise: Noise) -> Motion:
    """Return the motion of a solution file, found out in which form and frame, or of arrays t, q, v, a."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in ("t", "q", "v", "a") if name in file.files}
    except (OSError, FileNotFoundError):
        raise
    except Exception as error:  # zipfile, zlib and numpy each raise their own for damaged bytes
        raise ValueError(f"{path}: no readable NPZ file ({error})") from None
    if "t" in arrays and "q" in arrays:
        recording = Recording(arrays["t"], arrays["q"], arrays.get("v"), arrays.get("a"), labels_of(scene.machine))
        return Motion.recorded(recording, noise=noise)
    solution = load(path)
    for form in catalogue.forms().values():
        for frame in scene.machine.frames:
            try:
                return Motion.of(solution, form(scene.machine, scene.effects, frame))
            except ValueError:
                continue
    raise ValueError(
        f"{path}: the solution is not of {scene.machine.name} with these parameters, in any form and frame"
    )
