"""A prepared NLP with its solver: built once, solved for many parameter values, limits and initial guesses."""

from __future__ import annotations

import time
from collections.abc import Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics import compilation
from ocp.numerics.compilation import Compilation
from ocp.numerics.thread_cache import ThreadCache
from ocp.problem.problem import Fixed, Problem, same_structure
from ocp.problem.sequence import Sequence, parameter_values, phases_of
from ocp.problem.singularities import singular_ends
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status, Timings
from ocp.solving.argument_checks import check_attempt, check_multipliers, check_settings
from ocp.solving.diagnosis import explain, in_words, remarks
from ocp.solving.first_guesses import phase_guesses, smooth
from ocp.solving.guess_conversion import KINDS, AnySolution, GuessLike, as_guesses, is_fresh, is_ladder
from ocp.solving.guess_ladder import DEFAULT, climb
from ocp.solving.ipopt import Ipopt
from ocp.solving.nlp_solver import NlpResult, NlpSettings, PhysicalSolver, Start, physical_solver
from ocp.solving.phase_solutions import solutions_of
from ocp.solving.prechecks import contradictions, not_finite, standstill
from ocp.solving.warm_start import multipliers as carried_multipliers
from ocp.transcription import structure
from ocp.transcription.direct_collocation import free_parameters
from ocp.transcription.grid import Grid, uniform
from ocp.transcription.guess import Guess
from ocp.transcription.joining import JoinedNlp, join
from ocp.transcription.nlp import bounds
from ocp.transcription.packing import pack
from ocp.transcription.scaling import common, expression_scales, from_limits, table, unscaled
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Scheme
from ocp.transcription.structure import transcribed

KEPT = ThreadCache(8)  # solvers by the structure of their NLP
ROUNDING = 1e-13  # no solver reaches a smaller tolerance in double precision


