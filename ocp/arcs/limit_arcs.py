"""State limits that are active along a motion: when, and which control can hold each of them."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import HIGHEST, StateLimit
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind

ACTIVE = 2e-4  # distance from a state limit, share of its range, that counts as active
NEARLY = 2e-3  # distance that does not end an active stretch: on a coarse grid a state on its limit oscillates
STUCK = 0.08  # a stretch on a state limit ends where its control stays at a bound for more than this share of it
APART = 0.5  # cells between the starts of two arcs on limits that seem to begin at once
HELD_FOR = 2.5  # elements that a limit must be active for to be an arc; a shorter contact is a touch point


@dataclass(frozen=True)
class LimitArc:
    """A stretch of time in which a state limit is active."""

    contact: Contact
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Cells:
    """A motion in cells of time, in each of which the controls are constant.

    Args:
        edges: (C + 1,) ends of the cells [s].
        level: (C, nu) position of every control in its range, 0 to 1.
        edge: distance from 0 and 1 that counts as being at a bound.
        sharp: whether switches lie between cells (on a moved grid), so that one cell at a bound is an arc.
    """

    edges: Array
    level: Array
    edge: float
    sharp: bool

    @property
    def inside(self) -> Array:
        """(C, nu) whether a control lies between its bounds."""
        return np.asarray((self.level >= self.edge) & (self.level <= 1.0 - self.edge))


@functools.lru_cache(maxsize=256)
def chain_of(problem: Problem, limit: StateLimit, control: int) -> tuple[ca.SX, ...]:
    """Return c, c', ..., c^(r), the first derivative that depends on a given control; the others are constant.

    For the controls that c^(r) of the limit depends on, this is the chain of the limit. Where those are at their
    bounds, further derivatives show how another control can hold the limit: m r phi'^2 = K with K at its bound is held
    by the drive of phi.

    Args:
        problem: one phase.
        limit: one of its state limits.
        control: index.

    Returns:
        The expressions; empty if the control does not appear within four derivatives more.
    """
    system, chain = problem.system, list(limit.chain)
    while not ca.depends_on(chain[-1], system.u[control]):
        if len(chain) > limit.order + HIGHEST:
            return ()
        chain.append(ca.jtimes(chain[-1], system.x, system.rate))
    return tuple(chain)


def contacts(
    problem: Problem, solution: Solution, limits: tuple[StateLimit, ...], cells: Cells | None = None
) -> tuple[list[LimitArc], list[tuple[float, Contact]]]:
    """Return the stretches on state limits, and the touch points as (time, contact).

    Args:
        problem: one phase.
        solution: of the problem.
        limits: its state limits.
        cells: of the motion, to cut stretches where their control is at a bound; None for whole stretches.
    """
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
            # A limit of first order is reached at some speed: within NEARLY it is met as well as within ACTIVE.
            active = ACTIVE if limit.order > 1 else NEARLY
            for run in _runs(np.abs(values[number] - limit.at(side)) / limit.range, element, active):
                first, last = t[run[0]], t[run[-1]]
                if limit.order == 0:
                    first, last = _widened(first, last, solution, (element[run[0]], element[run[-1]]))
                parts: list[LimitArc] = []
                if last - first >= HELD_FOR * np.max(widths[element[run]]):
                    parts = _parts(problem, solution, limit, LimitArc(Contact(number, side), first, last), cells)
                holds += parts
                # One of first order is not touched: it is left again by a switch, or active along an arc.
                touchable = limit.order > 1 or not (cells is not None and cells.sharp and limit.order == 1)
                if not parts and limit.order and touchable and first > 0.0 and last < solution.duration:
                    at = run[int(np.argmax(side * values[number][run]))]
                    touches.append((float(t[at]), Contact(number, side)))
    return holds, touches


def _widened(first: float, last: float, solution: Solution, elements: tuple[int, int]) -> tuple[float, float]:
    """Return a stretch of time with half of what is missing to whole elements, all at the ends of the motion.

    A constant control is at a limit on itself and states at one node of each element.
    """
    ends, a, b = solution.duration * solution.grid.ends, *elements
    begin = (first + ends[a]) / 2.0 if a else 0.0
    return float(begin), float((last + ends[b + 1]) / 2.0 if b + 1 < len(solution.grid) else solution.duration)


def _runs(distance: Array, element: Array, active: float) -> list[Array]:
    """Return runs of nodes that begin and end within `active` of a limit and stay within NEARLY between."""
    near = np.flatnonzero(distance <= NEARLY)
    runs = np.split(near, np.flatnonzero(np.diff(element[near]) > 1) + 1) if len(near) else []
    met = [(run, np.flatnonzero(distance[run] <= active)) for run in runs]
    return [run[at[0] : at[-1] + 1] for run, at in met if len(at)]


def _parts(
    problem: Problem, solution: Solution, limit: StateLimit, whole: LimitArc, cells: Cells | None
) -> list[LimitArc]:
    """Return the parts of a stretch on a limit in which a control lies between its bounds and can hold the limit."""
    contact, length = whole.contact, whole.end - whole.start
    if cells is None:
        t = (whole.start + whole.end) / 2.0
        inside = _inside(problem, solution.u(t))
        control = _holder(problem, solution, limit, t, inside)
        return [LimitArc(Contact(contact.limit, contact.side, control), whole.start, whole.end)] if control >= 0 else []
    edges, inside = cells.edges, cells.inside
    own = np.flatnonzero((edges[:-1] >= whole.start - 1e-12) & (edges[1:] <= whole.end + 1e-12))
    if not len(own):
        return []
    control = _holder(problem, solution, limit, (whole.start + whole.end) / 2.0, _usually(inside[own]))
    if control < 0:
        return []
    parts, begin = [], whole.start
    stuck = own[~inside[own, control]]
    for run in np.split(stuck, np.flatnonzero(np.diff(stuck) > 1) + 1) if len(stuck) else []:
        first, last = float(edges[run[0]]), float(edges[run[-1] + 1])
        if not cells.sharp and last - first < STUCK * length:
            continue
        parts.append(LimitArc(replace(contact, control=control), begin, first))
        other = _holder(problem, solution, limit, (first + last) / 2.0, _usually(inside[run])) if len(run) > 1 else -1
        if other >= 0:
            parts.append(LimitArc(replace(contact, control=other), first, last))
        begin = last
    parts.append(LimitArc(replace(contact, control=control), begin, whole.end))
    shortest = 0.5 * np.median(np.diff(edges)) if cells.sharp else STUCK * length
    return [part for part in parts if part.end - part.start > shortest]


def in_succession(cells: Cells, holds: list[LimitArc]) -> list[LimitArc]:
    """Return the arcs on limits with their starts made different, as no motion reaches two limits at once as a rule.

    Args:
        cells: of the motion; the limit whose control leaves its bound first is reached first.
        holds: as read, of which some may begin at the end of the same element.
    """
    edges, inside = cells.edges, cells.inside
    apart = APART * float(edges[-1]) / len(edges)

    def leaves(hold: LimitArc) -> float:
        near = np.flatnonzero((edges[1:] > hold.start - 3.0 * np.max(np.diff(edges))) & inside[:, hold.contact.control])
        return float(edges[near[0]]) if len(near) else hold.start

    results: list[LimitArc] = []
    for hold in sorted(holds, key=lambda hold: (hold.start, leaves(hold))):
        start = hold.start
        if start > 0.0 and results and start - results[-1].start < apart:
            start = min(results[-1].start + apart, (hold.start + hold.end) / 2.0)
        results.append(replace(hold, start=start))
    return results


def _usually(inside: Array) -> Array:
    return np.asarray(np.mean(inside, axis=0) > 0.5)


def _inside(problem: Problem, u: Array) -> Array:
    low, high = problem.limits(Where.ALONG, problem.system.u)
    return np.array([0.02 <= level(u[i : i + 1], low[i], high[i])[0] <= 0.98 for i in range(len(u))])


def holder_of(problem: Problem, limit: StateLimit, point: tuple[Array, Array, Array], free: Array) -> int:
    """Return the control that can hold a limit: one between its bounds with the largest effect; else -1.

    The derivatives of the limit are taken until a control between its bounds appears in one of them.

    Args:
        problem: one phase.
        limit: one of its state limits.
        point: state, control and parameters.
        free: (nu,) whether a control lies between its bounds.
    """
    chains = {i: chain_of(problem, limit, i) for i in np.flatnonzero(free).tolist()}
    orders = [len(chain) for chain in chains.values() if chain]
    if not orders:
        return -1
    chosen = [i for i, chain in chains.items() if len(chain) == min(orders)]
    return max(chosen, key=lambda i: strength_of(problem, limit, point, i))


def strength_of(problem: Problem, limit: StateLimit, point: tuple[Array, Array, Array], control: int) -> float:
    """Return how much the range of a control changes the derivative of a limit in which it appears first."""
    low, high = problem.limits(Where.ALONG, problem.system.u)
    width = high[control] - low[control]
    return abs(effect_of(problem, limit, point, control)) * (width if np.isfinite(width) else 1.0)


def effect_of(problem: Problem, limit: StateLimit, point: tuple[Array, Array, Array], control: int) -> float:
    """Return the derivative by a control of the derivative of a limit in which it appears first."""
    return float(_effect(problem, limit, control)(*point))


@functools.lru_cache(maxsize=256)
def _effect(problem: Problem, limit: StateLimit, control: int) -> ca.Function:
    system = problem.system
    slope = ca.jacobian(chain_of(problem, limit, control)[-1], system.u[control])
    return ca.Function("effect", [system.x, system.u, system.p], [ca.densify(slope)])


def _holder(problem: Problem, solution: Solution, limit: StateLimit, t: float, inside: Array) -> int:
    return holder_of(problem, limit, (solution.x(t), solution.u(t), solution.parameters), inside)


def level(u: Array, low: float, high: float, edge: float = 0.02) -> Array:
    """Return the position of a control in its range, 0 to 1; one half away from the bounds if one is missing."""
    if not np.isfinite(high - low) or high <= low:
        at = np.full(len(u), 0.5)
        if np.isfinite(low):
            at[u - low <= edge * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 0.0
        if np.isfinite(high):
            at[high - u <= edge * max(np.ptp(u), 1e-12 * np.max(np.abs(u)))] = 1.0
        return at
    return np.asarray(np.clip((u - low) / (high - low), 0.0, 1.0))


def with_brakes(
    problem: Problem, solution: Solution, limits: tuple[StateLimit, ...], arcs: tuple[Arc, ...], short: float
) -> tuple[Arc, ...]:
    """Return the arcs with a short braking arc before every arc on a limit of second order that lacks one.

    Such an arc begins with c = limit and c' = 0: after a control has driven the motion towards the limit, it has to
    stop it there with its other bound. Where the way to the limit is short, the braking arc is too short to be seen on
    a grid.

    Args:
        problem: one phase.
        solution: of the problem.
        limits: its state limits.
        arcs: as read.
        short: duration of the new arcs [s].
    """
    system, results, t = problem.system, list[Arc](), 0.0
    for k, arc in enumerate(arcs):
        before = arcs[k - 1] if k else None
        for contact in arc.held if before is not None else ():
            i, limit = contact.control, limits[contact.limit]
            chain = chain_of(problem, limit, i) if i >= 0 else ()
            assert before is not None
            known = any((c.limit, c.side) == (contact.limit, contact.side) for c in before.held)
            if len(chain) != 3 or known or before.kinds[i] not in (Kind.LOWER, Kind.UPPER):
                continue
            slope = ca.Function("slope", [system.x, system.u, system.p], [ca.jacobian(chain[-1], system.u[i])])
            away = -contact.side * float(slope(solution.x(t), solution.u(t), solution.parameters))
            braking = Kind.UPPER if away > 0.0 else Kind.LOWER
            last = results[-1]
            if last.kinds[i] is braking or last.duration < 2.0 * short:
                continue
            kinds = tuple(braking if j == i else kind for j, kind in enumerate(last.kinds))
            results[-1] = replace(last, duration=last.duration - short)
            results.append(Arc(kinds, short, last.held))
        results.append(arc)
        t = min(t + arc.duration, solution.duration)
    return tuple(results)
