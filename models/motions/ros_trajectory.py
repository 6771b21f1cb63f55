"""Motions as ROS JointTrajectory messages in JSON and YAML."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from models.motions.recording import Recording
from ocp import checks
from ocp.checks import Array
from ocp.system import Label

TRAJECTORY_KEYS = ("joint_trajectory", "trajectory")


def read_trajectory(path: str | os.PathLike[str], names: Sequence[str] = ()) -> Recording:
    """Read a ROS trajectory_msgs/JointTrajectory, as JSON or (with the extra `ros`) as YAML.

    Args:
        path: of the file, .json, .yaml or .yml.
        names: coordinate names of the machine; joints of these names are brought into this order.

    Raises:
        OSError: no such file.
        ValueError: no trajectory; the sentence says what is missing.
        ImportError: YAML without PyYAML.
    """
    file = checks.path("path", path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{file}: no UTF-8 text") from None
    if not text.strip():
        raise ValueError(f"{file}: the file is empty")
    try:
        return trajectory(_parsed(file, text), names)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def trajectory(message: Any, names: Sequence[str] = ()) -> Recording:
    """Return the recording in a JointTrajectory message given as plain data; see `read_trajectory`."""
    if isinstance(message, Mapping):
        for key in TRAJECTORY_KEYS:
            if isinstance(message.get(key), Mapping):
                message = message[key]
    if not isinstance(message, Mapping) or not isinstance(message.get("points"), list):
        raise ValueError("no JointTrajectory, expected joint_names and a list of points")
    joints, points = message.get("joint_names"), message["points"]
    if not isinstance(joints, list) or not joints or not all(isinstance(j, str) for j in joints):
        raise ValueError("joint_names is missing, expected a list of names")
    if not points:
        raise ValueError("points is empty, expected at least 2")
    t, columns = [], {key: [] for key in ("positions", "velocities", "accelerations")}  # type: ignore[var-annotated]
    for k, point in enumerate(points, 1):
        if not isinstance(point, Mapping) or "positions" not in point or "time_from_start" not in point:
            raise ValueError(f"point {k} has no positions or no time_from_start")
        t.append(_seconds(point["time_from_start"], k))
        for key, column in columns.items():
            row = point.get(key) or []
            numbers = isinstance(row, list) and not any(isinstance(value, bool | str) for value in row)
            if row and not (numbers and len(row) == len(joints)):
                raise ValueError(f"point {k}: {key} must be a list of {len(joints)} numbers, one for each joint")
            column.append(row)
    filled = {key: [bool(row) for row in column] for key, column in columns.items()}
    if not all(filled["positions"]):
        raise ValueError("a point has no positions")
    for key in ("velocities", "accelerations"):
        if any(filled[key]) and not all(filled[key]):
            raise ValueError(f"{key} stand at some points only; give them at all points or at none")
    order, notes = list(range(len(joints))), []
    if names and set(names) == set(joints):
        order = [joints.index(name) for name in names]
    elif names and len(names) == len(joints):
        notes.append(f"joints {', '.join(joints)} are taken for {', '.join(names)}, in this order")
    values = {
        key: checks.numbers(key, column, "lists of finite numbers")[:, order] if all(filled[key]) else None
        for key, column in columns.items()
    }
    positions = values["positions"]
    assert positions is not None
    labels = tuple(Label(joints[i]) for i in order)
    return Recording(np.array(t), positions, values["velocities"], values["accelerations"], labels, tuple(notes))


def as_trajectory(t: Array, q: Array, v: Array, a: Array, names: Sequence[str]) -> dict[str, Any]:
    """Return a ROS JointTrajectory message as plain data, for JSON or YAML.

    Args:
        t: (K,) [s], counted from the first.
        q, v, a: (K, n).
        names: of the joints.
    """
    nanoseconds = np.round((t - t[0]) * 1e9).astype(np.int64)
    points = [
        {
            "positions": qk.tolist(),
            "velocities": vk.tolist(),
            "accelerations": ak.tolist(),
            "time_from_start": {"sec": int(ns // 10**9), "nanosec": int(ns % 10**9)},
        }
        for ns, qk, vk, ak in zip(nanoseconds, q, v, a, strict=True)
    ]
    return {"joint_names": list(names), "points": points}


def _parsed(file: Path, text: str) -> Any:
    if file.suffix.lower() == ".json":
        try:
            return json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise ValueError(f"no JSON ({error})") from None
    try:
        import yaml
    except ImportError:
        raise ImportError(
            f"{file}: reading YAML needs PyYAML; install it with pip install 'hamel[ros]', or give the trajectory as "
            "JSON"
        ) from None
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"no YAML ({' '.join(str(error).split())})") from None


def _seconds(value: Any, k: int) -> float:
    """Return the time of a point, from a number or from seconds and nanoseconds of ROS 1 or 2."""
    if isinstance(value, Mapping):
        for whole, fraction in (("sec", "nanosec"), ("secs", "nsecs")):
            if whole in value:
                parts = value[whole], value.get(fraction, 0)
                if all(isinstance(part, int | float) for part in parts):
                    told = f"point {k}: time_from_start"
                    return checks.number(told, parts[0]) + 1e-9 * checks.number(told, parts[1])
    if isinstance(value, int | float) and not isinstance(value, bool):
        return checks.number(f"point {k}: time_from_start", value)
    raise ValueError(f"point {k}: time_from_start is {checks.shown(value)}, expected seconds, or sec and nanosec")
