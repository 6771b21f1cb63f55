"""The NLP of a switching structure: the durations of its arcs are unknowns, controls at limits are pinned."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.null_space_newton import Equations, as_equations
from ocp.arcs.state_limit_multipliers import Tie, adjoin_directly
from ocp.checks import Array
from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where
from ocp.problem.problem import Free, Problem
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solving.ipopt import Answer, Ipopt, Solver, build, run
from ocp.transcription.arc_division import Condition, Division, Near
from ocp.transcription.direct_collocation import free_parameters, transcribe
from ocp.transcription.grid import Grid
from ocp.transcription.guess import Guess
from ocp.transcription.nlp import Nlp, bounds
from ocp.transcription.packing import pack
from ocp.transcription.scaling import from_limits

LEAST = 1e-9  # duration of an arc below which it counts as vanished, share of the whole


@dataclass(frozen=True, eq=False)
class ArcProgramme:
    """A switching structure transcribed, with its solver; made by `prepare_arcs`.

    Args:
        task: the problem.
        arcs: the structure.
        elements: number of elements of each arc.
        NLP: with one duration for each arc.
        division: into arcs.
        ties: conditions of held and touched limits.
        limited: whether limits that the structure does not meet, and durations >= 0, are part of the NLP.
        solver: of the NLP.
        equations: that the NLP is, if there are as many as unknowns; they need no solver.
        setup: seconds.
    """

    task: ArcProblem
    arcs: tuple[Arc, ...]
    elements: tuple[int, ...]
    nlp: Nlp
    division: Division
    ties: tuple[Tie, ...]
    limited: bool
    solver: Solver | None
    equations: Equations | None
    setup: float

    def adapted(self, problem: Problem, numbers: tuple[float, ...]) -> ArcProgramme:
        """Return this NLP for other parameter values and a problem that differs in numbers only."""
        nlp = replace(self.nlp, problem=_freed(problem))
        return replace(self, task=self.task.adapted(problem, numbers), nlp=nlp)

    def start(self, guess: Guess, durations: Array) -> Array:
        """Return the unknowns (nz,) of a guess of the motion and of the durations (A,) of its arcs [s]."""
        grid = _grid(durations, self.division.arc, self._widths)
        z0 = pack(replace(self.nlp, grid=grid), guess, list(self.task.numbers))
        z0[self.nlp.layout.horizon] = durations / self.nlp.scaling.horizon
        return z0

    def restart(self, solution: Solution) -> Array:
        """Return the unknowns (nz,) of a solution with the same structure and as many elements."""
        layout, scaling, z0 = self.nlp.layout, self.nlp.scaling, np.zeros(self.nlp.layout.size)
        assert solution.structure is not None
        z0[layout.state], z0[layout.control] = solution.states / scaling.x, solution.controls / scaling.u
        z0[layout.horizon] = np.array([arc.duration for arc in solution.structure.arcs]) / scaling.horizon
        z0[layout.free] = np.array(list(solution.free.values())) / scaling.free
        return z0

    def unlimited(self) -> ArcProgramme:
        """Return it without the limits that the structure does not meet, and without durations >= 0.

        It often has as many equations as unknowns then, which take few Newton steps near their solution.
        """
        bare = replace(self, limited=False)
        return replace(bare, equations=as_equations(self.nlp, bare.sides()))

    def solve(self, z0: Array) -> ArcMotion:
        """Solve from given unknowns (nz,).

        Source: index reduction on state-limited arcs: D. H. Jacobson, M. M. Lele, J. L. Speyer, New necessary
            conditions of optimality for control problems with state-variable inequality constraints, J. Math. Anal.
            Appl. 35, 1971.
        """
        begun = time.perf_counter()
        sides = self.sides()
        low, high, rows_low, rows_high = sides
        if np.sum(rows_low == rows_high) - np.sum(low < high) > 2 * _simultaneous(self.arcs):
            # Fewer unknowns than conditions, and no symmetry that could make some of them follow from others.
            nothing, words = np.zeros(len(rows_low)), "fewer unknowns than conditions"
            answer = Answer(z0, nothing, np.zeros(len(z0)), np.nan, Status.INFEASIBLE, words, 0, 0.0, 0.0, {})
        elif self.equations is not None:
            answer = self.equations.solve(np.clip(z0, low, high), np.append(self.task.numbers, self._widths), sides)
        else:
            assert self.solver is not None
            answer = run(self.solver, np.clip(z0, low, high), np.append(self.task.numbers, self._widths), sides)
        return self._motion(answer, self.setup + time.perf_counter() - begun - answer.seconds)

    @property
    def _widths(self) -> Array:
        """(N,) widths of the elements, shares of their arc."""
        return 1.0 / np.repeat(self.elements, self.elements)

    def _motion(self, answer: Answer, setup: float) -> ArcMotion:
        nlp, layout, scaling, arc = (
            self.nlp,
            self.nlp.layout,
            self.nlp.scaling,
            self.division.arc,
        )
        result = np.maximum(answer.z[layout.horizon] * scaling.horizon, 0.0)
        done = tuple(replace(a, duration=float(t)) for a, t in zip(self.arcs, result, strict=True))
        states, controls = answer.z[layout.state] * scaling.x, answer.z[layout.control] * scaling.u
        parameters = np.array(self.task.numbers)
        parameters[nlp.free] = answer.z[layout.free] * scaling.free
        scheme, mu = self.task.scheme, answer.multipliers[nlp.defects]
        costates = -np.einsum("ij,kia->kja", scheme.rate, mu) / scheme.weights[:, None] / scaling.x
        grid = _grid(result, arc, self._widths)
        pressures, jumps = adjoin_directly(
            self.task.limits, self.ties, nlp, answer, (states, controls, costates), grid, parameters
        )
        price = sum(_price(n, controls, grid.widths * result.sum()) for n in self.division.near)
        return ArcMotion(
            done, answer, grid, arc, states, controls, costates, pressures, jumps, nlp.free, parameters, setup,
            price,
        )  # fmt: skip

    def sides(self) -> tuple[Array, Array, Array, Array]:
        """Return the bounds with controls pinned, and without the limits that conditions hold already, or any."""
        nlp, problem, limits, limited = self.nlp, self.task.problem, self.task.limits, self.limited
        low, high, rows_low, rows_high = bounds(nlp)
        layout = nlp.layout
        lower, upper = (side / nlp.scaling.u for side in problem.limits(Where.ALONG, problem.system.u))
        low[layout.horizon], high[layout.horizon] = 0.0 if limited else -np.inf, np.inf
        rows_low[nlp.total], rows_high[nlp.total] = _totals(problem)
        for tie, rows in zip(self.ties, nlp.conditions, strict=True):
            rows_low[rows] = rows_high[rows] = tie.value(limits) / tie.condition.size
        numbers = {part: place for place, part in enumerate(nlp.path_parts)}
        known = np.append(layout.state[0, 0], layout.state[-1, -1])  # conditions at the ends of the motion stay
        for limit in () if limited else limits:
            if limit.state >= 0:
                chosen = np.setdiff1d(layout.state[:, :, limit.state], known)
                low[chosen], high[chosen] = -np.inf, np.inf
            else:
                chosen = nlp.path[numbers[limit.constraint, limit.component]]
                rows_low[chosen], rows_high[chosen] = -np.inf, np.inf
        if not limited:
            low[layout.control], high[layout.control] = -np.inf, np.inf
        for k, a in enumerate(self.arcs):
            own = np.flatnonzero(self.division.arc == k)
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
                else:
                    rows = nlp.path[numbers[limit.constraint, limit.component]]
                    # A row at the start of an arc is the last one of the element before.
                    before = rows[own[0] - 1, -1:] if limit.order and own[0] > 0 else rows[:0, 0]
                    chosen = np.append(rows[own] if along else rows[:0], before)
                    rows_low[chosen], rows_high[chosen] = -np.inf, np.inf
        return low, high, rows_low, rows_high


def pose_arcs(
    task: ArcProblem, arcs: tuple[Arc, ...], elements: tuple[int, ...], guess: Guess, weight: float = 0.0
) -> ArcProgramme:
    """Transcribe a problem for a given structure, without a solver; arguments as for `prepare_arcs`."""
    arc, durations = np.repeat(np.arange(len(arcs)), elements), np.array([a.duration for a in arcs])
    grid = _grid(durations, arc, 1.0 / np.repeat(elements, elements))
    freed = _freed(task.problem)
    scaling = from_limits(freed, guess, task.numbers, free_parameters(freed))
    ties = _ties(task, arcs, arc, guess.duration)
    near = _near(task, arcs, arc, guess, grid, weight)
    division = Division(arc, tuple(tie.condition for tie in ties), bool(np.isfinite(_totals(task.problem)).any()), near)
    nlp = transcribe(freed, task.scheme, grid, scaling, division)
    return ArcProgramme(task, arcs, elements, nlp, division, ties, True, None, None, 0.0)


def prepare_arcs(
    task: ArcProblem, arcs: tuple[Arc, ...], elements: tuple[int, ...], guess: Guess, settings: Ipopt,
    weight: float = 0.0, limited: bool = True,
) -> ArcProgramme:  # fmt: skip
    """Transcribe a problem for a given structure and build its solver.

    Args:
        task: the problem.
        arcs: the structure, with guessed durations.
        elements: number of elements of each arc.
        guess: of the motion; sets the scaling.
        settings: of IPOPT.
        weight: [cost/s] of the distance of undetermined controls from those of the guess.
        limited: whether limits that the structure does not meet, and durations >= 0, are part of the NLP.
    """
    begun = time.perf_counter()
    whole = pose_arcs(task, arcs, elements, guess, weight)
    whole = whole if limited else whole.unlimited()
    nlp = whole.nlp
    sizes = nlp.scaling.cost, nlp.sizes
    solver = None if whole.equations else build(nlp.expressions, nlp.derivatives, settings, False, sizes)
    return replace(whole, solver=solver, setup=time.perf_counter() - begun)


def _freed(problem: Problem) -> Problem:
    """Return a problem whose durations are unknowns, whatever is asked of their sum."""
    return (
        problem if isinstance(problem.horizon, Free) else replace(problem, horizon=Free(guess=problem.horizon.duration))
    )


def _totals(problem: Problem) -> tuple[float, float]:
    """Return the limits of the sum of all durations [s]."""
    horizon = problem.horizon
    if isinstance(horizon, Free):
        return (horizon.lower if horizon.lower > 0.0 else -np.inf), horizon.upper
    return horizon.duration, horizon.duration


def _simultaneous(arcs: tuple[Arc, ...]) -> int:
    """Return how many switches happen at the same time as another one."""
    pairs = pairwise(arcs)
    changes = [sum(a is not b for a, b in zip(one.kinds, other.kinds, strict=True)) for one, other in pairs]
    return sum(max(count - 1, 0) for count in changes)


def _near(
    task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, guess: Guess, grid: Grid, weight: float
) -> tuple[Near, ...]:
    """Return the prices that keep undetermined controls near those of the guess."""
    low, high = task.problem.limits(Where.ALONG, task.problem.system.u)
    results = []
    for k, a in enumerate(arcs if weight > 0.0 else ()):
        chosen = np.array([i for i in sorted(task.singular) if a.kinds[i] is Kind.INTERIOR], dtype=int)
        if len(chosen) == 0:
            continue
        own = np.flatnonzero(arc == k)
        share = grid.ends[own][:, None] + grid.widths[own][:, None] * task.scheme.points
        reference = guess.control(share)[:, :, chosen]
        used = np.maximum(np.ptp(guess.u, axis=0), np.max(np.abs(guess.u), axis=0))
        size = np.where(np.isfinite(high - low), high - low, np.where(used > 0.0, used, 1.0))[chosen]
        results.append(Near(chosen, reference, size, weight, own, task.scheme.weights))
    return tuple(results)


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


def _ties(task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, seconds: float) -> tuple[Tie, ...]:
    """Return the conditions of held and touched limits."""
    system = task.problem.system
    _, _, (start_known, _) = ends(task.problem, ca.DM(list(task.numbers)))
    ties: list[Tie] = []

    def tie(k: int, contact: Contact, orders: range, along: bool) -> Tie:
        limit, own = task.limits[contact.limit], np.flatnonzero(arc == k)
        gradients = [ca.densify(ca.jacobian(c, system.x)) for c in limit.chain[:-1]]
        function = ca.Function("gradients", [system.x, system.u, system.p], gradients)
        size = limit.range / seconds ** np.array(orders)
        expression = ca.vertcat(*(limit.chain[order] for order in orders))
        places = (own, tuple(task.scheme.points)) if along else (own[:1], (0.0,))
        return Tie(Condition(expression, size, *places), k, contact, along, function)

    for k, a in enumerate(arcs):
        before = {(c.limit, c.side) for c in arcs[k - 1].held} if k else set()
        for contact in a.held:
            order = task.limits[contact.limit].order
            ties.append(tie(k, contact, range(order, order + 1), True))
            if order and (contact.limit, contact.side) not in before and not (k == 0 and start_known):
                ties.append(tie(k, contact, range(order), False))
        ties += [tie(k, contact, range(min(task.limits[contact.limit].order, 2)), False) for contact in a.touched]
    return tuple(ties)
