"""Lists of arcs: keys that compare them, their durations, and the number of elements they need."""

from __future__ import annotations

import numpy as np

from ocp.checks import Array
from ocp.solution.structure import Arc

MOST = 200  # elements of a refined motion: where it needs more, its structure is wrong, and time is short
PER_MOTION = 16  # elements of the whole motion, at least one for each arc


def key_of(arcs: tuple[Arc, ...]) -> tuple[object, ...]:
    """Return a key that is equal for two lists of arcs if they differ in durations only."""
    return tuple((arc.kinds, frozenset(arc.held), frozenset(arc.touched)) for arc in arcs)


def durations(arcs: tuple[Arc, ...]) -> np.ndarray:
    """Return the durations of arcs [s]."""
    return np.array([arc.duration for arc in arcs])


def elements_of(arcs: tuple[Arc, ...], level: int = 0) -> tuple[int, ...]:
    """Return the number of elements of every arc, in proportion to its duration.

    Args:
        arcs: with their durations.
        level: every level doubles the numbers.
    """
    shares = durations(arcs) / durations(arcs).sum()
    return tuple((np.maximum(np.ceil(PER_MOTION * shares), 1.0).astype(int) * 2**level).tolist())


def refined(arcs: tuple[Arc, ...], density: tuple[Array, Array]) -> tuple[int, ...]:
    """Return the number of elements of every arc: as `elements_of`, or more where the density asks for it.

    At most `MOST` in all.

    Args:
        arcs: with their durations.
        density: ends (N + 1,) of the elements of a motion as shares, and wanted elements per duration of the motion
            (N,) on each of them.
    """
    ends, wanted = density
    shares = np.append(0.0, np.cumsum(durations(arcs))) / durations(arcs).sum()
    total = np.append(0.0, np.cumsum(np.diff(ends) * wanted))
    needed = np.diff(np.interp(shares, ends, total))
    needed = np.ceil(needed * min(1.0, MOST / max(float(np.sum(needed)), 1.0)) - 0.05)
    return tuple(np.maximum(needed, elements_of(arcs)).astype(int).tolist())