@dataclass(frozen=True, eq=False)
class Prepared:
    """An NLP with its solver, to be solved for many parameter values, limits, ends and guesses."""

    problem: Problem | Sequence
    joined: JoinedNlp
    settings: NlpSettings
    setup: float  # seconds spent so far
    first: tuple[object, object, list[Guess]] | None  # problem, parameter values and the smooth guess for them
    cold: PhysicalSolver  # for rough initial guesses

    def __call__(
        self,
        guess: GuessLike | Several[Any] | None = None,
        values: Mapping[str, float] | None = None,
        problem: Problem | Sequence | None = None,
        grid: Grid | None = None,
    ) -> AnySolution:
        """Solve.

        Args:
            guess: a Guess, a solution or its file, or a ladder of rungs (`ocp.solving.guess_ladder`); None for the
                default ladder.
            values: of parameters, by name; nominal where silent.
            problem: one that differs in limits, start and end values or the guess of the duration only.
            grid: of as many elements.

        Raises:
            ValueError: a problem or grid of another structure, or a wrong parameter name.
        """
        here = self.adapted(problem, grid)
        numbers = parameter_values(here.problem, values)
        if guess is None or is_ladder(guess):
            return climb(here, DEFAULT if guess is None else tuple(guess), values)  # type: ignore[arg-type]
        return here.attempt(as_guesses(here.problem, guess), numbers, warm=not is_fresh(guess))

    def proceed(self, solution: Solution, values: Mapping[str, float] | None = None) -> AnySolution:
        """Solve from a solution of the same problem on another grid or with another scheme, multipliers included.

        Args:
            solution: near the one looked for.
            values: of parameters, by name; nominal where silent.
        """
        checks.instance("solution", solution, Solution, "a Solution")
        first = carried_multipliers(self.joined.nlps[0], solution)
        guesses = as_guesses(self.problem, solution)
        return self.attempt(guesses, self.numbers(values), True, "continuation", multipliers=first)

    def scales(self) -> str:
        """Return the scales of the unknowns in physical units as a table."""
        parts = [table(nlp.scaling, nlp.problem) for nlp in self.joined.nlps]
        return "\n\n".join(parts)

    def numbers(self, values: Mapping[str, float] | None) -> list[list[float]]:
        """Return the parameter values of every phase, nominal where `values` is silent."""
        return parameter_values(self.problem, values)

    @property
    def grid(self) -> Grid:
        """The grid, the same for every phase."""
        return self.joined.nlps[0].grid

    @property
    def compilations(self) -> tuple[Compilation, ...]:
        """What came of compiling the functions of every phase; empty if not asked for."""
        return tuple(made for nlp in self.joined.nlps if (made := nlp.compilation) is not None)

    def on(
        self, problem: Problem | Sequence, grid: Grid, settings: NlpSettings, values: Mapping[str, float] | None
    ) -> Prepared:
        """Return another problem prepared on another grid, with the same scheme."""
        check_settings(problem, self.joined.nlps[0].scheme, grid, settings)
        return prepare(problem, self.joined.nlps[0].scheme, grid, settings, values=values)

    def adapted(self, problem: Problem | Sequence | None, grid: Grid | None) -> Prepared:
        """Return this NLP for other numbers in the problem, or another grid of the same size."""
        nlps = self.joined.nlps
        if problem is not None:
            old, new = phases_of(self.problem), phases_of(problem)
            if len(new) != len(old):
                raise ValueError(f"problem: has {len(new)} phases, the prepared one {len(old)}; prepare it anew")
            same = map(same_structure, old, new)
            nlps = tuple(replace(p, problem=one) for p, one in zip(nlps, same, strict=True))
        if grid is not None:
            checks.instance("grid", grid, Grid, "a Grid such as uniform(50)")
            known = len(nlps[0].grid)  # that of all phases
            if len(grid) != known:
                raise ValueError(f"grid: has {len(grid)} elements, the NLP was prepared for {known}")
            nlps = tuple(replace(p, grid=grid) for p in nlps)
        return replace(self, problem=problem or self.problem, joined=replace(self.joined, nlps=nlps))

    def attempt(
        self,
        guesses: list[Guess],
        values: list[list[float]],
        warm: bool = False,
        rung: str = "given guess",
        spent: float = 0.0,
        multipliers: tuple[Array, Array] | None = None,
    ) -> AnySolution:
        """Solve once from one guess for each phase.

        Args:
            guesses: one for each phase.
            values: of the parameters of each phase.
            warm: whether the guesses are near a solution and may touch its bounds.
            rung: name of the guess in the solution.
            spent: seconds that making the guess took; they count as set-up.
            multipliers: of the bounds (nz,) and of the rows (ng,) to start from.
        """
        begun = time.perf_counter() - checks.number("spent", spent, "a number of seconds >= 0", at_least=0.0)
        nlps = self.joined.nlps
        check_attempt(self.problem, guesses, values, warm, rung)
        check_multipliers(multipliers, (sum(p.layout.size for p in nlps), len(self.joined.scaled.rows)))
        z0 = np.concatenate([pack(p, g, v) for p, g, v in zip(nlps, guesses, values, strict=True)])
        result, reasons = self._without_solver(guesses, values, z0)
        if result is not None:
            return self._solution(result, values, rung, time.perf_counter() - begun, reasons)
        start = (Start.WARM if warm else Start.COLD) if multipliers is None else Start.MULTIPLIERS
        solver = self.cold if start is Start.COLD else self._solver(start)
        low, high, rows_low, rows_high = self._bounds()
        s, z0 = self._nlp_parameters(values), np.clip(z0, low, high)
        setup = time.perf_counter() - begun
        result = solver(z0, s, (low, high, rows_low, rows_high), multipliers)
        return self._solution(result, values, rung, setup, [])

    def _solver(self, start: Start) -> PhysicalSolver:
        return _solver_of(self.joined, self.settings, start)

    def _bounds(self) -> tuple[Array, Array, Array, Array]:
        """Return lower and upper bounds of the unknowns and of the rows of all phases; rows that tie them are zero."""
        every = [bounds(nlp) for nlp in self.joined.nlps]
        tied = np.zeros(self.joined.links)
        low, high = (np.concatenate([b[i] for b in every]) for i in (0, 1))
        rows_low, rows_high = (np.concatenate([*(b[i] for b in every), tied]) for i in (2, 3))
        return low, high, rows_low, rows_high

    def _nlp_parameters(self, values: list[list[float]]) -> Array:
        """Return s: for each phase the parameter values, a fixed duration and the widths of the elements."""
        parts: list[Array] = []
        for nlp, numbers in zip(self.joined.nlps, values, strict=True):
            fixed = [nlp.problem.horizon.duration] if isinstance(nlp.problem.horizon, Fixed) else []
            parts += [np.array(numbers), np.array(fixed), nlp.grid.widths]
        return np.concatenate(parts)

    def _without_solver(
        self, guesses: list[Guess], values: list[list[float]], z0: Array
    ) -> tuple[NlpResult | None, list[str]]:
        """Return a result that needs no solver, and reasons: contradictions, a singular start, no motion at all."""
        refused = [*contradictions(self.problem, values)]
        wrong = refused or [*singular_ends(phases_of(self.problem), values)]
        wrong = wrong or [*not_finite(self.problem, guesses, values)]
        if wrong:
            return self._not_started(z0, np.nan, Status.INFEASIBLE if refused else Status.FAILED), wrong
        still = standstill(self.problem, values[0], guesses[0]) if isinstance(self.problem, Problem) else None
        if still is not None:
            z0 = pack(self.joined.nlps[0], still[0], values[0])
            return self._not_started(z0, still[1], Status.SOLVED), []
        return None, []

    def _not_started(self, z0: Array, cost: float, status: Status) -> NlpResult:
        rows = np.zeros(len(self.joined.scaled.rows))
        return NlpResult(z0, rows, np.zeros(len(z0)), cost, status, "not started", 0, 0.0, 0.0, {})

    def _solution(
        self, result: NlpResult, values: list[list[float]], rung: str, setup: float, reasons: list[str]
    ) -> AnySolution:
        nlps = self.joined.nlps
        spent = max(result.seconds - result.derivatives, 0.0)
        timings = Timings(self.setup + setup, result.derivatives, spent, self.setup + setup + result.seconds)
        solutions = solutions_of(result, nlps, values, timings, rung)
        status = solutions[0].status
        solved = status is Status.SOLVED
        if solved and isinstance(self.problem, Problem):
            return replace(solutions[0], message=lambda: in_words(status, remarks(solutions)))  # type: ignore[arg-type]
        reasons = reasons or (remarks(solutions) if solved else explain(solutions, values))
        if not solved and self.settings.tol < ROUNDING:
            reasons = [*reasons, f"a tolerance of {self.settings.tol:g} is below rounding; try {ROUNDING:g}"]
        message = in_words(status, reasons)
        if isinstance(self.problem, Problem):
            return replace(solutions[0], message=message)
        return SequenceSolution(
            tuple(solutions), status, message, result.verbatim, result.cost, timings, result.iterations, self.problem
        )


