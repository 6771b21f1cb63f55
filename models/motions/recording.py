"""Recorded motions: samples of t, q and maybe v and a, checked, from CSV, NumPy and ROS JointTrajectory files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.system import Label

# Angles beyond this without a unit are taken for degrees [rad].
SUSPICIOUS = 4.0 * np.pi
# The mean velocity between samples may differ from dq/dt by this share of its size before v is taken for wrong.
MISMATCH = 0.5


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
