"""Paths q(s) through waypoints without times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.motions.motion import Motion
from models.motions.profiles import points
from models.motions.splines import Ends, interpolate, natural
from ocp import checks
from ocp.checks import Array

# Waypoints nearer to each other than this share of the mean distance are one waypoint.
DOUBLED = 1e-3
# A distance below this share of the mean is short: a path is compared with the one without its end.
SHORT = 0.1
# The path with a nearly doubled waypoint may differ from the one without it by this share of the mean distance.
BENT = 0.02
SHOWN = 400  # points of a path that are compared


def path_through(waypoints: object, *, degree: int | None = None, ends: Ends | None = None) -> Motion:
    """Return the path q(s), 0 <= s <= 1, through waypoints without times, s the share of the length of their chords.

    Waypoints nearer to each other than a thousandth of the mean distance are taken for one; the notes of the path tell
    it. They also tell nearly doubled waypoints that bend the path, as the short way between them fixes its direction.

    Args:
        waypoints: (K, n) [rad or m], K >= 2.
        degree: odd; None: 5, and 3 (a straight line) for two waypoints.
        ends: None: natural(degree).

    Raises:
        ValueError: fewer than two waypoints, or two in succession are the same.
    """
    wanted = "at least two, with as many coordinates each"
    if not isinstance(waypoints, list | tuple | np.ndarray) or np.size(np.array(waypoints, dtype=object)) < 2:
        raise checks.refused("waypoints", waypoints, wanted)
    rows = [points(f"waypoint {k}", row) for k, row in enumerate(waypoints, 1)]
    if len({len(row) for row in rows}) != 1:
        raise checks.refused("waypoints", waypoints, wanted)
    q = np.stack(rows)
    chords = np.linalg.norm(np.diff(q, axis=0), axis=1)
    if np.any(chords == 0.0):
        k = int(np.argmin(chords))
        raise ValueError(f"waypoints {k + 1} and {k + 2} are the same")
    q, notes = _merged(q)
    path = _spline(q, degree, ends)
    return replace(path, notes=(*notes, *_bends(q, path, degree, ends)))


def _spline(q: Array, degree: int | None, ends: Ends | None) -> Motion:
    chords = np.linalg.norm(np.diff(q, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(chords)]) / np.sum(chords)
    s[-1] = 1.0
    if degree is None:
        degree = 5 if len(q) > 2 else 3
    spline = interpolate(s, q, degree, natural(degree) if ends is None else ends)
    return Motion.piecewise(spline, (), degree - 1)


def _merged(q: Array) -> tuple[Array, list[str]]:
    """Return waypoints without those that nearly double the one before; the last waypoint stays."""
    chords = np.linalg.norm(np.diff(q, axis=0), axis=1)
    usual, notes, kept = float(np.mean(chords)), [], [0]
    for k in range(1, len(q)):
        apart = float(np.linalg.norm(q[k] - q[kept[-1]]))
        if apart >= DOUBLED * usual:
            kept.append(k)
            continue
        notes.append(
            f"waypoints {kept[-1] + 1} and {k + 1} are {apart:.2g} apart, the mean is {usual:.3g}: one waypoint"
        )
        if k == len(q) - 1 and len(kept) > 1:
            kept[-1] = k
    return q[kept], notes


def _bends(q: Array, path: Motion, degree: int | None, ends: Ends | None) -> list[str]:
    """Return notes about nearly doubled waypoints without which the path would run elsewhere."""
    chords = np.linalg.norm(np.diff(q, axis=0), axis=1)
    usual, notes = float(np.mean(chords)), []
    s = np.linspace(0.0, 1.0, SHOWN)
    for k in np.flatnonzero(chords < SHORT * usual):
        out = k + 1 if k + 2 < len(q) else k
        rest = np.delete(q, out, axis=0)
        if len(rest) < 3:
            continue
        other = _spline(rest, degree, ends).q(s)
        apart = np.array([np.min(np.linalg.norm(other - point, axis=1)) for point in path.q(s)])
        if np.max(apart) > BENT * usual + chords[k]:
            notes.append(
                f"waypoints {k + 1} and {k + 2} are {chords[k]:.2g} apart and bend the path by {np.max(apart):.2g}; "
                "leave one of them out if that is not meant"
            )
    return notes
