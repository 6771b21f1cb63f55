"""Detection of the switching structure of a motion from its controls, switching functions and state limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp.arcs.limit_arcs import Cells, LimitArc, contacts, in_succession, level, with_brakes
from ocp.arcs.switching import switching_functions
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solution.structure_table import merged
from ocp.transcription.schemes.scheme import Control

EDGE = 0.02  # distance of a control from a bound, share of its range, that counts as being at the bound
SHARP = 1e-3  # the same where switches lie between elements
CHATTER = 2  # most cells between two bounds that are one switch or a short excursion, not an interior arc
SINGULAR = 0.02  # switching function, share of the Hamiltonian, below which a control between bounds is interior
EXCURSION = 0.05  # of a cell; shorter excursions are no arcs
BRAKE = 5e-4  # duration of a braking arc that is too short to be seen, share of the motion
APART = 0.05  # duration, share of the motion, of a gap between two holds of one control that is no arc
ALIGNED = 1.2  # elements within which an interior arc begins or ends together with an arc on a state limit

SHAPED = Control.COLLOCATED, Control.SEGMENTS  # shapes that differ from point to point of an element and jump between

Stretch = tuple[float, Kind]  # start of a stretch of one control [s], and its kind
Touch = tuple[float, Contact]


def read(problem: Problem, solution: Solution, limits: tuple[StateLimit, ...], sharp: bool = False) -> tuple[Arc, ...]:
    """Return the switching structure of a solution as arcs.

    Args:
        problem: one phase.
        solution: of the problem, on any grid.
        limits: state limits of the problem.
        sharp: whether switches lie between elements and undetermined controls are smooth, as on a moved grid with a
            small cost on effort; then a control between its bounds is on an interior arc.
    """
    edges, u, share = cells(problem, solution)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    edge = SHARP if sharp else EDGE
    levels = np.stack([level(u[:, i], low[i], high[i], edge) for i in range(u.shape[1])], axis=1)
    divided = Cells(edges, levels, edge, sharp)
    holds, touches = contacts(problem, solution, limits, divided)
    # A control cannot be at a bound that it does not have, whatever the sign of its switching function.
    share = np.where(np.isfinite(np.where(share > 0.0, low, high)), share, 0.0)
    share = 0.0 * share if sharp else share
    holds = in_succession(divided, holds) if sharp else holds
    stretches = [
        _stretches(divided, i, share[:, i], [hold for hold in holds if hold.contact.control == i])
        for i in range(u.shape[1])
    ]
    if sharp:
        near = ALIGNED * solution.duration / len(solution.grid)
        stretches = _aligned(stretches, [t for hold in holds for t in (hold.start, hold.end)], near)
        touches = [touch for touch in touches if not _part_of_arc(touch, holds, near)]
    arcs = _arcs(stretches, holds, touches, solution.duration)
    return with_brakes(problem, solution, limits, arcs, BRAKE * solution.duration) if sharp else arcs


def _arcs(
    stretches: list[list[Stretch]], holds: list[LimitArc], touches: list[Touch], duration: float
) -> tuple[Arc, ...]:
    """Return the arcs between all times at which something begins or ends."""
    times = {0.0}
    times |= {t for own in stretches for t, _ in own} | {t for t, _ in touches}
    times |= {t for hold in holds for t in (hold.start, hold.end)}
    inner = sorted(t for t in times if t < duration)
    arcs = []
    for a, b in zip(inner, [*inner[1:], duration], strict=True):
        middle = (a + b) / 2.0
        kinds = tuple([kind for t, kind in own if t <= middle][-1] for own in stretches)
        held = tuple(hold.contact for hold in holds if hold.start < middle < hold.end)
        arcs.append(Arc(kinds, b - a, held, tuple(contact for t, contact in touches if t == a)))
    return merged(_without_gaps(tuple(arcs), APART * duration))


def _without_gaps(arcs: tuple[Arc, ...], short: float) -> tuple[Arc, ...]:
    """Return the arcs without short ones on which a control holds a limit before and after, but none there."""
    results: list[Arc] = []
    for k, arc in enumerate(arcs):
        empty = any(kind is Kind.HOLDING and all(c.control != i for c in arc.held) for i, kind in enumerate(arc.kinds))
        if empty and arc.duration <= short and results and k + 1 < len(arcs):
            results[-1] = replace(results[-1], duration=results[-1].duration + arc.duration)
        else:
            results.append(arc)
    return tuple(results)


def _part_of_arc(touch: Touch, holds: list[LimitArc], near: float) -> bool:
    """Return whether a touch point is the beginning or the end of an arc on the same limit."""
    t, contact = touch
    same = [hold for hold in holds if (hold.contact.limit, hold.contact.side) == (contact.limit, contact.side)]
    return any(hold.start - near <= t <= hold.end + near for hold in same)


def _aligned(stretches: list[list[Stretch]], times: list[float], near: float) -> list[list[Stretch]]:
    """Return stretches with ends of interior arcs moved to nearby times; interior arcs that are too short are dropped.

    Args:
        stretches: of every control.
        times: at which state limits begin or cease to be active [s].
        near: largest distance [s].
    """
    results = []
    for own in stretches:
        ends = [t for t, _ in own[1:]] + [np.inf]
        around = [None, *(kind for _, kind in own), None]
        # A short way from a bound and back is an arc whose kind is not known yet.
        back = [
            before is after and before is not Kind.HOLDING for before, after in zip(around, around[2:], strict=False)
        ]
        kept = [
            one
            for one, end, excursion in zip(own, ends, back, strict=True)
            if one[1] is not Kind.INTERIOR or end - one[0] > near or len(own) == 1 or excursion
        ]
        moved: list[Stretch] = []
        for k, (t, kind) in enumerate(kept):
            soft = k > 0 and Kind.INTERIOR in (kind, kept[k - 1][1]) and Kind.HOLDING not in (kind, kept[k - 1][1])
            closest = min(times, key=lambda time: abs(time - t), default=np.inf)
            t = closest if soft and abs(closest - t) <= near else t
            if k and t <= moved[-1][0]:
                moved[-1] = (moved[-1][0], kind)
            elif not moved or kind is not moved[-1][1]:
                moved.append((t if k else 0.0, kind))
        results.append(moved)
    return results


def cells(problem: Problem, solution: Solution) -> tuple[Array, Array, Array]:
    """Return the ends (C + 1,) of cells in time, the control (C, nu) and the switching functions (C, nu) in each."""
    scheme, grid = solution.scheme, solution.grid
    marks = np.append(0.0, np.cumsum(scheme.weights)) if scheme.control in SHAPED else np.array([0.0, 1.0])
    marks[-1] = 1.0
    middle = scheme.points if scheme.control in SHAPED else np.array([0.5])
    edges = (grid.ends[:-1, None] + grid.widths[:, None] * marks[:-1]).ravel()
    _, x, _, u = solution.samples(middle)
    costates = np.einsum("sd,kda->ksa", scheme.costate_at(middle), solution.costates).reshape(len(x), -1)
    result = switching_functions(problem, x, u, costates, solution.parameters)
    return np.append(edges, 1.0) * solution.duration, u, result.shares


def _stretches(cells: Cells, control: int, share: Array, holds: list[LimitArc]) -> list[Stretch]:
    """Return the stretches of one control from its positions in all cells."""
    edges, level, edge = cells.edges, cells.level[:, control], cells.edge
    middle, widths = (edges[:-1] + edges[1:]) / 2.0, np.diff(edges)
    kinds: list[Kind | None] = [Kind.LOWER if a < edge else Kind.UPPER if a > 1.0 - edge else None for a in level]
    for hold in holds:
        for covered in np.flatnonzero((middle > hold.start) & (middle < hold.end)).tolist():
            kinds[covered] = Kind.HOLDING
    starts = list(edges[:-1])
    c = 0
    while c < len(kinds):
        if kinds[c] is not None:
            c += 1
            continue
        stop = c
        while stop < len(kinds) and kinds[stop] is None:
            stop += 1
        before, after = kinds[c - 1] if c else None, kinds[stop] if stop < len(kinds) else None
        short = stop - c <= CHATTER
        if short and (before is None or after is None):
            beside = after or before or Kind.INTERIOR
            kinds[c:stop] = [Kind.INTERIOR if beside is Kind.HOLDING else beside] * (stop - c)
        elif short and Kind.HOLDING in (before, after):
            kinds[c:stop] = [after if before is Kind.HOLDING else before] * (stop - c)
        elif short and cells.sharp and before is after:
            kinds[c:stop] = [Kind.INTERIOR] * (stop - c)
        elif short:
            _settle(kinds, starts, level, widths, (c, stop))
        elif np.mean(np.abs(share[c:stop])) < SINGULAR:
            kinds[c:stop] = [Kind.INTERIOR] * (stop - c)
        else:
            kinds[c:stop] = [Kind.LOWER if s > 0.0 else Kind.UPPER for s in share[c:stop]]
        c = stop
    stretches: list[Stretch] = []
    for at, kind in zip(starts, kinds, strict=True):
        if kind is not None and (not stretches or stretches[-1][1] is not kind):
            stretches.append((float(at), kind))
    return [(0.0 if n == 0 else t, kind) for n, (t, kind) in enumerate(_within(stretches, holds))]


def _within(stretches: list[Stretch], holds: list[LimitArc]) -> list[Stretch]:
    """Return the stretches with those of kind HOLDING cut to the instants at which their state limits are active."""
    for hold in holds:
        after = [kind for t, kind in stretches if t <= hold.end or kind is not Kind.HOLDING] or [Kind.HOLDING]
        following = next((kind for t, kind in stretches if t > (hold.start + hold.end) / 2.0), after[-1])
        outside = [(t, k) for t, k in stretches if t < hold.start or t > hold.end]
        outside = [(t, k) for t, k in outside if k is not Kind.HOLDING or any(o.start <= t <= o.end for o in holds)]
        stretches = sorted(
            [*outside, (hold.start, Kind.HOLDING), (hold.end, following)], key=lambda stretch: stretch[0]
        )
    return [stretch for n, stretch in enumerate(stretches) if n == 0 or stretch[1] is not stretches[n - 1][1]]


def _settle(kinds: list[Kind | None], starts: list[float], level: Array, widths: Array, run: tuple[int, int]) -> None:
    """Turn cells between two bounds into one switch or a short excursion that keeps the mean of the control."""
    c, stop = run
    before, after = kinds[c - 1], kinds[stop]
    upper = float(level[c:stop] @ widths[c:stop])
    whole = float(np.sum(widths[c:stop]))
    if before is not after:
        kinds[c:stop] = [after] * (stop - c)
        starts[c] += upper if before is Kind.UPPER else whole - upper
        for later in range(c + 1, stop):
            starts[later] = max(starts[later], starts[c])
        return
    other = whole - upper if before is Kind.UPPER else upper
    kinds[c:stop] = [before] * (stop - c)
    if other < EXCURSION * widths[c]:
        return
    opposite = Kind.LOWER if before is Kind.UPPER else Kind.UPPER
    first = starts[c] + (whole - other) / 2.0
    kinds[c], starts[c] = opposite, first
    if stop - c > 1:
        kinds[c + 1 : stop] = [before] * (stop - c - 1)
        starts[c + 1] = first + other
    else:
        starts[stop] = first + other
