"""Curves of recorded samples: through exact ones, near noisy ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.motions.hermite_splines import accelerations, hermite
from models.motions.piecewise import Piecewise
from models.motions.recording import Recording
from models.motions.smoothing import ALL, Smoothed, smooth
from models.motions.splines import interpolate, not_a_knot
from ocp import checks
from ocp.checks import Array

Fit = tuple[Piecewise, float, Smoothed | None, tuple[str, ...]]  # curve, smoothness, smoothing spline, notes


def fit(recording: Recording, noise: float | Sequence[float] | None) -> Fit:
    """Return the curve of a recording.

    With v (and a) it passes through all that is given; with noise = 0 it interpolates q by a quintic spline with
    not-a-knot ends; else it is a quintic smoothing spline whose strength follows the noise. Samples in which no noise
    can be detected are interpolated, too: the accelerations of a smoothing spline are wrong at its ends.

    Args:
        recording: samples.
        noise: standard deviation of q, scalar or (n,) [rad or m]; None: estimated; if given, v and a are not used.

    Raises:
        ValueError: a noise that is no standard deviation >= 0, or too few samples.
    """
    t, q, notes = recording.t, recording.q, list(recording.notes)
    if recording.v is not None and noise is None:
        a = recording.a if recording.a is not None else accelerations(t, q, recording.v)
        return hermite(t, np.stack([q, recording.v, a], axis=1)), 2.0, None, tuple(notes)
    level = _level(noise, q.shape[1])
    if level is not None and not np.any(level):
        return interpolate(t, q, 5, not_a_knot()), 4.0, None, tuple(notes)
    if recording.v is not None:
        notes.append("velocities are not used, as the noise of the positions is given: the spline smooths these")
    smoothed = smooth(t, q, level)
    if level is None and np.all(smoothed.freedom > ALL * len(t)):
        notes.append("no noise can be detected in the samples; they are interpolated as if noise = 0 had been given")
        return interpolate(t, q, 5, not_a_knot()), 4.0, None, tuple(notes)
    return smoothed.curve, 4.0, smoothed, (*notes, *smoothed.notes(recording.labels))


@dataclass(frozen=True, eq=False)
class Differences:
    """Central differences of samples, joined by straight lines: they amplify noise, and serve for comparison only."""

    t: Array  # (K,) [s]
    derivatives: tuple[Array, Array, Array]  # of order 0, 1, 2, each (K, n)

    @classmethod
    def of(cls, t: Array, q: Array) -> Differences:
        """Form the differences of samples q (K, n) at times t (K,)."""
        v = np.gradient(q, t, axis=0)
        return cls(t, (q, v, np.gradient(v, t, axis=0)))

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        if order >= len(self.derivatives):
            raise ValueError("differences are formed up to the acceleration")
        return np.stack([np.interp(t, self.t, column) for column in self.derivatives[order].T], axis=1)


def _level(noise: float | Sequence[float] | None, n: int) -> Array | None:
    if noise is None:
        return None
    given = checks.real(noise)
    if given is None or given.shape not in ((), (1,), (n,)):
        raise checks.refused("noise", noise, f"one standard deviation or {n}, in rad or m")
    level = np.broadcast_to(given, (n,))
    if not (np.all(np.isfinite(level)) and np.all(level >= 0.0)):
        raise checks.refused("noise", noise, "standard deviations >= 0 in rad or m")
    if np.any((level > 0.0) & (level < checks.SMALLEST)) or np.any(level > checks.LARGEST):
        raise checks.refused("noise", noise, f"0, or standard deviations {checks.RANGE} in rad or m")
    if np.any(level) and not np.all(level):
        raise ValueError(f"noise: got {noise!r}; give a level > 0 for every coordinate, or 0 for all")
    return level
