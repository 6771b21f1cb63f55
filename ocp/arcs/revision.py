"""Revision of a switching structure where a condition of optimality is violated."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.arcs.arc_problems import ArcMotion
from ocp.arcs.optimality_check import Certificate, Crossing, WrongSign
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solution.structure_table import merged

VANISHED = 1e-7  # duration of an arc, share of the motion, below which it is dropped
ISLAND = 1e-4  # the same for an arc on which alone a control lies between its bounds
SATURATED = 1e-5  # distance from a bound, share of the range, that counts as being at it
SIGNS = 3  # intervals with a wrong sign, the worst first, that are tried
WHOLE = 0.9  # share of a stretch with the wrong sign above which the whole stretch changes its kind


def without_vanished(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs without those of no duration; touch points at their starts move to the next arc."""
    total = sum(arc.duration for arc in arcs)
    kept: list[Arc] = []
    pending: tuple[Contact, ...] = ()
    for k, arc in enumerate(arcs):
        touched = tuple(dict.fromkeys((*pending, *arc.touched)))
        least = ISLAND if _island(arcs, k) else VANISHED
        if arc.duration <= least * total:
            # A limit held for no time is touched, if the arc before did not hold it.
            held = {(c.limit, c.side) for c in kept[-1].held} if kept else set()
            fresh = tuple(Contact(c.limit, c.side) for c in arc.held if (c.limit, c.side) not in held)
            pending = tuple(dict.fromkeys((*touched, *fresh)))
            continue
        now = {(c.limit, c.side) for c in arc.held}
        kept.append(replace(arc, touched=tuple(c for c in touched if (c.limit, c.side) not in now)))
        pending = ()
    return merged(tuple(kept)) if kept else arcs


def _island(arcs: tuple[Arc, ...], k: int) -> bool:
    """Return whether a control is on an interior arc here, but neither before nor after."""
    others = [arcs[j].kinds for j in (k - 1, k + 1) if 0 <= j < len(arcs)]
    alone = [kind is Kind.INTERIOR and all(o[i] is not kind for o in others) for i, kind in enumerate(arcs[k].kinds)]
    return len(others) == 2 and any(alone)


