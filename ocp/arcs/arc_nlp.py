"""The NLP of a switching structure: arc durations are unknowns, controls at bounds are fixed there."""

from __future__ import annotations

import contextlib
import io
import time
from dataclasses import dataclass, replace

import numpy as np

from ocp.arcs.arc_bounds import draw_in, open_ends_of, totals, with_free_horizon
from ocp.arcs.arc_conditions import conditions_of
from ocp.arcs.arc_penalties import penalties_of, value_of
from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.arcs import durations
from ocp.arcs.junctions import Junction, junctions_of
from ocp.arcs.null_space_newton import Equations, as_equations
from ocp.arcs.optimality_check import Crossing
from ocp.arcs.simultaneous_switches import chosen_multipliers, simultaneous
from ocp.arcs.state_limit_multipliers import LimitCondition, adjoin_directly, pressed_elements
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc, Kind
from ocp.solving.ipopt import Ipopt
from ocp.solving.nlp_solver import NlpResult, PhysicalSolver, physical_solver
from ocp.transcription.arc_layout import ArcLayout, Condition
from ocp.transcription.direct_collocation import free_parameters, transcribe
from ocp.transcription.grid import Grid
from ocp.transcription.guess import Guess
from ocp.transcription.nlp import Nlp, bounds
from ocp.transcription.packing import pack
from ocp.transcription.scaling import from_limits

SHORT, TINY = 1e-3, 2e-7  # duration of an arc, share of the motion, below which it may shrink, and how far
FLAT = {"accept_every_trial_step": "yes"}  # where the cost is flat in times of junctions, a line search refuses them
LEAST = 1e-9  # least width of an arc on the grid, share of the motion, as a grid must increase


