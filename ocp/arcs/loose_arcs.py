"""Loose arcs: controls and state limits are left free within their limits where the structure is not yet known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.limit_arcs import ACTIVE, holder_of, level, strength_of
from ocp.arcs.revision import starts_of
from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.problem.constraints import Where
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solution.structure_table import merged

AT_BOUND = 1e-3  # distance of a control from a bound, share of its range, that counts as being at it
ON_LIMIT = 2e-4  # distance from a state limit, share of its range, that counts as being on it
EXACT = 2  # highest order of a limit that an equation holds; one of a higher order stays an inequality
BETWEEN = 0.2  # duration of a free arc between two arcs that differ in several controls, share of an element


def read_loosely(task: ArcProblem, solution: Solution) -> tuple[Arc, ...]:
    """Return arcs with the controls that are at a bound on whole elements; all others are free within their limits.

    A state limit that is active on whole elements is held by a control that is free there. An element in which a
    control switches or a limit becomes active is an arc of its own with free controls, so that the NLP of the arcs has
    a solution close to the given one.

    Args:
        task: the problem.
        solution: on a moved grid, so that switches lie between elements.
    """
    problem, scheme = task.problem, solution.scheme
    low, high = problem.limits(Where.ALONG, problem.system.u)
    n, nu = len(solution.grid), len(low)
    u = solution.controls.reshape(n, -1, nu)
    levels = np.stack([level(u[:, :, i].ravel(), low[i], high[i], AT_BOUND).reshape(n, -1) for i in range(nu)], axis=2)
    lower, upper = np.all(levels < AT_BOUND, axis=1), np.all(levels > 1.0 - AT_BOUND, axis=1)
    tau = scheme.nodes[scheme.nodes > 0.0]
    _, x, _, samples = solution.samples(tau)
    active = _active(task, (x, samples, solution.parameters), n, ACTIVE)
    arcs = []
    for k, seconds in enumerate(solution.duration * solution.grid.widths):
        kinds = tuple(Kind.LOWER if lower[k, i] else Kind.UPPER if upper[k, i] else Kind.INTERIOR for i in range(nu))
        arcs.append(Arc(kinds, float(seconds), tuple(c for c, at in active.items() if at[k])))
    loose = _apart(merged(tuple(arcs)), BETWEEN * solution.duration / n)
    results = []
    for start, arc in zip(starts_of(loose), loose, strict=False):
        t = start + arc.duration / 2.0
        point = solution.x(t), solution.u(t), solution.parameters
        results.append(_with_holders(task, arc, frozenset(arc.held), point, frozenset()))
    return merged(tuple(results))


def _apart(arcs: tuple[Arc, ...], short: float) -> tuple[Arc, ...]:
    """Return the arcs with a free one in between where several controls change at once, as their order is unknown."""
    results = list(arcs[:1])
    for arc in arcs[1:]:
        before = results[-1]
        changed = [a is not b for a, b in zip(before.kinds, arc.kinds, strict=True)]
        least = min(before.duration, arc.duration)
        if sum(changed) < 2 or least < 2.0 * short:
            results.append(arc)
            continue
        kinds = tuple(Kind.INTERIOR if other else kind for other, kind in zip(changed, arc.kinds, strict=True))
        held = tuple(c for c in arc.held if c in before.held)
        results[-1] = replace(before, duration=before.duration - short / 2.0)
        between = Arc(kinds, short, held)
        results += [between, replace(arc, duration=arc.duration - short / 2.0)]
    return merged(tuple(results))


def _active(task: ArcProblem, motion: tuple[Array, Array, Array], count: int, near: float) -> dict[Contact, Array]:
    """Return (N,) for each state limit and side whether it is active at all points of an element."""
    x, u, parameters = motion
    if not task.limits:
        return {}
    values = np.array(mapped(task.levels, len(x))(x.T, u.T, np.tile(parameters[:, None], len(x))))
    results = {}
    for number, limit in enumerate(task.limits):
        for side in (-1, 1) if limit.order else ():
            if np.isfinite(limit.at(side)):
                away = np.abs(values[number] - limit.at(side)).reshape(count, -1) / limit.range
                results[Contact(number, side)] = np.all(away < near, axis=1)
    return results


def loosened(arcs: tuple[Arc, ...], only: frozenset[tuple[int, int]] | None = None) -> tuple[Arc, ...]:
    """Return the arcs with state limits as inequalities, and the controls that held them free.

    Args:
        arcs: with their durations.
        only: (limit, side) of the state limits; None for all.
    """
    results = []
    for arc in arcs:
        chosen = {c for c in arc.held if c.control >= 0 and (only is None or (c.limit, c.side) in only)}
        free = {c.control for c in chosen}
        kinds = tuple(Kind.INTERIOR if i in free else kind for i, kind in enumerate(arc.kinds))
        held = tuple(Contact(c.limit, c.side) if c in chosen else c for c in arc.held)
        results.append(replace(arc, kinds=kinds, held=held))
    return merged(tuple(results))


def held_exactly(
    task: ArcProblem, motion: ArcMotion, arcs: tuple[Arc, ...], kept: frozenset[tuple[int, int]]
) -> tuple[Arc, ...]:
    """Return the arcs with equations for those state limits that are active on whole elements of free controls.

    Args:
        task: the problem.
        motion: the solution for the arcs, which may differ from its own by cuts and kinds.
        arcs: with state limits as inequalities.
        kept: (limit, side) of state limits that stay inequalities.
    """
    nodes = task.scheme.nodes > 0.0
    n, nx = len(motion.grid), motion.states.shape[2]
    x = motion.states[:, nodes].reshape(-1, nx)
    u = np.einsum("sm,kma->ksa", task.scheme.control_at(task.scheme.nodes[nodes]), motion.controls)
    active = _active(task, (x, u.reshape(len(x), -1), motion.parameters), n, ON_LIMIT)
    ends = motion.grid.ends * motion.duration
    middle = (ends[:-1] + ends[1:]) / 2.0
    pieces: list[Arc] = []
    for start, arc in zip(starts_of(arcs), arcs, strict=False):
        own = np.flatnonzero((middle > start) & (middle < start + arc.duration))
        if not len(own):
            pieces.append(replace(arc, held=tuple(c for c in arc.held if c.control >= 0)))
            continue
        # Pieces of the arc, one for each run of elements with the same active limits.
        sets = [frozenset(c for c, at in active.items() if at[k]) for k in own]
        cuts = [0, *(j for j in range(1, len(own)) if sets[j] != sets[j - 1]), len(own)]
        for a, b in pairwise(cuts):
            begin = start if a == 0 else ends[own[a]]
            end = start + arc.duration if b == len(own) else ends[own[b]]
            piece = replace(arc, duration=float(end - begin), touched=arc.touched if a == 0 else ())
            k = int(own[(a + b - 1) // 2])
            point = x.reshape(n, -1, nx)[k, 0], u[k, 0], motion.parameters
            pieces.append(_with_holders(task, piece, sets[a], point, kept))
    return merged(tuple(pieces))


def _with_holders(
    task: ArcProblem, arc: Arc, active: frozenset[Contact], point: tuple[Array, Array, Array],
    kept: frozenset[tuple[int, int]],
) -> Arc:  # fmt: skip
    """Return an arc on which free controls hold the active limits, each one limit."""
    known = {(c.limit, c.side) for c in arc.held if c.control >= 0}
    kinds, held = list(arc.kinds), [c for c in arc.held if c.control >= 0]
    wanted = sorted((c for c in active if (c.limit, c.side) not in known), key=lambda c: (c.limit, c.side))
    options = []
    for contact in wanted:
        free = np.array([kind is Kind.INTERIOR for kind in kinds])
        control = holder_of(task.problem, task.limits[contact.limit], point, free)
        strength = strength_of(task.problem, task.limits[contact.limit], point, control) if control >= 0 else 0.0
        options.append((strength, contact))
    for _, contact in sorted(options, key=lambda option: -option[0]):
        free = np.array([kind is Kind.INTERIOR for kind in kinds])
        control = holder_of(task.problem, task.limits[contact.limit], point, free)
        order = len(task.chain(Contact(contact.limit, contact.side, control))) - 1 if control >= 0 else 0
        if control < 0:  # nothing free is left that could hold it: a touch, or an arc to become shorter
            continue
        if order > EXACT or (contact.limit, contact.side) in kept:
            held.append(contact)
            continue
        kinds[control] = Kind.HOLDING
        held.append(Contact(contact.limit, contact.side, control))
    return replace(arc, kinds=tuple(kinds), held=tuple(sorted(held, key=lambda c: (c.limit, c.side))))