def swapped(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs with two switches exchanged where the arc between them has shrunk to zero length.

    The two switches must belong to different controls.
    """
    total = sum(arc.duration for arc in arcs)
    changed = list(arcs)
    for k in range(1, len(arcs) - 1):
        before, arc, after = changed[k - 1], changed[k], changed[k + 1]
        first = {i for i, kind in enumerate(arc.kinds) if kind is not before.kinds[i]}
        second = {i for i, kind in enumerate(arc.kinds) if kind is not after.kinds[i]}
        if arc.duration > VANISHED * total or not first or not second or first & second:
            continue
        if arc.touched or after.touched:
            continue
        kinds = tuple(after.kinds[i] if i in second else kind for i, kind in enumerate(before.kinds))
        holding = {i for i, kind in enumerate(kinds) if kind is Kind.HOLDING}
        held = tuple(c for c in dict.fromkeys((*before.held, *after.held)) if c.control in holding)
        changed[k] = Arc(kinds, arc.duration, held)
    return tuple(changed)


def without_false_contacts(
    arcs: tuple[Arc, ...], certificate: Certificate, limits: tuple[StateLimit, ...]
) -> tuple[Arc, ...]:
    """Return the arcs without contacts whose multiplier or jump has the wrong sign."""
    changed = list(arcs)
    for jump in certificate.jumps:
        if jump.arc < len(changed):
            arc = changed[jump.arc]
            changed[jump.arc] = replace(arc, touched=tuple(c for c in arc.touched if c != jump.contact))
    for k, contact in certificate.released:
        arc = changed[k]
        kinds = tuple(Kind.INTERIOR if i == contact.control else kind for i, kind in enumerate(arc.kinds))
        # A limit that depends on controls themselves is not touched: a control merely leaves it.
        touch = (Contact(contact.limit, contact.side),) if limits[contact.limit].order else ()
        held = tuple(c for c in arc.held if c != contact)
        changed[k] = replace(arc, kinds=kinds, held=held, touched=(*arc.touched, *touch))
    return merged(tuple(changed))


def without_shortest_hold(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs without the shortest arc on a state limit; its control stays as on the arc before."""
    held = [k for k, arc in enumerate(arcs) if arc.held and k > 0]
    if not held:
        return arcs
    k = min(held, key=lambda k: arcs[k].duration)
    free = {contact.control for contact in arcs[k].held}
    before = arcs[k - 1].kinds
    kinds = tuple(before[i] if i in free else kind for i, kind in enumerate(arcs[k].kinds))
    if Kind.HOLDING in kinds:
        return arcs
    return merged((*arcs[:k], replace(arcs[k], kinds=kinds, held=()), *arcs[k + 1 :]))


def with_contact(arcs: tuple[Arc, ...], crossing: Crossing, limits: tuple[StateLimit, ...]) -> tuple[Arc, ...]:
    """Return the arcs with a touch point added where a state limit is exceeded most."""
    if limits[crossing.contact.limit].order == 0:
        return arcs
    cut, k = cut_at(arcs, crossing.worst)
    arc = cut[k]
    if k == 0 or crossing.contact in arc.touched or any(c.limit == crossing.contact.limit for c in arc.held):
        return arcs
    return (*cut[:k], replace(arc, touched=(*arc.touched, crossing.contact)), *cut[k + 1 :])


def with_hold(
    problem: Problem, arcs: tuple[Arc, ...], crossing: Crossing, limits: tuple[StateLimit, ...]
) -> tuple[Arc, ...]:
    """Return the arcs with a limit of first order active along the arc after the time at which it is met.

    One that depends on controls themselves is active for the time in which it presses.

    Args:
        problem: one phase.
        arcs: the present structure.
        crossing: where the limit presses on the motion.
        limits: state limits of the problem.
    """
    limit = limits[crossing.contact.limit]
    if limit.order == 0:
        return _with_mixed_hold(problem, arcs, crossing, limit)
    if limit.order != 1:
        return arcs
    cut, k = cut_at(arcs, crossing.worst)
    if k == 0 or k >= len(cut):
        return arcs
    depends = ca.which_depends(limit.chain[-1], problem.system.u, 1, False)
    arc = cut[k]
    free = [i for i, own in enumerate(depends) if own and arc.kinds[i] is not Kind.HOLDING]
    if not free or any(c.limit == crossing.contact.limit for c in arc.held):
        return arcs
    # The control that has just switched has driven the motion to its limit.
    i = next((i for i in free if cut[k - 1].kinds[i] is not arc.kinds[i]), free[0])
    contact = Contact(crossing.contact.limit, crossing.contact.side, i)
    touched = tuple(c for c in arc.touched if c.limit != contact.limit)
    kinds = tuple(Kind.HOLDING if j == i else kind for j, kind in enumerate(arc.kinds))
    held = replace(arc, kinds=kinds, held=(*arc.held, contact), touched=touched)
    return merged((*cut[:k], held, *cut[k + 1 :]))


def _with_mixed_hold(problem: Problem, arcs: tuple[Arc, ...], crossing: Crossing, limit: StateLimit) -> tuple[Arc, ...]:
    """Return the arcs with a limit on controls and states active while it presses, held by a control that is free."""
    depends = ca.which_depends(limit.chain[0], problem.system.u, 1, False)
    cut, first = cut_at(arcs, crossing.start)
    cut, last = cut_at(cut, crossing.end)
    results = list(cut)
    for k in range(first, max(last, first + 1)):
        arc = cut[k]
        free = [i for i, own in enumerate(depends) if own and arc.kinds[i] is Kind.INTERIOR]
        if free and not any(c.limit == crossing.contact.limit for c in arc.held):
            held = (*arc.held, Contact(crossing.contact.limit, crossing.contact.side, free[0]))
            kinds = tuple(Kind.HOLDING if i == free[0] else kind for i, kind in enumerate(arc.kinds))
            results[k] = replace(arc, kinds=kinds, held=tuple(sorted(held, key=lambda c: (c.limit, c.side))))
    return merged(tuple(results))


def with_sign(arcs: tuple[Arc, ...], wrong: WrongSign, part: bool = False) -> tuple[Arc, ...]:
    """Return the arcs with a control at the bound that its switching function asks for, in part of the interval.

    Args:
        arcs: the present structure.
        wrong: the interval.
        part: keep a part of the stretch even if almost all of it has the wrong sign.
    """
    start, end = wrong.start, wrong.end
    starts = starts_of(arcs)
    own = [k for k, arc in enumerate(arcs) if starts[k] < (start + end) / 2.0 <= starts[k] + arc.duration]
    if not own:
        return arcs
    k = own[0]
    first = last = k
    while first > 0 and arcs[first - 1].kinds[wrong.control] is arcs[k].kinds[wrong.control]:
        first -= 1
    while last + 1 < len(arcs) and arcs[last + 1].kinds[wrong.control] is arcs[k].kinds[wrong.control]:
        last += 1
    stretch = starts[last] + arcs[last].duration - starts[first]
    if part or end - start < WHOLE * stretch:
        quarter = (end - start) / 4.0
        # Where the interval begins or ends with the stretch, the switch there comes too early or too late.
        a = start if start - starts[first] < 1e-6 * stretch else start + quarter
        b = end if starts[last] + arcs[last].duration - end < 1e-6 * stretch else end - quarter
        arcs, _ = cut_at(arcs, a)
        arcs, _ = cut_at(arcs, b)
        starts = starts_of(arcs)
        chosen = [j for j, arc in enumerate(arcs) if a - 1e-12 <= starts[j] + arc.duration / 2.0 <= b + 1e-12]
    else:
        chosen = list(range(first, last + 1))
    return merged(tuple(wrong.cured(arc) if j in chosen else arc for j, arc in enumerate(arcs)))


def revisions(motion: ArcMotion, certificate: Certificate, limits: tuple[StateLimit, ...]) -> list[tuple[Arc, ...]]:
    """Return structures to try next, the most promising first; empty if nothing is wrong.

    Args:
        motion: the solution for the present structure.
        certificate: its violated conditions.
        limits: state limits of the problem.
    """
    arcs = without_vanished(motion.arcs)
    if len(arcs) < len(motion.arcs):
        return [arcs]
    results: list[tuple[Arc, ...]] = []
    if certificate.jumps or certificate.released:
        results.append(without_false_contacts(arcs, certificate, limits))
    results += [with_contact(arcs, crossing, limits) for crossing in certificate.crossings]
    for wrong in certificate.signs[:SIGNS]:
        results += [with_sign(arcs, wrong), with_sign(arcs, wrong, part=True)]
    return [other for other in results if other != arcs]


def revise(motion: ArcMotion, certificate: Certificate, limits: tuple[StateLimit, ...]) -> tuple[Arc, ...]:
    """Return the structure to try next; the same arcs if no revision applies.

    Args:
        motion: the solution for the present structure.
        certificate: its violated conditions.
        limits: state limits of the problem.
    """
    return next(iter(revisions(motion, certificate, limits)), without_vanished(motion.arcs))


def starts_of(arcs: tuple[Arc, ...]) -> list[float]:
    """Return the times at which arcs begin, and the end of the last one [s]."""
    starts = [0.0]
    for arc in arcs:
        starts.append(starts[-1] + arc.duration)
    return starts


def cut_at(arcs: tuple[Arc, ...], t: float) -> tuple[tuple[Arc, ...], int]:
    """Return the arcs, cut so that one of them begins at t, and its index."""
    begin = 0.0
    total = sum(arc.duration for arc in arcs)
    for k, arc in enumerate(arcs):
        if abs(t - begin) <= 1e-9 * total:
            return arcs, k
        if begin < t < begin + arc.duration - 1e-9 * total:
            before = replace(arc, duration=t - begin)
            after = replace(arc, duration=begin + arc.duration - t, touched=())
            return (*arcs[:k], before, after, *arcs[k + 1 :]), k + 1
        begin += arc.duration
    return arcs, len(arcs) - 1


def with_saturated(problem: Problem, motion: ArcMotion, arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs with those parts of interior arcs cut off in which a control stays at a bound.

    Args:
        problem: one phase.
        motion: the solution for the present structure.
        arcs: of the motion, without those of no duration.
    """
    low, high = problem.limits(Where.ALONG, problem.system.u)
    ends, widths = motion.grid.ends * motion.duration, np.diff(motion.grid.ends) * motion.duration
    starts = np.cumsum([0.0, *(arc.duration for arc in arcs)])
    owner = np.clip(np.searchsorted(starts, (ends[:-1] + ends[1:]) / 2.0, side="right") - 1, 0, len(arcs) - 1)
    cuts: list[tuple[float, float, int, Kind]] = []
    for k, arc in enumerate(arcs):
        own = np.flatnonzero((owner == k) & (widths > VANISHED * motion.duration))
        for i, kind in enumerate(arc.kinds):
            if kind is not Kind.INTERIOR or not np.isfinite(high[i] - low[i]):
                continue
            level = (motion.controls[own, :, i] - low[i]) / (high[i] - low[i])
            for at, side in ((level < SATURATED, Kind.LOWER), (level > 1.0 - SATURATED, Kind.UPPER)):
                whole = np.all(at, axis=1).astype(int)
                edges = np.flatnonzero(np.diff(np.concatenate([[0], whole, [0]])))
                for a, b in zip(edges[::2], edges[1::2], strict=True):
                    cuts.append((float(ends[own[a]]), float(ends[own[b - 1] + 1]), i, side))
    for a, b, i, side in cuts:
        arcs, _ = cut_at(arcs, a)
        arcs, _ = cut_at(arcs, b)
        starts = np.array(starts_of(arcs))
        middle = (starts[:-1] + starts[1:]) / 2.0
        arcs = tuple(
            replace(arc, kinds=tuple(side if j == i else kind for j, kind in enumerate(arc.kinds)))
            if a < middle[k] < b and arc.kinds[i] is Kind.INTERIOR
            else arc
            for k, arc in enumerate(arcs)
        )
    return merged(arcs)
