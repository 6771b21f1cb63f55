"""Recorded motions: samples of t, q and maybe v and a, checked, from CSV, NumPy and ROS JointTrajectory files."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from models.motions.piecewise import Array
from ocp import checks
from ocp.system import Label

# Angles beyond this without a unit are taken for degrees [rad].
SUSPICIOUS = 4.0 * np.pi
# The mean velocity between samples may differ from dq/dt by this share of its size before v is taken for wrong.
MISMATCH = 0.5
TRAJECTORY_KEYS = ("joint_trajectory", "trajectory")


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of a motion.

    Args:
        t: (K,) increasing [s].
        q: (K, n) [rad or m].
        v, a: (K, n) or None.
        labels: name and unit of every coordinate; the unit may be empty.
        notes: sentences about what was read.

    Raises:
        ValueError: shapes disagree, numbers that are not finite, times that do not increase, or v is not dq/dt.
    """

    t: Array
    q: Array
    v: Array | None = None
    a: Array | None = None
    labels: tuple[Label, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("t", "q", "v", "a"):
            given: object = getattr(self, name)
            if given is None and name in ("v", "a"):
                continue
            array = checks.real(given)
            if array is None:
                raise checks.refused(name, given, "numbers")
            array = array.copy()  # samples that change later are not those that have been checked
            if name != "t" and array.ndim == 1:
                array = array[:, None]
            object.__setattr__(self, name, array)
        t, q = self.t, self.q
        if t.ndim != 1 or q.ndim != 2 or len(t) != len(q):
            raise ValueError(f"t has shape {t.shape}, q has shape {q.shape}, expected (K,) and (K, n)")
        if len(t) < 2:
            raise ValueError(f"{len(t)} samples, expected at least 2")
        for name, part in (("v", self.v), ("a", self.a)):
            if part is not None and part.shape != q.shape:
                raise ValueError(f"{name} has shape {part.shape}, q has shape {q.shape}; they must agree")
        for name, part in (("t", t), ("q", q), ("v", self.v), ("a", self.a)):
            if part is not None:
                _check_finite(name, part)
        falling = np.flatnonzero(np.diff(t) <= 0.0)
        if len(falling):
            k = int(falling[0])
            what = "repeated" if t[k] == t[k + 1] else "not increasing"
            told = f"times are {what}: sample {k + 1} at {t[k]:.9g} s, sample {k + 2} at {t[k + 1]:.9g} s"
            raise ValueError(f"{told}; give increasing ones")
        if self.v is not None:
            self._check_velocities(self.v)
        if not self.labels:
            object.__setattr__(self, "labels", tuple(Label(f"q{i + 1}") for i in range(q.shape[1])))

    def _check_velocities(self, v: Array) -> None:
        """Refuse velocities that are not the rate of the positions, such as deg/s beside rad."""
        slope = np.diff(self.q, axis=0) / np.diff(self.t)[:, None]
        mean = (v[:-1] + v[1:]) / 2.0
        size, apart = np.linalg.norm(slope, axis=0), np.linalg.norm(mean - slope, axis=0)
        wrong = np.flatnonzero(apart > MISMATCH * np.maximum(size, np.linalg.norm(mean, axis=0)) + 1e-9)
        if len(wrong):
            i = int(wrong[0])
            ratio = float(np.sum(mean[:, i] * slope[:, i]) / max(np.sum(slope[:, i] ** 2), 1e-300))
            hint = " (deg/s beside rad?)" if abs(ratio - 180.0 / np.pi) < 5.0 else ""
            raise ValueError(f"velocity {i + 1} is not the rate of coordinate {i + 1}: about {ratio:.3g} times{hint}")


def check_rows(times_name: str, times: object, name: str, rows: object) -> None:
    """Refuse rows (K, n) that are not one for each of K times, by the names that the user gave them."""
    t, q = checks.real(times), checks.real(rows)
    if t is None or t.ndim != 1:
        raise checks.refused(times_name, times, "increasing times (K,)")
    if q is None or q.ndim not in (1, 2):
        raise checks.refused(name, rows, "finite numbers (K, n)")
    if len(t) != len(q):
        raise ValueError(f"{name}: has {len(q)} rows, {times_name} has {len(t)}, expected one row for each time")
    _check_finite(times_name, t)
    _check_finite(name, q)


def _check_finite(name: str, rows: Array) -> None:
    wrong = np.flatnonzero(~np.isfinite(rows.reshape(len(rows), -1)).all(axis=1))
    if len(wrong):
        raise ValueError(
            f"{name} is not finite in sample {wrong[0] + 1} of {len(rows)} (NaN or infinite), expected numbers"
        )


def check_labels(labels: object) -> None:
    """Refuse what is no tuple of Labels."""
    if not isinstance(labels, tuple | list) or not all(isinstance(label, Label) for label in labels):
        raise TypeError(f"labels: got {checks.shown(labels)}, expected a tuple of Labels")


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
