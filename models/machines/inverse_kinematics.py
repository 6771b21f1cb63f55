"""Inverse kinematics in closed form: all positions of a machine with its tool at given points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array

TINY = 1e-12  # distances below this multiple of the dimensions of the machine are rounding errors
NEAR = 1e-6  # a point closer than this multiple of the dimensions to a singularity counts as singular


@dataclass(frozen=True, eq=False)
class Configurations:
    """All solutions of tool(q) = point for K points.

    A coordinate that may have any value is NaN. A point that cannot be reached has the configurations nearest to it.
    """

    q: Array  # (K, m, n) [rad or m], angles in (-pi, pi]
    branches: tuple[str, ...]  # (m,) names of the solutions, such as "ahead, q3 >= 0"
    unreachable: Mapping[str, Array]  # reason -> (K,) whether it applies
    singular: Mapping[str, Array]  # name of the singularity -> (K,) whether the point is at it

    @property
    def reachable(self) -> Array:
        """(K,) whether there is a solution."""
        reached = np.ones(len(self.q), dtype=bool)
        for fault in self.unreachable.values():
            reached &= ~fault
        return reached

    def why(self, k: int) -> str:
        """Return why point k cannot be reached; empty if it can."""
        return "; ".join(reason for reason, fault in self.unreachable.items() if fault[k])

    def singularities(self, k: int) -> tuple[str, ...]:
        """Return the names of the singularities at point k."""
        return tuple(name for name, at in self.singular.items() if at[k])


Inverse = Callable[[Array], Configurations]  # points (K, 3) [m]


def wrapped(angle: Array) -> Array:
    """Return angles in (-pi, pi]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2.0 * np.pi))


def continuous(
    configurations: Configurations, angular: Array, near: Array | None, limits: tuple[Array, Array]
) -> Array:
    """Return one solution for each point such that the path through joint space is as short as possible.

    This is the shortest path through the graph of all solutions (dynamic programming). Angles are continued beyond
    pi; a coordinate that may have any value keeps the last value, at the beginning of the path the next one.

    Args:
        configurations: of the points of a path, in order.
        angular: (n,) whether a coordinate is an angle.
        near: (n,) where the path should begin; None: where it is shortest.
        limits: lower and upper (n,) of the coordinates; a solution outside is left out.

    Returns:
        (K, n); a row of NaN where no solution is within the limits.

    Source: G. D. Forney, The Viterbi algorithm, Proc. IEEE 61 (1973).
    """
    q = _within(configurations.q, angular, limits)
    count, branches, n = q.shape
    start = np.zeros(n) if near is None else near
    cost = np.where(_lost(q[0], configurations.q[0]), np.inf, 0.0)
    if near is not None:
        cost = cost + np.linalg.norm(_step(q[0], start[None], angular), axis=-1)[:, 0] ** 2
    predecessor = np.zeros((count, branches), dtype=int)
    for k in range(1, count):
        move = np.linalg.norm(_step(q[k], q[k - 1], angular), axis=-1)  # (m now, m before)
        total = np.where(np.isinf(cost)[None], np.inf, move**2 + cost[None])
        predecessor[k] = np.argmin(total, axis=1)
        cost = np.where(_lost(q[k], configurations.q[k]), np.inf, total[np.arange(branches), predecessor[k]])
        if not np.any(np.isfinite(cost)):
            return np.full((count, n), np.nan)
    best = int(np.argmin(cost))
    chosen = np.empty((count, n))
    for k in range(count - 1, -1, -1):
        chosen[k] = q[k, best]
        best = predecessor[k, best]
    return continued(chosen, angular, near)


def continued(q: Array, angular: Array, near: Array | None) -> Array:
    """Return a path (K, n) with free values filled in and angles continued beyond pi."""
    filled = q.copy()
    for i in range(q.shape[1]):
        known = np.flatnonzero(~np.isnan(q[:, i]))
        if not len(known):
            filled[:, i] = 0.0 if near is None else near[i]
            continue
        before = np.maximum(np.searchsorted(known, np.arange(len(q)), side="right") - 1, 0)
        filled[:, i] = q[known[before], i]
        if angular[i]:
            turns = np.unwrap(filled[:, i])
            shift = 0.0 if near is None else 2.0 * np.pi * np.round((near[i] - turns[0]) / (2.0 * np.pi))
            filled[:, i] = turns + shift
    return filled


def whole_turns(
    least: Array, most: Array, angular: Array, limits: tuple[Array, Array], slack: float | Array = 1e-9
) -> Array | None:
    """Return the fewest full turns (n,) [rad] that bring ranges of coordinates within limits; None if none do.

    Args:
        least, most: (n,) ends of the ranges [rad or m].
        angular: (n,) whether a coordinate is an angle; the others stay.
        limits: lower and upper (n,).
        slack: by which limits may be exceeded, a number or (n,).
    """
    low = np.ceil((limits[0] - slack - least) / (2.0 * np.pi))
    high = np.floor((limits[1] + slack - most) / (2.0 * np.pi))
    turns = np.where(angular, 2.0 * np.pi * np.clip(0.0, low, np.maximum(low, high)), 0.0)
    inside = (least + turns >= limits[0] - slack) & (most + turns <= limits[1] + slack)
    return np.asarray(turns) if np.all(inside) else None


def _step(now: Array, before: Array, angular: Array) -> Array:
    """Return the smallest differences (m, m', n); 0 for a free coordinate."""
    step = now[:, None] - before[None]
    return np.asarray(np.nan_to_num(np.where(angular, wrapped(step), step), nan=0.0))


def _within(q: Array, angular: Array, limits: tuple[Array, Array]) -> Array:
    """Return the solutions with full turns added to get inside the limits, and NaN for those that stay outside."""
    low, high = limits
    turned = q + np.where(angular & (q < low - TINY), 2.0 * np.pi, 0.0)
    turned = turned - np.where(angular & (turned > high + TINY), 2.0 * np.pi, 0.0)
    outside = np.any((turned < low - 1e-9) | (turned > high + 1e-9), axis=2)
    return np.where(outside[..., None], np.nan, turned)


def _lost(q: Array, given: Array) -> Array:
    """Return which solutions (m,) were left out because of the limits."""
    return np.asarray(np.all(np.isnan(q), axis=1) & ~np.all(np.isnan(given), axis=1))