def prepare(
    problem: Problem | Sequence,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: NlpSettings | None = None,
    guess: GuessLike | Several[Any] | None = None,
    values: Mapping[str, float] | None = None,
    compiled: bool = False,
) -> Prepared:
    """Transcribe a problem and build its solver once, for many solves.

    Args:
        problem: a Problem, or a Sequence of them (each phase gets the same scheme and grid).
        scheme: default radau(3), constant controls.
        grid: default uniform(50).
        solver: settings.
        guess: from which the scales are taken; None for a smooth motion between the ends.
        values: of parameters, for the scaling.
        compiled: let the functions of an element be machine code (see `ocp.numerics.compilation`): for many solves.

    Raises:
        TypeError: an argument of the wrong kind.
    """
    begun = time.perf_counter()
    scheme = radau(3) if scheme is None else scheme
    grid = uniform(50) if grid is None else grid
    solver = Ipopt() if solver is None else solver
    check_settings(problem, scheme, grid, solver, compiled)
    made = None if guess is None or is_ladder(guess) else as_guesses(problem, guess)
    every = parameter_values(problem, values)
    given = made if isinstance(guess, KINDS) or is_fresh(guess) else None
    guesses = phase_guesses(problem, every, smooth) if given is None else given
    parts = list(zip(phases_of(problem), guesses, every, strict=True))
    scalings = common([
        from_limits(phase, first, numbers, free_parameters(phase))
        if solver.scaled else unscaled(phase, len(free_parameters(phase)))
        for phase, first, numbers in parts
    ])  # fmt: skip
    translate = compilation.compiled if compiled else None
    nlps = [transcribed(part[0], scheme, grid, own, translate) for part, own in zip(parts, scalings, strict=True)]
    sequence = problem if isinstance(problem, Sequence) else None
    links = [(before, *parts[i], scalings[i]) for i, _, before, _ in (sequence.junctions if sequence else ())]
    joined = join(tuple(nlps), sequence, [expression_scales(*link) for link in links])
    cold = _solver_of(joined, solver, Start.COLD)
    known = (problem, every, guesses) if given is None else None
    return Prepared(problem, joined, solver, time.perf_counter() - begun, known, cold)


def _solver_of(joined: JoinedNlp, settings: NlpSettings, start: Start) -> PhysicalSolver:
    """Return the solver of an NLP; that of IPOPT is kept for NLPs of the same structure with the same settings."""

    def make() -> PhysicalSolver:
        return physical_solver(joined.scaled, settings, start)

    kept_as, alone = joined.nlps[0].structure, joined.scaled is joined.nlps[0].scaled
    if not kept_as or not alone or type(settings) is not Ipopt:
        return make()
    return KEPT.get((kept_as, repr(settings), settings.shown, start), make)


def forget_structures() -> None:
    """Forget the graphs and solvers that this thread keeps for the next problem of the same structure."""
    KEPT.clear()
    structure.KEPT.clear()
