"""Recorded motions: checked samples of t, q and maybe v and a."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.motions.coordinate_labels import numbered
from ocp import checks
from ocp.checks import Array
from ocp.system import Label

# Two rows with the same positions nearer to each other than this share of the usual step are one row.
DOUBLED = 1e-2


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of a motion.

    Rows of masked arrays that are masked in any column are left out. Of two rows with the same positions whose times
    differ by less than a hundredth of the usual step (a work-around for equal time stamps) one is left out. The notes
    tell both.

    Args:
        t: (K,) increasing [s].
        q: (K, n) [rad or m].
        v, a: (K, n) or None.
        labels: name and unit of every coordinate; the unit may be empty.
        notes: sentences about what was read.
        stated: whether the file states the units; otherwise positions that look like degrees or millimetres are
            refused when torques are computed.

    Raises:
        ValueError: shapes disagree, numbers that are not finite, or times that do not increase.
    """

    t: Array
    q: Array
    v: Array | None = None
    a: Array | None = None
    labels: tuple[Label, ...] = ()
    notes: tuple[str, ...] = ()
    stated: bool = False

    def __post_init__(self) -> None:
        kept = _unmasked(self.t, self.q, self.v, self.a)
        for name in ("t", "q", "v", "a"):
            given: object = getattr(self, name)
            if given is None and name in ("v", "a"):
                continue
            array = checks.real(given if kept is None else np.ma.getdata(np.ma.asarray(given))[kept])
            if array is None:
                raise checks.refused(name, given, "numbers")
            array = array.copy()  # so that changes of the caller's array do not reach the checked samples
            if name != "t" and array.ndim == 1:
                array = array[:, None]
            object.__setattr__(self, name, array)
        if kept is not None:
            self._note(f"{np.sum(~kept)} of {len(kept)} samples are masked and left out")
        self._check_shapes()
        self._leave_out_doubled()
        falling = np.flatnonzero(np.diff(self.t) <= 0.0)
        if len(falling):
            k = int(falling[0])
            what = "repeated" if self.t[k] == self.t[k + 1] else "not increasing"
            where = f"sample {k + 1} at {self.t[k]:.9g} s, sample {k + 2} at {self.t[k + 1]:.9g} s"
            raise ValueError(f"times are {what}: {where}; give increasing ones")
        if not self.labels:
            object.__setattr__(self, "labels", numbered(self.q.shape[1]))

    def _check_shapes(self) -> None:
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
                check_finite(name, part)

    def _leave_out_doubled(self) -> None:
        """Leave out the second of two rows with nearly the same time and the same positions."""
        step = np.diff(self.t)
        usual = float(np.median(np.abs(step)))
        doubled = (step > 0.0) & (step < DOUBLED * usual) & np.all(self.q[1:] == self.q[:-1], axis=1)
        if not np.any(doubled):
            return
        k = int(np.argmax(doubled))
        self._note(
            f"{np.sum(doubled)} samples stand twice, less than {DOUBLED:g} of the usual step apart, and are left out; "
            f"the first is sample {k + 2} at {self.t[k + 1]:.9g} s"
        )
        kept = np.concatenate([[True], ~doubled])
        for name in ("t", "q", "v", "a"):
            part = getattr(self, name)
            if part is not None:
                object.__setattr__(self, name, part[kept])

    def _note(self, sentence: str) -> None:
        object.__setattr__(self, "notes", (*self.notes, sentence))


def check_rows(times_name: str, times: object, name: str, rows: object) -> Recording:
    """Return times (K,) and rows (K, n) as a checked recording.

    Args:
        times_name, name: of the arguments, for messages.
        times: (K,) increasing.
        rows: (K, n) or (K,).

    Raises:
        ValueError: shapes that disagree, numbers that are not finite, times that do not increase.
    """
    t, q = checks.real(times), checks.real(rows)
    if t is None or t.ndim != 1:
        raise checks.refused(times_name, times, "increasing times (K,)")
    if q is None or q.ndim not in (1, 2):
        raise checks.refused(name, rows, "finite numbers (K, n)")
    if len(t) != len(q):
        raise ValueError(f"{name}: has {len(q)} rows, {times_name} has {len(t)}, expected one row for each time")
    check_finite(times_name, t)
    check_finite(name, q)
    return Recording(t, q)


def named(recording: Recording, labels: tuple[Label, ...]) -> Recording:
    """Return a recording with the labels of a machine of as many coordinates; as it is for any other number."""
    return replace(recording, labels=labels) if len(labels) == len(recording.labels) else recording


def check_finite(name: str, rows: Array) -> None:
    """Raise ValueError with the first row that is not finite."""
    wrong = np.flatnonzero(~np.isfinite(rows.reshape(len(rows), -1)).all(axis=1))
    if len(wrong):
        raise ValueError(
            f"{name} is not finite in sample {wrong[0] + 1} of {len(rows)} (NaN or infinite), expected numbers"
        )


def _unmasked(*parts: object) -> Array | None:
    """Return which rows (K,) are masked in no part; None if nothing is masked."""
    masks = [np.asarray(np.ma.getmaskarray(part)) for part in parts if isinstance(part, np.ma.MaskedArray)]
    if not any(np.any(mask) for mask in masks):
        return None
    masked = [np.asarray(mask.reshape(mask.shape[0], -1).any(axis=1)) for mask in masks if mask.ndim]
    if len({mask.shape[0] for mask in masked}) != 1:
        return None
    return np.asarray(~np.any(masked, axis=0))
