"""Loose arcs: controls and state limits are left free within their limits where the structure is not yet known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.limit_arcs import holder_of, level
from ocp.arcs.optimality_check import WrongSign
from ocp.arcs.revision import cut_at, starts_of
from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solution.structure_table import merged

BOUNDS = {Kind.LOWER, Kind.UPPER}
AT_BOUND = 1e-3  # distance of a control from a bound, share of its range, that counts as being at it
ON_LIMIT = 2e-4  # distance from a state limit, share of its range, that counts as being on it
ISLAND = 0.02  # duration of an arc, share of the motion, below which a control between its bounds may be a switch
BETWEEN = 0.2  # duration of a free arc between two arcs that differ in several controls, share of an element


def read_loosely(problem: Problem, solution: Solution) -> tuple[Arc, ...]:
    """Return arcs with the controls that are at a bound on whole elements; all others are free within their limits.

    Between arcs that differ in several controls there is a short one on which these are free, as their order is not
    known.

    Args:
        problem: one phase.
        solution: on a moved grid, so that switches lie between elements.
    """
    low, high = problem.limits(Where.ALONG, problem.system.u)
    n, nu = len(solution.grid), len(low)
    u = solution.controls.reshape(n, -1, nu)
    levels = np.stack([level(u[:, :, i].ravel(), low[i], high[i], AT_BOUND).reshape(n, -1) for i in range(nu)], axis=2)
    lower, upper = np.all(levels < AT_BOUND, axis=1), np.all(levels > 1.0 - AT_BOUND, axis=1)
    arcs = []
    for k, seconds in enumerate(solution.duration * solution.grid.widths):
        kinds = tuple(Kind.LOWER if lower[k, i] else Kind.UPPER if upper[k, i] else Kind.INTERIOR for i in range(nu))
        arcs.append(Arc(kinds, float(seconds)))
    return merged(_apart(merged(tuple(arcs)), BETWEEN * solution.duration / n))


def _apart(arcs: tuple[Arc, ...], short: float) -> tuple[Arc, ...]:
    """Return the arcs with a short free one in between where several controls change at once."""
    results = list(arcs[:1])
    for arc in arcs[1:]:
        before = results[-1]
        changed = [a is not b for a, b in zip(before.kinds, arc.kinds, strict=True)]
        least = min(before.duration, arc.duration)
        if sum(changed) < 2 or least < 2.0 * short:
            results.append(arc)
            continue
        kinds = tuple(Kind.INTERIOR if other else kind for other, kind in zip(changed, arc.kinds, strict=True))
        results[-1] = replace(before, duration=before.duration - short / 2.0)
        between = Arc(kinds, short)
        results += [between, replace(arc, duration=arc.duration - short / 2.0)]
    return merged(tuple(results))


def freed(arcs: tuple[Arc, ...], signs: tuple[WrongSign, ...]) -> tuple[Arc, ...]:
    """Return the arcs with controls free where they are at the wrong bound."""
    for wrong in signs:
        arcs, _ = cut_at(arcs, wrong.start)
        arcs, _ = cut_at(arcs, wrong.end)
        middles = [start + arc.duration / 2.0 for start, arc in zip(starts_of(arcs), arcs, strict=False)]
        arcs = tuple(
            replace(arc, kinds=tuple(Kind.INTERIOR if i == wrong.control else k for i, k in enumerate(arc.kinds)))
            if wrong.start < middle < wrong.end
            else arc
            for arc, middle in zip(arcs, middles, strict=True)
        )
    return merged(arcs)


def without_islands(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs with short ones, on which a control is free but at a bound before and after, as switches.

    Args:
        arcs: with their durations.
    """
    total, results = sum(arc.duration for arc in arcs), list(arcs[:1])
    for before, arc, after in zip(arcs, arcs[1:], arcs[2:], strict=False):
        halves = []
        for other in (before, after):
            kinds = [
                other.kinds[i] if kind is Kind.INTERIOR and {before.kinds[i], after.kinds[i]} <= BOUNDS else kind
                for i, kind in enumerate(arc.kinds)
            ]
            halves.append(replace(arc, kinds=tuple(kinds), duration=arc.duration / 2.0))
        results += [arc] if arc.duration > ISLAND * total else halves
    return merged((*results, *arcs[max(1, len(arcs) - 1) :]))


def with_active_limits(task: ArcProblem, motion: ArcMotion) -> tuple[Arc, ...]:
    """Return the arcs of a motion with the state limits that are active along the whole of each.

    Args:
        task: the problem.
        motion: with state limits as inequalities.
    """
    active = active_limits(task, motion)
    return tuple(
        replace(arc, held=tuple(c for c, at in active.items() if np.all(at[motion.arc == k])))
        for k, arc in enumerate(motion.arcs)
    )


def active_limits(task: ArcProblem, motion: ArcMotion) -> dict[Contact, Array]:
    """Return (N,) for each state limit and side whether it is active at all points of an element.

    Args:
        task: the problem.
        motion: with state limits as inequalities.
    """
    if not task.limits:
        return {}
    nodes, count = task.scheme.nodes > 0.0, len(motion.grid)
    x = motion.states[:, nodes].reshape(-1, motion.states.shape[2])
    u = np.einsum("sm,kma->ksa", task.scheme.control_at(task.scheme.nodes[nodes]), motion.controls).reshape(len(x), -1)
    values = np.array(mapped(task.levels, len(x))(x.T, u.T, np.tile(motion.parameters[:, None], len(x))))
    results = {}
    for number, limit in enumerate(task.limits):
        for side in (-1, 1) if limit.order else ():
            if np.isfinite(limit.at(side)):
                away = np.abs(values[number] - limit.at(side)).reshape(count, -1)
                results[Contact(number, side)] = np.all(away < ON_LIMIT * limit.range, axis=1)
    return results


def held_exactly(task: ArcProblem, motion: ArcMotion) -> tuple[Arc, ...]:
    """Return the arcs, cut where state limits become active or cease to be, with these held by free controls.

    Args:
        task: the problem.
        motion: with state limits as inequalities.
    """
    active, seconds = active_limits(task, motion), motion.grid.widths * motion.duration
    results = []
    for k, arc in enumerate(motion.arcs):
        own = np.flatnonzero(motion.arc == k)
        sets = [tuple(c for c, at in active.items() if at[j]) for j in own]
        cuts = [0, *(j for j in range(1, len(own)) if sets[j] != sets[j - 1]), len(own)]
        for a, b in pairwise(cuts):
            middle = int(own[(a + b - 1) // 2])
            point = motion.states[middle, 0], np.mean(motion.controls[middle], axis=0), motion.parameters
            kinds, held = list(arc.kinds), []
            for contact in sets[a]:
                free = np.array([kind is Kind.INTERIOR for kind in kinds])
                control = holder_of(task.problem, task.limits[contact.limit], point, free)
                if control >= 0:
                    kinds[control] = Kind.HOLDING
                    held.append(Contact(contact.limit, contact.side, control))
            results.append(Arc(tuple(kinds), float(np.sum(seconds[own[a:b]])), tuple(held)))
    return merged(tuple(results))
