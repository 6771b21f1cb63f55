"""Motions in ROS messages: JointTrajectory, alone or inside of others, and streams of JointState."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from models.motions.recording import Recording
from models.motions.ros_messages import inside, read_messages
from ocp import checks
from ocp.checks import Array
from ocp.system import Label

ORDERS = ("positions", "velocities", "accelerations")
# Positions at which one trajectory of a list ends and the next begins may differ by this [rad or m].
JOINED = 1e-3
Joints = Mapping[str, str] | None  # name in the file -> name of the coordinate


def read_trajectory(path: str | os.PathLike[str], names: Sequence[str] = (), joints: Joints = None) -> Recording:
    """Read a ROS trajectory_msgs/JointTrajectory or a stream of sensor_msgs/JointState, as JSON or YAML.

    A JointTrajectory may stand inside of other messages (RobotTrajectory, goals of actions), and several of them that
    join make one motion. Joints that the machine does not have are left out, and the notes tell it.

    Args:
        path: of the file, .json, .jsonl, .yaml or .yml (YAML needs the extra `ros`).
        names: coordinate names of the machine; joints of these names are brought into this order.
        joints: name in the file -> name of the coordinate, for other names.

    Raises:
        OSError: no such file.
        ValueError: no trajectory; the sentence says what is missing.
        ImportError: YAML without PyYAML.
    """
    messages = read_messages(path)
    try:
        return trajectory(messages[0] if len(messages) == 1 else messages, names, joints)
    except ValueError as error:
        raise ValueError(f"{checks.path('path', path)}: {error}") from None


def trajectory(message: Any, names: Sequence[str] = (), joints: Joints = None) -> Recording:
    """Return the recording in a message, or a list of messages, given as plain data; see `read_trajectory`."""
    result = list(inside(message, ("points",)))
    if result:
        parts = [_one(part, names, joints) for part in result]
        return parts[0] if len(parts) == 1 else _joined(parts)
    states = list(inside(message, ("name", "position")))
    if states:
        return _stream(states, names, joints)
    raise ValueError("no JointTrajectory, expected joint_names and a list of points, or a stream of JointState")


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


def _one(message: Mapping[str, Any], names: Sequence[str], joints: Joints) -> Recording:
    """Return the recording of one JointTrajectory."""
    given, points = message.get("joint_names"), message["points"]
    if not isinstance(points, list):
        raise ValueError("no JointTrajectory, expected joint_names and a list of points")
    if not isinstance(given, list) or not given or not all(isinstance(j, str) for j in given):
        raise ValueError("joint_names is missing, expected a list of names")
    if not points:
        raise ValueError("points is empty, expected at least 2")
    t, columns = [], {key: [] for key in ORDERS}  # type: ignore[var-annotated]
    for k, point in enumerate(points, 1):
        if not isinstance(point, Mapping) or "positions" not in point or "time_from_start" not in point:
            raise ValueError(f"point {k} has no positions or no time_from_start")
        t.append(_seconds(point["time_from_start"], f"point {k}: time_from_start"))
        for key, column in columns.items():
            row = point.get(key) or []
            numbers = isinstance(row, list) and not any(isinstance(value, bool | str) for value in row)
            if row and not (numbers and len(row) == len(given)):
                raise ValueError(f"point {k}: {key} must be a list of {len(given)} numbers, one for each joint")
            column.append(row)
    filled = {key: [bool(row) for row in column] for key, column in columns.items()}
    if not all(filled["positions"]):
        raise ValueError("a point has no positions")
    for key in ORDERS[1:]:
        if any(filled[key]) and not all(filled[key]):
            raise ValueError(f"{key} stand at some points only; give them at all points or at none")
    order, labels, notes = _order(given, names, joints)
    values = [
        checks.numbers(key, column, "lists of finite numbers")[:, order] if all(filled[key]) else None
        for key, column in columns.items()
    ]
    assert values[0] is not None
    return Recording(np.array(t), values[0], values[1], values[2], labels, tuple(notes))


def _stream(states: Sequence[Mapping[str, Any]], names: Sequence[str], joints: Joints) -> Recording:
    """Return the recording of messages of the kind JointState, with the names of the first that has all joints."""
    t, rows, rates = [], [], []
    wanted: list[str] | None = None
    labels: tuple[Label, ...] = ()
    notes: list[str] = []
    for k, state in enumerate(states, 1):
        own, q, v = state.get("name"), state.get("position"), state.get("velocity") or []
        if not isinstance(own, list) or not isinstance(q, list) or len(own) != len(q):
            raise ValueError(f"JointState {k}: name and position must be lists of the same length")
        if wanted is None:
            order, labels, notes = _order(own, names, joints)
            wanted = [own[i] for i in order]
        if not set(wanted) <= set(own):
            continue  # such as the state of a gripper, published in between
        order = [own.index(name) for name in wanted]
        header = state.get("header")
        if not isinstance(header, Mapping) or "stamp" not in header:
            raise ValueError(f"JointState {k} has no header.stamp")
        stamp = header["stamp"]
        _seconds(stamp, f"JointState {k}: header.stamp")
        t.append(stamp)
        rows.append([q[i] for i in order])
        rates.append([v[i] for i in order] if len(v) == len(q) else None)
    times = _since_first(t)
    left = len(states) - len(t)
    notes = [f"{len(t)} messages of the kind JointState", *notes]
    notes += [f"{left} messages without these joints are left out"] if left else []
    v_given = None if any(row is None for row in rates) else checks.numbers("velocity", rates)
    q_given = checks.numbers("position", rows, "lists of finite numbers")
    if v_given is not None:
        # Measured velocities are noisy, and lag behind the positions.
        notes.append("velocities of a recording are not used")
    return Recording(times, q_given, None, None, labels, tuple(notes))


def _joined(parts: Sequence[Recording]) -> Recording:
    """Return trajectories that join as one motion.

    Raises:
        ValueError: one begins elsewhere than where the one before it ends.
    """
    whole = parts[0]
    for k, part in enumerate(parts[1:], 2):
        names = [label.name for label in part.labels]
        apart = np.max(np.abs(part.q[0] - whole.q[-1])) if part.q.shape[1] == whole.q.shape[1] else np.inf
        if names != [label.name for label in whole.labels] or apart > JOINED:
            raise ValueError(
                f"{len(parts)} trajectories that do not join: number {k} begins {apart:.3g} rad or m from the end of "
                "the one before; give one file for each"
            )
        # The first point of a trajectory is the last one of that before it.
        first = 1 if part.t[0] == 0.0 else 0
        t = np.concatenate([whole.t, whole.t[-1] + part.t[first:]])
        orders = [
            None if one is None or other is None else np.concatenate([one, other[first:]])
            for one, other in ((whole.q, part.q), (whole.v, part.v), (whole.a, part.a))
        ]
        assert orders[0] is not None
        whole = replace(whole, t=t, q=orders[0], v=orders[1], a=orders[2])
    return replace(whole, notes=(f"{len(parts)} trajectories, one after the other", *whole.notes))


def _order(
    given: Sequence[str], names: Sequence[str], joints: Joints
) -> tuple[list[int], tuple[Label, ...], list[str]]:
    """Return the indices of the joints in the order of the machine, their labels, and notes."""
    joints = joints or {}
    for name in joints:
        if name not in given:
            raise ValueError(f"no joint {name!r} to be taken for {joints[name]}; there is {', '.join(given)}")
    known = [joints.get(name, name) for name in given]
    notes, order = [], list(range(len(given)))
    if names and set(names) <= set(known):
        order = [known.index(name) for name in names]
        others = [given[i] for i in range(len(given)) if i not in order]
        notes += [f"joints left out: {', '.join(others)}"] if others else []
    elif names and len(names) == len(given) and not joints:
        notes.append(f"joints {', '.join(given)} are taken for {', '.join(names)}, in this order")
    elif names and (joints or len(given) > len(names)):
        missing = [name for name in names if name not in known]
        raise ValueError(
            f"the joints {', '.join(given)} do not name {', '.join(missing)} of the machine; say which joint is which, "
            f"as in --joints {given[0]}={missing[0]}"
        )
    return order, tuple(Label(known[i]) for i in order), notes


def _since_first(stamps: Sequence[Any]) -> Array:
    """Return stamps as seconds since the first: whole seconds are subtracted first, as an epoch costs seven digits."""
    pairs = []
    for stamp in stamps:
        if isinstance(stamp, Mapping):
            whole, fraction = ("sec", "nanosec") if "sec" in stamp else ("secs", "nsecs")
            pairs.append((stamp[whole], stamp.get(fraction, 0)))
        else:
            pairs.append((stamp, 0))
    return np.array([(whole - pairs[0][0]) + 1e-9 * (rest - pairs[0][1]) for whole, rest in pairs], dtype=float)


def _seconds(value: Any, what: str) -> float:
    """Return a time, from a number or from seconds and nanoseconds of ROS 1 or 2."""
    if isinstance(value, Mapping):
        for whole, fraction in (("sec", "nanosec"), ("secs", "nsecs")):
            if whole in value:
                parts = value[whole], value.get(fraction, 0)
                if all(isinstance(part, int | float) for part in parts):
                    return checks.number(what, parts[0]) + 1e-9 * checks.number(what, parts[1])
    if isinstance(value, int | float) and not isinstance(value, bool):
        return checks.number(what, value)
    raise ValueError(f"{what} is {checks.shown(value)}, expected seconds, or sec and nanosec")
