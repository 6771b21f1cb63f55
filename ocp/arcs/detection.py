"""Reading a switching structure off a motion: from its controls, its switching functions and its state limits."""

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

EDGE = 0.02  # share of its range within which a control counts as being at a limit
ACTIVE = 2e-4  # share of the range of a state limit within which it counts as active
NEARLY = 2e-3  # share of it within which a contact is not over; on a coarse grid a held state bounces
STUCK = 0.08  # share of a hold that its control must be at a limit for to end it
HELD_FOR = 2.5  # elements that a limit must be active for to be held; for less it is touched
CHATTER = 2  # cells between two limits that are a switch or a short excursion, no interior arc
SINGULAR = 0.02  # switching function, share of the Hamiltonian, below which a control between limits is interior
EXCURSION = 0.05  # of a cell; shorter excursions are no arcs

Spell = tuple[float, Kind]  # from when a control is where in its range


@dataclass(frozen=True)
class Hold:
    """A state limit that is active from start to end."""

    contact: Contact
    start: float
    end: float


def read(problem: Problem, solution: Solution, limits: tuple[StateLimit, ...]) -> tuple[Arc, ...]:
    """Return the switching structure of a solution as arcs.

    Args:
        problem: that it solves.
        solution: on any grid.
        limits: of its states.
    """
    edges, u, share = cells(problem, solution)
    holds, touches = contacts(problem, solution, limits)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    places = [_place(u[:, i], low[i], high[i]) for i in range(u.shape[1])]
    # A control cannot be at a limit that it does not have, whatever its switching function says.
    share = np.where(np.isfinite(np.where(share > 0.0, low, high)), share, 0.0)
    kept = [(hold, _possible(hold, edges, places[hold.contact.control])) for hold in holds]
    holds = [part for _, parts in kept for part in parts]
    # A limit that no control holds, however long it takes, is touched.
    touches += [((h.start + h.end) / 2.0, Contact(h.contact.limit, h.contact.side)) for h, parts in kept if not parts]
    spells: list[list[Spell]] = []
    for i, place in enumerate(places):
        own = [hold for hold in holds if hold.contact.control == i]
        spells.append(_spells(edges, place, share[:, i], own))
    times = {0.0}
    times |= {t for own in spells for t, _ in own} | {t for t, _ in touches}
    times |= {t for hold in holds for t in (hold.start, hold.end)}
    inner = sorted(t for t in times if t < solution.duration)
    arcs = []
    for a, b in zip(inner, [*inner[1:], solution.duration], strict=True):
        middle = (a + b) / 2.0
        kinds = tuple([kind for t, kind in own if t <= middle][-1] for own in spells)
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
) -> tuple[list[Hold], list[tuple[float, Contact]]]:
    """Return the limits that are held, and the instants at which others are touched."""
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
    holds: list[Hold] = []
    touches: list[tuple[float, Contact]] = []
    for number, limit in enumerate(limits):
        for side in (-1, 1):
            if not np.isfinite(limit.at(side)):
                continue
            for run in _runs(np.abs(values[number] - limit.at(side)) / limit.range, element):
                first, last = t[run[0]], t[run[-1]]
                if last - first >= HELD_FOR * np.max(widths[element[run]]):
                    control = _holder(problem, solution, limit, (first + last) / 2.0)
                    holds.append(Hold(Contact(number, side, control), first, last))
                elif limit.order and first > 0.0 and last < solution.duration:
                    at = run[int(np.argmax(side * values[number][run]))]
                    touches.append((float(t[at]), Contact(number, side)))
    return holds, touches


def _runs(distance: Array, element: Array) -> list[Array]:
    """Return runs of places that begin and end within ACTIVE of a limit and stay within NEARLY between."""
    near = np.flatnonzero(distance <= NEARLY)
    runs = np.split(near, np.flatnonzero(np.diff(element[near]) > 1) + 1) if len(near) else []
    active = [(run, np.flatnonzero(distance[run] <= ACTIVE)) for run in runs]
    return [run[at[0] : at[-1] + 1] for run, at in active if len(at)]