@dataclass(frozen=True, eq=False)
class ArcNlp:
    """The NLP of a problem for a given switching structure, with its solver; made by `prepare_arcs`.

    Args:
        task: the problem.
        arcs: the structure.
        shares: (N,) width of each element, share of the duration of its arc.
        nlp: with one duration for each arc.
        owner: (N,) index of the arc of each element.
        arc_layout: durations of arcs, or of elements that are tied together.
        conditions: equations of state limits that are active.
        junctions: equations of controls that do not jump between two arcs.
        limited: whether inactive limits, and durations >= 0, are constraints of the NLP.
        spread: least and largest duration of an arc, shares of the guessed one.
        open_ends: singular controls at the ends of elements on which they are free.
        drawn_in: intervals in which state limits are tighter, by a share of their range.
        solver: IPOPT on the NLP; None if `equations` are solved instead.
        equations: the NLP without inequalities, for Newton's iteration; None if it has too many unknowns.
        setup: seconds spent on preparing.
    """

    task: ArcProblem
    arcs: tuple[Arc, ...]
    shares: Array
    nlp: Nlp
    owner: Array
    arc_layout: ArcLayout
    conditions: tuple[LimitCondition, ...]
    junctions: tuple[Junction, ...]
    limited: bool
    solver: PhysicalSolver | None
    equations: Equations | None
    setup: float
    spread: tuple[float, float] = (0.0, np.inf)
    open_ends: tuple[tuple[int, Condition], ...] = ()
    drawn_in: tuple[Crossing, ...] = ()

    def adapted(self, problem: Problem, numbers: tuple[float, ...]) -> ArcNlp:
        """Return the same NLP for other parameter values and a problem that differs in numbers only."""
        nlp = replace(self.nlp, problem=with_free_horizon(problem))
        return replace(self, task=self.task.adapted(problem, numbers), nlp=nlp)

    def start(self, guess: Guess, seconds: Array) -> Array:
        """Return the unknowns (nz,) of a guess of the motion and of the durations (A,) of its arcs [s]."""
        grid = _grid(seconds, self.owner, self.shares)
        z0 = pack(replace(self.nlp, grid=grid), guess, list(self.task.numbers))
        z0[self.nlp.layout.horizon] = self._of_unknowns(seconds) / self.nlp.scaling.horizon
        return z0

    def restart(self, solution: Solution) -> Array:
        """Return the unknowns (nz,) of a solution with the same structure and as many elements."""
        layout, scaling, z0 = self.nlp.layout, self.nlp.scaling, np.zeros(self.nlp.layout.size)
        assert solution.structure is not None
        z0[layout.state], z0[layout.control] = solution.states / scaling.x, solution.controls / scaling.u
        z0[layout.horizon] = self._of_unknowns(durations(solution.structure.arcs)) / scaling.horizon
        z0[layout.free] = np.array(list(solution.free.values())) / scaling.free
        return z0

    def _of_unknowns(self, seconds: Array) -> Array:
        """Return the durations that are unknowns, of arcs or of elements, from those of the arcs (A,)."""
        return seconds[self.owner] * self.shares if self.tied else seconds

    @property
    def tied(self) -> bool:
        """Whether the widths of the elements are the unknowns, tied together within arcs."""
        return self.arc_layout.ties is not None

    @property
    def _widths(self) -> Array:
        """(N,) widths of the elements as shares of the durations that are unknowns."""
        return np.ones(len(self.shares)) if self.tied else self.shares

    def unlimited(self) -> ArcNlp:
        """Return the NLP without inactive limits and without durations >= 0.

        It then often has as many equations as unknowns, and Newton's iteration solves it in a few steps.
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
        if np.sum(rows_low == rows_high) - np.sum(low < high) > 2 * simultaneous(self.arcs):
            # More equations than unknowns, and no simultaneous switches that could make some equations dependent.
            nothing, reason = np.zeros(len(rows_low)), "fewer unknowns than conditions"
            result = NlpResult(z0, nothing, np.zeros(len(z0)), np.nan, Status.INFEASIBLE, reason, 0, 0.0, 0.0, {})
        elif self.equations is not None:
            result = self.equations.solve(np.clip(z0, low, high), np.append(self.task.numbers, self._widths), sides)
        else:
            assert self.solver is not None
            numbers = np.append(self.task.numbers, self._widths)
            # CasADi prints that there are more equations than unknowns; here some follow from others.
            more = np.sum(rows_low == rows_high) > np.sum(low < high)
            with contextlib.redirect_stderr(io.StringIO()) if more else contextlib.nullcontext():
                result = self.solver(np.clip(z0, low, high), numbers, sides)
            point = result.z, numbers, result.multipliers
            chosen = (
                chosen_multipliers(self.task, self.nlp, self.arcs, self.owner, point, sides)
                if result.status is Status.SOLVED else None
            )  # fmt: skip
            result = result if chosen is None else replace(result, multipliers=chosen)
        return self._motion(result, self.setup + time.perf_counter() - begun - result.seconds)

    def _motion(self, results: NlpResult, setup: float) -> ArcMotion:
        nlp, layout, scaling, arc = self.nlp, self.nlp.layout, self.nlp.scaling, self.owner
        result = results.z[layout.horizon] * scaling.horizon
        result = np.maximum(np.bincount(self.owner, result) if self.tied else result, 0.0)
        done = tuple(replace(a, duration=float(t)) for a, t in zip(self.arcs, result, strict=True))
        states, controls = results.z[layout.state] * scaling.x, results.z[layout.control] * scaling.u
        parameters = np.array(self.task.numbers)
        parameters[nlp.free] = results.z[layout.free] * scaling.free
        scheme, multipliers = self.task.scheme, results.multipliers[nlp.defects]
        costates = -np.einsum("ij,kia->kja", scheme.rate, multipliers) / scheme.weights[:, None] / scaling.x
        grid = _grid(result, arc, self.shares)
        limit_multipliers, jumps = adjoin_directly(
            self.task.limits, self.conditions, nlp, results, (states, controls, costates), grid, parameters
        )
        penalty = sum(value_of(p, controls, grid.widths * result.sum()) for p in self.arc_layout.penalties)
        return ArcMotion(
            done, results, grid, arc, states, controls, costates, limit_multipliers, jumps, nlp.free, parameters, setup,
            penalty, pressed_elements(self.task.limits, nlp, results),
        )  # fmt: skip

    def sides(self) -> tuple[Array, Array, Array, Array]:
        """Return the bounds: controls fixed on arcs at a bound, no bound where a condition says the same already."""
        nlp, problem, limits, limited = self.nlp, self.task.problem, self.task.limits, self.limited
        low, high, rows_low, rows_high = bounds(nlp)
        layout = nlp.layout
        lower, upper = (side / nlp.scaling.u for side in problem.limits(Where.ALONG, problem.system.u))
        guessed = self._of_unknowns(np.maximum(durations(self.arcs), 0.0)) / nlp.scaling.horizon
        low[layout.horizon], high[layout.horizon] = 0.0 if limited else -np.inf, np.inf
        if limited and np.isfinite(self.spread[1]):
            low[layout.horizon], high[layout.horizon] = np.outer(self.spread, guessed)
            seconds, ones = durations(self.arcs), np.ones(len(self.arcs))
            short = self._of_unknowns((seconds < SHORT * seconds.sum()).astype(float))
            low[layout.horizon] = np.where(
                short > 0.0, TINY * guessed.sum() * self._of_unknowns(ones), low[layout.horizon]
            )
        rows_low[nlp.total], rows_high[nlp.total] = totals(problem)
        for condition, rows in zip(self.conditions, nlp.conditions, strict=False):
            rows_low[rows] = rows_high[rows] = condition.value(limits) / condition.condition.scale
        others = nlp.conditions[len(self.conditions) :]
        for junction, rows in zip(self.junctions, others, strict=False):
            rows_low[rows] = rows_high[rows] = junction.value(problem, limits) / junction.condition.scale
        for (i, _), rows in zip(self.open_ends, others[len(self.junctions) :], strict=True):
            rows_low[rows], rows_high[rows] = lower[i], upper[i]
        path = {part: index for index, part in enumerate(nlp.path_parts)}
        known = np.append(layout.state[0, 0], layout.state[-1, -1])  # bounds at both ends of the motion stay
        for limit in () if limited else limits:
            if limit.state >= 0:
                chosen = np.setdiff1d(layout.state[:, :, limit.state], known)
                low[chosen], high[chosen] = -np.inf, np.inf
            else:
                chosen = nlp.path[path[limit.constraint, limit.component]]
                rows_low[chosen], rows_high[chosen] = -np.inf, np.inf
        for crossing in self.drawn_in if limited else ():
            ends = _grid(durations(self.arcs), self.owner, self.shares).ends * sum(durations(self.arcs))
            draw_in(limits[crossing.contact.limit], crossing, nlp, ends, (low, high, rows_low, rows_high))
        if not limited:
            low[layout.control], high[layout.control] = -np.inf, np.inf
        for k, a in enumerate(self.arcs):
            own = np.flatnonzero(self.owner == k)
            for i, kind in enumerate(a.kinds):
                if kind in (Kind.LOWER, Kind.UPPER):
                    pinned = layout.control[own, :, i]
                    low[pinned] = high[pinned] = lower[i] if kind is Kind.LOWER else upper[i]
            for contact in (*(c for c in a.held if c.control >= 0), *a.touched):
                limit = limits[contact.limit]
                along = contact in a.held
                if limit.state >= 0:
                    chosen = layout.state[own, :, limit.state] if along else layout.state[own[:1], :1, limit.state]
                    chosen = np.setdiff1d(chosen, known)
                    low[chosen], high[chosen] = -np.inf, np.inf
                else:
                    rows = nlp.path[path[limit.constraint, limit.component]]
                    # A row at the start of an arc is the last one of the element before.
                    before = rows[own[0] - 1, -1:] if limit.order and own[0] > 0 else rows[:0, 0]
                    chosen = np.append(rows[own] if along else rows[:0], before)
                    rows_low[chosen], rows_high[chosen] = -np.inf, np.inf
        return low, high, rows_low, rows_high


def transcribe_arcs(
    task: ArcProblem, arcs: tuple[Arc, ...], elements: tuple[int, ...], guess: Guess, weight: float = 0.0,
    effort: bool = False, limited: bool = False, shares: Array | None = None, tied: bool = False,
) -> ArcNlp:  # fmt: skip
    """Return the NLP of a problem for a given structure, without a solver; arguments as for `prepare_arcs`."""
    arc, seconds = np.repeat(np.arange(len(arcs)), elements), durations(arcs)
    shares = 1.0 / np.repeat(elements, elements) if shares is None else shares
    grid = _grid(seconds, arc, shares)
    freed = with_free_horizon(task.problem)
    scaling = from_limits(freed, guess, task.numbers, free_parameters(freed))
    conditions = conditions_of(task, arcs, arc, guess.duration)
    junctions = junctions_of(task, arcs, arc, grid.ends, guess)
    penalties = penalties_of(task, arcs, arc, None if effort else guess, grid, weight)
    open_ends = open_ends_of(task, arcs, arc, scaling.u) if limited else ()
    rows = (*(a.condition for a in conditions), *(a.condition for a in junctions), *(one for _, one in open_ends))
    inner = np.flatnonzero(np.diff(arc) == 0)
    ties = (inner, shares[inner + 1] / shares[inner]) if tied else None
    total = bool(np.isfinite(totals(task.problem)).any())
    arc_layout = ArcLayout(np.arange(len(arc)) if tied else arc, rows, total, penalties, 0.0, ties)
    nlp = transcribe(freed, task.scheme, grid, scaling, arc_layout)
    own = (conditions, junctions, True, None, None, 0.0)
    return ArcNlp(task, arcs, shares, nlp, arc, arc_layout, *own, open_ends=open_ends)


def prepare_arcs(
    task: ArcProblem, arcs: tuple[Arc, ...], elements: tuple[int, ...], guess: Guess, settings: Ipopt,
    weight: float = 0.0, limited: bool = True, effort: bool = False, spread: tuple[float, float] = (0.0, np.inf),
    drawn_in: tuple[Crossing, ...] = (), shares: Array | None = None, tied: bool = False,
) -> ArcNlp:  # fmt: skip
    """Transcribe a problem for a given structure and build its solver.

    Args:
        task: the problem.
        arcs: the structure, with guessed durations.
        elements: number of elements of each arc.
        guess: of the motion; sets the scaling.
        settings: of IPOPT.
        weight: [cost/s] of the penalty that keeps singular controls near those of the guess.
        effort: whether the penalty keeps them near zero instead.
        limited: whether inactive limits, and durations >= 0, are constraints of the NLP.
        spread: least and largest duration of an arc, shares of the guessed one; arcs that vanish hamper the solver.
        drawn_in: intervals in which state limits are tighter.
        shares: (N,) width of each element, share of the duration of its arc; None for equal ones.
        tied: whether widths of elements are unknowns, tied together within arcs: sparser with many elements.
    """
    begun, clock = time.perf_counter(), time.process_time()
    whole = transcribe_arcs(task, arcs, elements, guess, weight, effort, limited, shares, tied)
    whole = whole if limited else whole.unlimited()
    if any(junction.flat for junction in whole.junctions):
        settings = replace(settings, extra={**FLAT, **settings.extra})
    if "max_cpu_time" in settings.extra:  # transcription is part of it
        left = settings.extra["max_cpu_time"] - time.process_time() + clock
        settings = replace(settings, extra={**settings.extra, "max_cpu_time": max(left, 0.01)})
    solver = None if whole.equations else physical_solver(whole.nlp.scaled, settings)
    return replace(whole, solver=solver, setup=time.perf_counter() - begun, spread=spread, drawn_in=drawn_in)


def _grid(durations: Array, arc: Array, widths: Array) -> Grid:
    """Return the grid of the whole motion; an arc of no duration keeps the width LEAST."""
    seconds = np.append(0.0, np.cumsum(np.maximum(durations, LEAST * durations.sum())[arc] * widths))
    share = seconds / seconds[-1]
    share[-1] = 1.0
    return Grid(share)
