"""Solutions of the inverse kinematics along a path of the tool, at as many times as they need to be followed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.machines.inverse_kinematics import Configurations, Inverse, continuous, wrapped
from models.machines.manipulator import Manipulator
from models.motions.timing_laws import Composed
from ocp import checks
from ocp.checks import Array

COARSE = 501  # times to begin with
PARTS = 8  # parts of a step that is too long
LONG = 0.25  # largest step of a coordinate that is followed [rad or m]
NARROW = 1e-11  # share of the duration; a solution that leaps within a shorter step jumps
ROUNDS = 40
PIECES = 200  # parts of the path that are looked at, at least


@dataclass(frozen=True, eq=False)
class Followed:
    """One solution of the inverse kinematics at times along a path."""

    t: Array  # (G,) increasing [s]
    q: Array  # (G, n) chosen, angles continued beyond half a turn
    points: Array  # (G, 3) of the tool [m]
    configurations: Configurations  # all solutions
    branches: tuple[str, ...]  # names of those that the motion runs through, in order
    jump: int | None  # index of the step in which every solution jumps


def follow(
    tool: Composed,
    inverse: Inverse,
    angular: Array,
    *,
    first: Array,
    pieces: int,
    begin: Array | None,
    limits: tuple[Array, Array],
    branch: str | None,
) -> Followed:
    """Choose the sequence of solutions that turns the least, and add times until no step is too long.

    Args:
        tool: position of the tool over time.
        inverse: inverse kinematics.
        angular: (n,) whether a coordinate is an angle.
        first: (G,) times to begin with, increasing [s].
        pieces: of the path; the times are at most as far apart as 1.5 of them.
        begin: (n,) position near which the motion should begin, or None.
        limits: lower and upper (n,) of the coordinates.
        branch: name of the only branch of solutions to be used, or None.

    Raises:
        ValueError: no branch of this name.
    """
    t = first
    points = tool(t, 0)
    configurations = inverse(points)
    allowed = _allowed(configurations, branch)
    longest = tool.law.derivative(t, 0)[:, 0]
    farthest = 1.5 * float(np.ptp(longest)) / max(PIECES, pieces)
    for _ in range(ROUNDS):
        if not np.all(configurations.reachable):
            break
        chosen = continuous(_only(configurations, allowed), angular, begin, limits)
        step = np.max(np.abs(np.diff(chosen, axis=0)), axis=1)
        way = np.abs(np.diff(tool.law.derivative(t, 0)[:, 0]))
        wide = np.diff(t) > NARROW * (t[-1] - t[0])
        bad = np.flatnonzero(((step > LONG) | (way > farthest)) & wide)
        if not len(bad):
            leaps = np.flatnonzero(step > LONG)
            names = _names(configurations, chosen, angular)
            return Followed(t, chosen, points, configurations, names, int(leaps[0]) if len(leaps) else None)
        inside = t[bad, None] + np.diff(t)[bad, None] * np.arange(1, PARTS)[None] / PARTS
        added = np.setdiff1d(inside.ravel(), t)
        if not len(added):
            break
        more = tool(added, 0)
        order = np.argsort(np.concatenate([t, added]), kind="stable")
        t, points = np.concatenate([t, added])[order], np.vstack([points, more])[order]
        configurations = _merged(configurations, inverse(more), order)
    chosen = np.full((len(t), len(angular)), np.nan)
    if np.all(configurations.reachable):
        chosen = continuous(_only(configurations, allowed), angular, begin, limits)
    step = np.max(np.abs(np.diff(chosen, axis=0)), axis=1)
    return Followed(t, chosen, points, configurations, (), int(np.argmax(step)) if np.any(step > LONG) else None)


def _allowed(configurations: Configurations, branch: str | None) -> Array:
    """Return the indices of the branches that may be used."""
    names = configurations.branches
    if branch is None:
        return np.arange(len(names))
    if branch not in names:
        raise ValueError(f"branch: got {checks.shown(branch)}, expected one of {', '.join(map(repr, names))}")
    return np.array([names.index(branch)])


def _only(configurations: Configurations, allowed: Array) -> Configurations:
    names = tuple(configurations.branches[k] for k in allowed)
    return Configurations(configurations.q[:, allowed], names, configurations.unreachable, configurations.singular)


def _merged(one: Configurations, other: Configurations, order: Array) -> Configurations:
    """Return the solutions of two sets of points, brought into one order."""

    def merged(name: str) -> dict[str, Array]:
        first, second = getattr(one, name), getattr(other, name)
        return {key: np.concatenate([first[key], second[key]])[order] for key in first}

    return Configurations(
        np.concatenate([one.q, other.q])[order], one.branches, merged("unreachable"), merged("singular")
    )


def _names(configurations: Configurations, chosen: Array, angular: Array) -> tuple[str, ...]:
    """Return the names of the branches that a sequence of solutions runs through."""
    step = configurations.q - chosen[:, None]
    step = np.nan_to_num(np.where(angular, wrapped(step), step), nan=0.0)
    nearest = np.argmin(np.linalg.norm(step, axis=2), axis=1)
    changes = np.concatenate([[True], np.diff(nearest) != 0])
    return tuple(configurations.branches[k] for k in nearest[changes])


@dataclass(frozen=True, eq=False)
class Choice:
    """Which of the solutions of the inverse kinematics is wanted."""

    begin: Array | None  # (n,) position near which the motion should begin
    limits: tuple[Array, Array]
    branch: str | None

    @classmethod
    def of(cls, machine: Manipulator, near: object, limits: object, branch: str | None) -> Choice:
        """Check the arguments of `along_tool_path`."""
        n = len(machine.coordinates)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        if limits is not None:
            if not isinstance(limits, tuple | list) or len(limits) != 2:
                raise checks.refused("limits", limits, f"lower and upper ({n},) of the coordinates")
            low, high = (checks.column("limits", side, n, finite=False) for side in limits)
        named = f"{n} finite numbers, one for each coordinate of {machine.name}"
        begin = None if near is None else checks.column("near", near, n, named)
        if branch is not None:
            checks.text("branch", branch, "the name of a branch of solutions")
        return cls(begin, (low, high), branch)
