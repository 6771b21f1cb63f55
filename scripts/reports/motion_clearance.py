"""Least distances of the links along a solved motion from what they keep clear of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.rigid_bodies.clearances import Distance
from models.scenes.link_clearance import LinkClearance
from models.scenes.task import Task
from ocp import SequenceSolution, Solution

TIMES = 4001  # at which a motion is measured
Clearances = Sequence[tuple[Distance, float, float]]  # each with its time [s], and the distance that is kept [m]
ROUNDING = 1e-6  # below a wanted distance that is the tolerance of the solver [m]


def clearances(solution: Solution | SequenceSolution, task: Task) -> Clearances:
    """Return the least distances, the nearest first, each with its time [s] and the one that is kept [m].

    Args:
        solution: of the task.
        task: with what its links keep clear of; the list is empty without.
    """
    if task.clearance is None:
        return []
    t = np.linspace(0.0, solution.duration, TIMES if solution.duration > 0.0 else 1)
    return measured(task.clearance, t, np.atleast_2d(solution.signal("q", t)))


def measured(clearance: LinkClearance, t: np.ndarray, q: np.ndarray) -> Clearances:
    """Return the least distances along any motion, the nearest first.

    Args:
        clearance: what the links keep clear of.
        t: (K,) times [s].
        q: (K, n) positions there [rad or m].
    """
    return [(one, float(t[one.row]), clearance.wanted(one)) for one in clearance.nearest(q)]


def unkept(task: Task) -> tuple[str, ...]:
    """Return notes about links that nothing is kept away from."""
    return () if task.clearance is None else task.clearance.notes


def kept(found: Clearances) -> bool:
    """Return whether all distances are kept along the whole motion."""
    return all(one.least >= wanted - ROUNDING for one, _, wanted in found)


def lines_of(found: Clearances) -> list[str]:
    """Return the least distances as sentences: "0.0213 m: elbow from post at 0.42 s; 0.02 m are kept"."""
    return [
        f"{one.least:.4f} m between {one.body} and {one.other} at {t:.4g} s; "
        + (f"{wanted:g} m are kept" if one.least >= wanted - ROUNDING else f"NOT the {wanted:g} m that are asked for")
        for one, t, wanted in found
    ]


def plain(found: Clearances) -> list[dict[str, object]]:
    """Return the least distances as plain data."""
    return [{**vars(one), "time": t, "kept": wanted} for one, t, wanted in found]
