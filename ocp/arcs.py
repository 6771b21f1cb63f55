"""A motion of given switching structure: the durations of its arcs are unknowns, controls at limits are pinned."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.boundary import ends
from ocp.collocation import Scheme
from ocp.constraint import Where
from ocp.division import Condition, Division, Near
from ocp.grid import Grid
from ocp.guess import Guess
from ocp.ipopt import Answer, Ipopt, build, run
from ocp.multipliers import Jump, Pressure, Tie, adjoin_directly
from ocp.problem import Free, Problem
from ocp.programme import Programme, bounds, pack
from ocp.scaling import from_limits
from ocp.solution import Status
from ocp.statelimit import StateLimit
from ocp.structure import Arc, Contact, Kind
from ocp.transcription import free_parameters, transcribe

Array = np.ndarray
LEAST = 1e-9  # duration of an arc below which it counts as vanished, share of the whole


@dataclass(frozen=True, eq=False)
class ArcMotion:
    """A solved motion of given structure.

    Args:
        arcs: with the durations found.
        answer: of the solver.
        grid: of the whole motion.
        arc: (N,) number of the arc of each element.
        states, controls, costates: (N, m, nx), (N, d, nu), (N, d, nx); costates of the problem with its state limits
            adjoined directly, lambda = dJ/dx.
        pressures: multipliers of the limits that are held.
        jumps: at entries, exits and touches.
        free: values of the free parameters.
        setup: seconds.
    """

    arcs: tuple[Arc, ...]
    answer: Answer
    grid: Grid
    arc: Array
    states: Array
    controls: Array
    costates: Array
    pressures: tuple[Pressure, ...]
    jumps: tuple[Jump, ...]
    free: Array
    setup: float
    price: float  # of the distance of undetermined controls from those of the guess, part of the answer's cost

    @property
    def duration(self) -> float:
        """Sum of the durations [s]."""
        return sum(arc.duration for arc in self.arcs)


def solve_arcs(
    problem: Problem,
    limits: tuple[StateLimit, ...],
    arcs: tuple[Arc, ...],
    elements: tuple[int, ...],
    scheme: Scheme,
    guess: Guess,
    values: Mapping[str, float],
    settings: Ipopt,
    weight: float = 0.0,
) -> ArcMotion:
    """Solve a problem for a given structure, from a guess of the motion.

    Args:
        problem: a Problem.
        limits: its state limits.
        arcs: the structure, with guessed durations.
        elements: number of elements of each arc.
        scheme: with collocated control.
        guess: of the motion.
        values: of the parameters, by name.
        settings: of IPOPT.
        weight: [cost/s] of the distance of undetermined controls from those of the guess (see `undetermined`).

    Source: index reduction on state-limited arcs: D. H. Jacobson, M. M. Lele, J. L. Speyer, New necessary conditions of
        optimality for control problems with state-variable inequality constraints, J. Math. Anal. Appl. 35, 1971.
    """
    begun = time.perf_counter()
    numbers = problem.system.values(values)
    arc = np.repeat(np.arange(len(arcs)), elements)
    widths = 1.0 / np.repeat(elements, elements)
    durations = np.array([a.duration for a in arcs])
    grid = _grid(durations, arc, widths)
    freed = replace(problem, horizon=Free(guess=float(durations.sum())))
    scaling = from_limits(freed, guess, numbers, free_parameters(freed))
    ties = _ties(problem, limits, arcs, arc, scheme, numbers)
    total = None if isinstance(problem.horizon, Free) else problem.horizon.duration
    near = _near(problem, arcs, arc, scheme, guess, grid, weight)
    division = Division(arc, tuple(tie.condition for tie in ties), total, near)
    programme = transcribe(freed, scheme, grid, scaling, division)
    low, high, rows_low, rows_high = _pinned(problem, programme, arcs, limits, division)
    z0 = pack(programme, guess, numbers)
    z0[programme.layout.horizon] = durations / scaling.horizon
    if np.sum(rows_low == rows_high) - np.sum(low < high) > 2 * _simultaneous(arcs):
        # Fewer unknowns than conditions, and no symmetry that could make some of them follow from others.
        nothing = np.zeros(programme.rows)
        answer = Answer(
            z0, nothing, np.zeros(len(z0)), np.nan, Status.INFEASIBLE, "fewer unknowns than conditions", 0, 0.0, 0.0, {}
        )
        setup = time.perf_counter() - begun
    else:
        solver = build(programme.nlp, programme.derivatives, settings, False, (scaling.cost, programme.sizes))
        setup = time.perf_counter() - begun
        sides = low, high, rows_low, rows_high
        answer = run(solver, np.clip(z0, low, high), np.append(numbers, widths), sides)
    layout = programme.layout
    found = np.maximum(answer.z[layout.horizon] * scaling.horizon, 0.0)
    done = tuple(replace(a, duration=float(t)) for a, t in zip(arcs, found, strict=True))
    states, controls = answer.z[layout.state] * scaling.x, answer.z[layout.control] * scaling.u
    free = answer.z[layout.free] * scaling.free
    parameters = np.array(numbers)
    parameters[programme.free] = free
    mu = answer.multipliers[programme.defects]
    costates = -np.einsum("ij,kia->kja", scheme.rate, mu) / scheme.weights[:, None] / scaling.x
    grid = _grid(found, arc, widths)
    pressures, jumps = adjoin_directly(
        problem, limits, ties, programme, answer, (states, controls, costates), grid, parameters
    )
    price = sum(_price(n, controls, grid.widths * found.sum()) for n in near)
    return ArcMotion(done, answer, grid, arc, states, controls, costates, pressures, jumps, free, setup, price)


def _simultaneous(arcs: tuple[Arc, ...]) -> int:
    """Return how many switches happen at the same time as another one."""
    pairs = pairwise(arcs)
    changes = [sum(a is not b for a, b in zip(one.kinds, other.kinds, strict=True)) for one, other in pairs]
    return sum(max(count - 1, 0) for count in changes)


def undetermined(problem: Problem) -> Array:
    """Return the numbers of the controls that the Hamiltonian is linear in: between limits they are singular."""
    system = problem.system
    costate = ca.SX.sym("lambda", system.x.numel())
    hamiltonian = ca.dot(costate, system.rate) + problem.minimise.running
    curvature = ca.hessian(hamiltonian, system.u)[0]
    return np.array([i for i in range(system.u.numel()) if ca.SX(curvature[i, i]).is_zero()], dtype=int)


def _near(
    problem: Problem, arcs: tuple[Arc, ...], arc: Array, scheme: Scheme, guess: Guess, grid: Grid, weight: float
) -> tuple[Near, ...]:
    """Return the prices that keep undetermined controls near those of the guess."""
    singular, system = undetermined(problem), problem.system
    low, high = problem.limits(Where.ALONG, system.u)
    found = []
    for k, a in enumerate(arcs if weight > 0.0 else ()):
        chosen = np.array([i for i in singular if a.kinds[i] is Kind.INTERIOR], dtype=int)
        if len(chosen) == 0:
            continue
        own = np.flatnonzero(arc == k)
        share = grid.ends[own][:, None] + grid.widths[own][:, None] * scheme.points
        reference = guess.control(share)[:, :, chosen]
        used = np.maximum(np.ptp(guess.u, axis=0), np.max(np.abs(guess.u), axis=0))
        size = np.where(np.isfinite(high - low), high - low, np.where(used > 0.0, used, 1.0))[chosen]
        found.append(Near(chosen, reference, size, weight, own, scheme.weights))
    return tuple(found)


def _price(near: Near, controls: Array, seconds: Array) -> float:
    """Return what leaving a reference costs."""
    away = (controls[near.elements][:, :, near.controls] - near.reference) / near.size
    return float(near.weight / 2.0 * seconds[near.elements] @ np.sum(away**2, axis=2) @ near.shares)


def _grid(durations: Array, arc: Array, widths: Array) -> Grid:
    """Return the grid of the whole motion; vanished arcs keep a width, as a grid increases."""
    seconds = np.append(0.0, np.cumsum(np.maximum(durations, LEAST * durations.sum())[arc] * widths))
    share = seconds / seconds[-1]
    share[-1] = 1.0
    return Grid(share)


def _ties(
    problem: Problem, limits: tuple[StateLimit, ...], arcs: tuple[Arc, ...], arc: Array, scheme: Scheme,
    numbers: list[float],
) -> list[Tie]:  # fmt: skip
    """Return the conditions of held and touched limits."""
    _, _, (start_known, _) = ends(problem, ca.DM(numbers))
    total = sum(a.duration for a in arcs)
    ties: list[Tie] = []

    def met(k: int, contact: Contact, count: int) -> Tie:
        limit, value = limits[contact.limit], np.zeros(count)
        value[0] = limit.at(contact.side)
        size = limit.range / total ** np.arange(count)
        first = np.flatnonzero(arc == k)[:1]
        return Tie(Condition(ca.vertcat(*limit.chain[:count]), value, size, first, (0.0,)), k, contact, False)

    for k, a in enumerate(arcs):
        before = {(c.limit, c.side) for c in arcs[k - 1].held} if k else set()
        for contact in a.held:
            limit = limits[contact.limit]
            value = np.zeros(1) if limit.order else np.array([limit.at(contact.side)])
            size, own = np.array([limit.range / total**limit.order]), np.flatnonzero(arc == k)
            ties.append(Tie(Condition(limit.chain[-1], value, size, own, tuple(scheme.points)), k, contact, True))
            if limit.order and (contact.limit, contact.side) not in before and not (k == 0 and start_known):
                ties.append(met(k, contact, limit.order))
        ties += [met(k, contact, min(limits[contact.limit].order, 2)) for contact in a.touched]
    return ties


def _pinned(
    problem: Problem, programme: Programme, arcs: tuple[Arc, ...], limits: tuple[StateLimit, ...], division: Division
) -> tuple[Array, Array, Array, Array]:
    """Return the bounds with controls pinned, and without the limits that conditions hold already."""
    low, high, rows_low, rows_high = bounds(programme)
    layout = programme.layout
    lower, upper = (side / programme.scaling.u for side in problem.limits(Where.ALONG, problem.system.u))
    low[layout.horizon], high[layout.horizon] = 0.0, np.inf
    rows_low[programme.total] = rows_high[programme.total] = division.total
    rows = {part: place for place, part in enumerate(programme.path_parts)}
    known = np.append(layout.state[0, 0], layout.state[-1, -1])  # conditions at the ends of the motion stay
    for k, a in enumerate(arcs):
        own = np.flatnonzero(division.arc == k)
        for i, kind in enumerate(a.kinds):
            if kind in (Kind.LOWER, Kind.UPPER):
                pinned = layout.control[own, :, i]
                low[pinned] = high[pinned] = lower[i] if kind is Kind.LOWER else upper[i]
        for contact in (*a.held, *a.touched):
            limit = limits[contact.limit]
            along = contact in a.held
            if limit.state >= 0:
                chosen = layout.state[own, :, limit.state] if along else layout.state[own[:1], :1, limit.state]
                chosen = np.setdiff1d(chosen, known)
                low[chosen], high[chosen] = -np.inf, np.inf
            elif along:
                chosen = programme.path[rows[limit.constraint, limit.component]][own]
                rows_low[chosen], rows_high[chosen] = -np.inf, np.inf
    return low, high, rows_low, rows_high
