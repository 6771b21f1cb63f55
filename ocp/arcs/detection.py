"""Detection of the switching structure of a motion from its controls, switching functions and state limits."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.arcs.arcs import merged
from ocp.arcs.switching import switching_functions
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.transcription.schemes.scheme import Control

EDGE = 0.02  # distance of a control from a bound, share of its range, that counts as being at the bound
ACTIVE = 2e-4  # distance from a state limit, share of its range, that counts as active
NEARLY = 2e-3  # distance that does not end an active stretch: on a coarse grid a state on its limit oscillates
STUCK = 0.08  # a stretch on a state limit ends where its control stays at a bound for more than this share of it
HELD_FOR = 2.5  # elements that a limit must be active for to be an arc; a shorter contact is a touch point
CHATTER = 2  # most cells between two bounds that are one switch or a short excursion, not an interior arc
SINGULAR = 0.02  # switching function, share of the Hamiltonian, below which a control between bounds is interior
EXCURSION = 0.05  # of a cell; shorter excursions are no arcs

Stretch = tuple[float, Kind]  # start of a stretch of one control [s], and its kind


@dataclass(frozen=True)
class LimitArc:
    """A stretch of time in which a state limit is active."""

    contact: Contact
    start: float
    end: float


def read(problem: Problem, solution: Solution, limits: tuple[StateLimit, ...]) -> tuple[Arc, ...]:
    """Return the switching structure of a solution as arcs.

    Args:
        problem: one phase.
        solution: of the problem, on any grid.
        limits: state limits of the problem.
    """
    edges, u, share = cells(problem, solution)
    holds, touches = contacts(problem, solution, limits)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    places = [_place(u[:, i], low[i], high[i]) for i in range(u.shape[1])]
    # A control cannot be at a bound that it does not have, whatever the sign of its switching function.
    share = np.where(np.isfinite(np.where(share > 0.0, low, high)), share, 0.0)
    kept = [(hold, _possible(hold, edges, places[hold.contact.control])) for hold in holds]
    holds = [part for _, parts in kept for part in parts]
    # A limit that no control can hold is a touch point, however long it is active.
    touches += [((h.start + h.end) / 2.0, Contact(h.contact.limit, h.contact.side)) for h, parts in kept if not parts]
    stretches: list[list[Stretch]] = []
    for i, place in enumerate(places):
        own = [hold for hold in holds if hold.contact.control == i]
        stretches.append(_stretches(edges, place, share[:, i], own))
    times = {0.0}
    times |= {t for own in stretches for t, _ in own} | {t for t, _ in touches}
    times |= {t for hold in holds for t in (hold.start, hold.end)}
    inner = sorted(t for t in times if t < solution.duration)
    arcs = []
    for a, b in zip(inner, [*inner[1:], solution.duration], strict=True):
        middle = (a + b) / 2.0
        kinds = tuple([kind for t, kind in own if t <= middle][-1] for own in stretches)
        held = tuple(hold.contact for hold in holds if hold.start < middle < hold.end)
        arcs.append(Arc(kinds, b - a, held, tuple(contact for t, contact in touches if t == a)))
    return merged(tuple(arcs))


def cells(problem: Problem, solution: Solution) -> tuple[Array, Array, Array]:
    """Return the ends (C + 1,) of cells in time, the control (C, nu) and the switching functions (C, nu) in each."""
    scheme, grid = solution.scheme, solution.grid
    marks = np.append(0.0, np.cumsum(scheme.weights)) if scheme.control is Control.COLLOCATED else np.array([0.0, 1.0])
    marks[-1] = 1.0
    middle = scheme.points if scheme.control is Control.COLLOCATED else np.array([0.5])
    edges = (grid.ends[:-1, None] + grid.widths[:, None] * marks[:-1]).ravel()
    _, x, _, u = solution.samples(middle)
    costates = np.einsum("sd,kda->ksa", scheme.costate_at(middle), solution.costates).reshape(len(x), -1)
    result = switching_functions(problem, x, u, costates, solution.parameters)
    return np.append(edges, 1.0) * solution.duration, u, result.shares


def contacts(
    problem: Problem, solution: Solution, limits: tuple[StateLimit, ...]
) -> tuple[list[LimitArc], list[tuple[float, Contact]]]:
    """Return the stretches on state limits, and the touch points as (time, contact)."""
    if not limits:
        return [], []
    system, scheme = problem.system, solution.scheme
    t, x, _, u = solution.samples(scheme.nodes)
    p = np.tile(solution.parameters[:, None], len(t))
    function = ca.Function(
        "limits", [system.x, system.u, system.p], [ca.vertcat(*(limit.chain[0] for limit in limits))]
    )
    values = np.array(function.map(len(t))(x.T, u.T, p))
    element = np.repeat(np.arange(len(solution.grid)), len(scheme.nodes))
    widths = solution.duration * solution.grid.widths
    holds: list[LimitArc] = []
    touches: list[tuple[float, Contact]] = []
    for number, limit in enumerate(limits):
        for side in (-1, 1):
            if not np.isfinite(limit.at(side)):
                continue
            for run in _runs(np.abs(values[number] - limit.at(side)) / limit.range, element):
                first, last = t[run[0]], t[run[-1]]
                if last - first >= HELD_FOR * np.max(widths[element[run]]):
                    control = _holder(problem, solution, limit, (first + last) / 2.0)
                    holds.append(LimitArc(Contact(number, side, control), first, last))
                elif limit.order and first > 0.0 and last < solution.duration:
                    at = run[int(np.argmax(side * values[number][run]))]
                    touches.append((float(t[at]), Contact(number, side)))
    return holds, touches


def _runs(distance: Array, element: Array) -> list[Array]:
    """Return runs of nodes that begin and end within ACTIVE of a limit and stay within NEARLY between."""
    near = np.flatnonzero(distance <= NEARLY)
    runs = np.split(near, np.flatnonzero(np.diff(element[near]) > 1) + 1) if len(near) else []
    active = [(run, np.flatnonzero(distance[run] <= ACTIVE)) for run in runs]
    return [run[at[0] : at[-1] + 1] for run, at in active if len(at)]


def _possible(hold: LimitArc, edges: Array, place: Array) -> list[LimitArc]:
    """Return the parts of a stretch on a limit in which its control lies between its bounds and can hold the limit."""
    inside = np.flatnonzero((edges[:-1] >= hold.start - 1e-12) & (edges[1:] <= hold.end + 1e-12))
    stuck = inside[(place[inside] < EDGE) | (place[inside] > 1.0 - EDGE)]
    whole = hold.end - hold.start
    parts, begin = [], hold.start
    for run in np.split(stuck, np.flatnonzero(np.diff(stuck) > 1) + 1) if len(stuck) else []:
        first, last = float(edges[run[0]]), float(edges[run[-1] + 1])
        if last - first < STUCK * whole:
            continue
        parts.append(LimitArc(hold.contact, begin, first))
        begin = last
    parts.append(LimitArc(hold.contact, begin, hold.end))
    return [part for part in parts if part.end - part.start > STUCK * whole]


def _holder(problem: Problem, solution: Solution, limit: StateLimit, t: float) -> int:
    """Return the control that holds a limit: one between its limits with the largest effect on c^(r)."""
    system = problem.system
    effect = ca.Function("e", [system.x, system.u, system.p], [ca.densify(ca.jacobian(limit.chain[-1], system.u))])
    u = solution.u(t)
    low, high = problem.limits(Where.ALONG, system.u)
    strength = np.abs(np.array(effect(solution.x(t), u, solution.parameters))).ravel()
    strength = strength * np.where(np.isfinite(high - low), high - low, 1.0)
    inside = np.abs([_place(u[i : i + 1], low[i], high[i])[0] - 0.5 for i in range(len(u))]) < 0.5 - EDGE
    return int(np.argmax(np.where(inside, strength + 1e-300, 0.0) if inside.any() else strength))


def _place(u: Array, low: float, high: float) -> Array:
    """Return the position of a control in its range, 0 to 1; one half away from the bounds if one is missing."""
    if not np.isfinite(high - low) or high <= low:
        at = np.full(len(u), 0.5)
        if np.isfinite(low):
            at[u - low <= EDGE * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 0.0
        if np.isfinite(high):
            at[high - u <= EDGE * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 1.0
        return at
    return np.clip((u - low) / (high - low), 0.0, 1.0)


def _stretches(edges: Array, place: Array, share: Array, holds: list[LimitArc]) -> list[Stretch]:
    """Return the stretches of one control from its positions in all cells."""
    middle, widths = (edges[:-1] + edges[1:]) / 2.0, np.diff(edges)
    kinds: list[Kind | None] = [Kind.LOWER if a < EDGE else Kind.UPPER if a > 1.0 - EDGE else None for a in place]
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
            kinds[c:stop] = [after or before or Kind.INTERIOR] * (stop - c)
        elif short and Kind.HOLDING in (before, after):
            kinds[c:stop] = [after if before is Kind.HOLDING else before] * (stop - c)
        elif short:
            _settle(kinds, starts, place, widths, (c, stop))
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
        after = [kind for t, kind in stretches if t <= hold.end or kind is not Kind.HOLDING]
        following = next((kind for t, kind in stretches if t > (hold.start + hold.end) / 2.0), after[-1])
        outside = [(t, k) for t, k in stretches if t < hold.start or t > hold.end]
        outside = [(t, k) for t, k in outside if k is not Kind.HOLDING or any(o.start <= t <= o.end for o in holds)]
        stretches = sorted(
            [*outside, (hold.start, Kind.HOLDING), (hold.end, following)], key=lambda stretch: stretch[0]
        )
    return [stretch for n, stretch in enumerate(stretches) if n == 0 or stretch[1] is not stretches[n - 1][1]]


def _settle(kinds: list[Kind | None], starts: list[float], place: Array, widths: Array, run: tuple[int, int]) -> None:
    """Turn cells between two bounds into one switch or a short excursion that keeps the mean of the control."""
    c, stop = run
    before, after = kinds[c - 1], kinds[stop]
    upper = float(place[c:stop] @ widths[c:stop])
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
