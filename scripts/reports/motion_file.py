"""Motions from files of every kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from models import Envelope, Motion, Scene, along_tool_path, path_through, sampled, through_tool_points
from models.motions.coordinate_labels import labels_of
from models.motions.csv_tables import column_names, read_csv, read_waypoints
from models.motions.opensim_tables import read_opensim
from models.motions.recording import Recording
from models.motions.splines import natural, not_a_knot
from models.motions.tool_paths import is_moving_at_its_ends
from models.scenes import catalogue
from ocp import load
from ocp.system import Label
from reports.fastest_path import Limits, fastest

TOOL = ("x", "y", "z")  # columns of a path of the tool
KINDS = ".csv, .txt, .tsv, .mot, .sto, .json, .jsonl, .yaml, .yml or .npz"
TABLES = (".csv", ".txt", ".tsv")
POINTS = 401  # of a tool path, through which a path in coordinates is laid
Noise = float | Sequence[float] | None
Say = Callable[[str], None]


@dataclass(frozen=True)
class Reading:
    """How a file is read.

    Args:
        noise: standard deviation of samples; None: estimated.
        envelopes: limits of the drives, for waypoints without times.
        limits: limits on signals, for waypoints without times.
        joints: name in the file -> name of the coordinate.
        branch: of the inverse kinematics, for points of the tool.
        say: called with sentences about what was computed.
    """

    noise: Noise = None
    envelopes: Sequence[Envelope] = ()
    limits: Limits = field(default_factory=dict)
    joints: Mapping[str, str] = field(default_factory=dict)
    branch: str | None = None
    say: Say = lambda _: None


def read_motion(path: Path, scene: Scene, reading: Reading) -> Motion:
    """Return the motion in a file, whatever its kind.

    Args:
        path: a table with the columns t, q; t, x, y, z of the tool; or without t (waypoints); an OpenSim storage
            file; ROS messages in JSON or YAML; a solution or arrays in NPZ.
        scene: machine and effects.
        reading: how it is read.

    Raises:
        OSError, ValueError, ImportError: no motion in the file; one sentence says why.
    """
    machine, kind = scene.machine, path.suffix.lower()
    if kind in (".json", ".jsonl", ".yaml", ".yml"):
        return Motion.from_trajectory(path, machine, noise=reading.noise, joints=reading.joints)
    if kind == ".npz":
        return from_npz(path, scene, reading.noise)
    if kind in (".mot", ".sto"):
        recording = read_opensim(path, labels_of(machine), reading.joints)
        return Motion.recorded(recording, noise=reading.noise)
    if kind not in TABLES:
        raise ValueError(f"{path}: the kind {kind!r} is unknown, expected {KINDS}")
    names = column_names(path)
    if names[0] == "t":
        if not set(TOOL) <= set(names):
            return Motion.from_csv(path, machine, noise=reading.noise, joints=reading.joints)
        points = read_csv(path, [Label(axis, "m") for axis in TOOL])
        moving = is_moving_at_its_ends(points.t, points.q)
        motion = through_tool_points(
            machine, points.t, points.q, branch=reading.branch, ends=not_a_knot() if moving else None
        )
        notes = ["the points of the tool move at their ends: no rest is assumed there"] if moving else []
        return replace(motion, notes=(*points.notes, *notes, *motion.notes))
    return _waypoints(path, names, scene, reading)


def _waypoints(path: Path, names: Sequence[str], scene: Scene, reading: Reading) -> Motion:
    """Return the fastest motion through waypoints, of the coordinates or of the tool."""
    if not reading.envelopes and not reading.limits:
        raise ValueError(
            f"{path}: has no column t; give --limit, or [limits] in the scene, to run through its waypoints in minimum "
            "time"
        )
    if set(TOOL) <= set(names):
        waypoints = read_waypoints(path, [Label(axis, "m") for axis in TOOL])
        route = _tool_route(scene, waypoints.q, reading.branch)
    else:
        waypoints = read_waypoints(path, labels_of(scene.machine), reading.joints)
        route = path_through(waypoints.q)
    route = replace(route, notes=(*waypoints.notes, *route.notes), labels=labels_of(scene.machine))
    motion, solution, lowered = fastest(scene.machine, scene.effects, route, reading.envelopes, reading.limits)
    if not solution.ok:
        raise ValueError(f"{path}: no timing of the waypoints was found: {solution.message}")
    margin = f", limits lowered by {100.0 * lowered:.2g} % to hold between its nodes" if lowered > 1e-6 else ""
    reading.say(
        f"waypoints    run through in {motion.duration:.6g} s, minimum time on {len(solution.grid)} elements "
        f"({solution.iterations} iterations{margin})"
    )
    return motion


def _tool_route(scene: Scene, points: np.ndarray, branch: str | None) -> Motion:
    """Return the path in coordinates along a spline of the tool through points, s its length."""
    path = sampled(points)
    law = Motion.of_time(lambda t: t, path.length, smoothness=4)
    along = along_tool_path(scene.machine, path, law, branch=branch)
    s = np.linspace(0.0, path.length, POINTS)
    route = Motion.through(s / path.length, along.q(s), ends=natural(5))
    return replace(route, stated=True, notes=along.notes)


def from_npz(path: Path, scene: Scene, noise: Noise) -> Motion:
    """Return the motion of a solution file, whose form and frame are found by trial, or of arrays t, q, v, a."""
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
