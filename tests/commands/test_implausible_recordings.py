"""Slips of units, of times and of wrapped angles are found in recordings from every source."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from models import Motion, Scene, spherical
from models.effects import Gravity
from models.motions.ros_trajectory import as_trajectory

ROOT = Path(__file__).parents[2]
ARM = spherical()
NAMES = [c.name for c in ARM.coordinates]
T = np.linspace(0.0, 2.0, 81)
PLAIN = Motion.quintic([0.9, -0.5, 0.1, 0.85], [1.4, 0.8, 0.4, 0.9], 2.0)


def text(t, q, separator=","):
    rows = (separator.join(repr(float(x)) for x in (when, *row)) for when, row in zip(t, q, strict=True))
    return "\n".join([separator.join(["t", *NAMES]), *rows]) + "\n"


def states(t, q):
    return [{"header": {"stamp": {"sec": 0, "nanosec": round(1e9 * when)}}, "name": NAMES, "position": row.tolist()}
            for when, row in zip(t, q, strict=True)]  # fmt: skip


def samples(path, t, q):
    return Motion.from_samples(t, q, noise=0.0)


def read(path):
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        from reports.motion_file import Reading, read_motion
    finally:
        sys.path.remove(str(ROOT / "scripts"))
    return read_motion(path, Scene(ARM, (Gravity(),)), Reading(noise=0.0))


def of(suffix, content):
    """Return a source: a function that writes samples to a file and reads it."""

    def source(path, t, q):
        file = path.with_suffix(suffix)
        file.write_text(content(t, q), encoding="utf-8")
        return read(file)

    return source


def arrays(path, t, q):
    np.savez(path.with_suffix(".npz"), t=t, q=q)
    return read(path.with_suffix(".npz"))


def trajectory(t, q):
    message = as_trajectory(t, q, q, q, NAMES)
    for point in message["points"]:
        del point["velocities"], point["accelerations"]
    return json.dumps(message)


SOURCES = {
    "from_samples": samples,
    "CSV": of(".csv", text),
    "tabs": of(".tsv", lambda t, q: text(t, q, "\t")),
    "JointTrajectory": of(".json", trajectory),
    "JointState": of(".jsonl", lambda t, q: "\n".join(json.dumps(state) for state in states(t, q))),
    "YAML": of(".yaml", trajectory),
    "NPZ": arrays,
}
DEGREES = np.array([180 / np.pi, 180 / np.pi, 180 / np.pi, 1.0])
SLIPS = {
    "degrees": (lambda t, q: (t, q * DEGREES), "degrees"),
    "millimetres": (lambda t, q: (t, q * [1, 1, 1, 1000]), "millimet"),
    "milliseconds taken for microseconds": (lambda t, q: (1e-3 * t, q), "wrong units"),
    "a sample that leaps": (lambda t, q: (t, q + np.outer(t == t[40], [0.0, 2.5, 0.0, 0.0])), "wrong units"),
}


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_refused_from_every_source(slip, source, tmp_path):
    if source == "YAML":
        pytest.importorskip("yaml", reason="reading YAML needs PyYAML")
    change, words = SLIPS[slip]
    with pytest.raises(ValueError, match=words):
        SOURCES[source](tmp_path / "m", *change(T, PLAIN.q(T))).torques(ARM, [Gravity()])


@pytest.mark.parametrize("source", SOURCES)
def test_wrapped_angles_are_unwrapped_from_every_source(source, tmp_path):
    if source == "YAML":
        pytest.importorskip("yaml", reason="reading YAML needs PyYAML")
    far = Motion.quintic([0.9, 2.0, 0.1, 0.85], [1.4, 4.5, 0.4, 0.9], 2.0)
    q = far.q(T)
    wrapped = np.column_stack([q[:, 0], (q[:, 1] + np.pi) % (2 * np.pi) - np.pi, q[:, 2:]])
    assert np.ptp(wrapped[:, 1]) > 6.0
    motion = SOURCES[source](tmp_path / "m", T, wrapped)
    assert any("unwrapped" in note for note in motion.notes)
    found, expected = (one.torques(ARM, [Gravity()]).loads for one in (motion, far))
    np.testing.assert_allclose([one.peak for one in found], [one.peak for one in expected], rtol=1e-3)


def test_wrapped_angles_with_velocities_are_unwrapped():
    far = Motion.quintic([0.9, 2.0, 0.1, 0.85], [1.4, 4.5, 0.4, 0.9], 2.0)
    q = far.q(T)
    wrapped = np.column_stack([q[:, 0], (q[:, 1] + np.pi) % (2 * np.pi) - np.pi, q[:, 2:]])
    motion = Motion.from_samples(T, wrapped, far.v(T), far.a(T))
    expected = [one.peak for one in far.torques(ARM, [Gravity()]).loads]
    np.testing.assert_allclose([one.peak for one in motion.torques(ARM, [Gravity()]).loads], expected, rtol=1e-4)