def _possible(hold: Hold, edges: Array, place: Array) -> list[Hold]:
    """Return the parts of a hold in which its control is between its limits; at a limit it can hold nothing."""
    inside = np.flatnonzero((edges[:-1] >= hold.start - 1e-12) & (edges[1:] <= hold.end + 1e-12))
    stuck = inside[(place[inside] < EDGE) | (place[inside] > 1.0 - EDGE)]
    whole = hold.end - hold.start
    parts, begin = [], hold.start
    for run in np.split(stuck, np.flatnonzero(np.diff(stuck) > 1) + 1) if len(stuck) else []:
        first, last = float(edges[run[0]]), float(edges[run[-1] + 1])
        if last - first < STUCK * whole:
            continue
        parts.append(Hold(hold.contact, begin, first))
        begin = last
    parts.append(Hold(hold.contact, begin, hold.end))
    return [part for part in parts if part.end - part.start > STUCK * whole]


def _holder(problem: Problem, solution: Solution, limit: StateLimit, t: float) -> int:
    """Return the control that holds a limit: one between its limits with the largest effect on c^(r)."""
    system = problem.system
    effect = ca.Function("e", [system.x, system.u, system.p], [ca.densify(ca.jacobian(limit.chain[-1], system.u))])
    u = solution.u(t)
    low, high = problem.limits(Where.ALONG, system.u)
    size = np.abs(np.array(effect(solution.x(t), u, solution.parameters))).ravel()
    size = size * np.where(np.isfinite(high - low), high - low, 1.0)
    inside = np.abs([_place(u[i : i + 1], low[i], high[i])[0] - 0.5 for i in range(len(u))]) < 0.5 - EDGE
    return int(np.argmax(np.where(inside, size + 1e-300, 0.0) if inside.any() else size))


def _place(u: Array, low: float, high: float) -> Array:
    """Return where a control is in its range, 0 to 1; one half without two limits."""
    if not np.isfinite(high - low) or high <= low:
        at = np.full(len(u), 0.5)
        if np.isfinite(low):
            at[u - low <= EDGE * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 0.0
        if np.isfinite(high):
            at[high - u <= EDGE * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 1.0
        return at
    return np.clip((u - low) / (high - low), 0.0, 1.0)


def _spells(edges: Array, place: Array, share: Array, holds: list[Hold]) -> list[Spell]:
    """Return from when a control is where in its range, from its values in cells."""
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
    spells: list[Spell] = []
    for at, kind in zip(starts, kinds, strict=True):
        if kind is not None and (not spells or spells[-1][1] is not kind):
            spells.append((float(at), kind))
    return [(0.0 if n == 0 else t, kind) for n, (t, kind) in enumerate(_within(spells, holds))]


def _within(spells: list[Spell], holds: list[Hold]) -> list[Spell]:
    """Return spells in which a control holds a limit from the first to the last instant at which it is active."""
    for hold in holds:
        after = [kind for t, kind in spells if t <= hold.end or kind is not Kind.HOLDING]
        following = next((kind for t, kind in spells if t > (hold.start + hold.end) / 2.0), after[-1])
        outside = [(t, k) for t, k in spells if t < hold.start or t > hold.end]
        outside = [(t, k) for t, k in outside if k is not Kind.HOLDING or any(o.start <= t <= o.end for o in holds)]
        spells = sorted([*outside, (hold.start, Kind.HOLDING), (hold.end, following)], key=lambda spell: spell[0])
    return [spell for n, spell in enumerate(spells) if n == 0 or spell[1] is not spells[n - 1][1]]


def _settle(kinds: list[Kind | None], starts: list[float], place: Array, widths: Array, run: tuple[int, int]) -> None:
    """Turn cells between two limits into a switch or a short excursion whose durations keep the mean control."""
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
