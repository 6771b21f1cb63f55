"""Solution of the problem of one case: with a neighbour's switching structure, from its motion, or cold."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ocp.arcs.carry_over import PreparedStructure, prepare_structure
from ocp.arcs.least_effort import gentlest
from ocp.arcs.polishing import polish
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.solution import Solution
from ocp.solution.storage import decode
from ocp.solving.guess_ladder import DEFAULT
from ocp.solving.guess_rungs import Rung, Smooth, StraightLine
from ocp.solving.ipopt import Ipopt
from ocp.solving.local_optima import multistart
from ocp.solving.prepared_nlp import Prepared, prepare
from ocp.studies.case_call import call
from ocp.studies.designs import Case
from ocp.studies.warm_start_rule import ALLOWED, limits_broken
from ocp.studies.warm_start_tree import between
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

SHORT_LADDER = (Smooth(), StraightLine())  # initial guesses for a case that is solved for the first time
BETTER = 1e-6  # share of the cost by which a cold start must be lower to replace a warm one
SHORTEST = 1.0 / 16.0  # step of the continuation between two cases, as a share of their distance
LIGHTER = (0.5, 0.25)  # shares of the values of parameters from which a continuation begins
KEPT = 8  # arc NLPs cached in one process


@dataclass(frozen=True, eq=False)
class StudySettings:
    """Everything that the cases of a study have in common; sent to a worker process together with each case.

    Args:
        identity: hash of function and settings.
        function: of a case, returns a Problem, a Sequence, a Solution or numbers; or a Problem itself.
        first: case for which the NLP is prepared. Always the same one, so that results do not depend on which case
            comes first in a process.
        measure: of a solution, returns name -> number.
        scheme, grid, solver: as for `ocp.solve`.
        polished, neighbours, checked, slopes, compiled, verified, gentle, starts: as for `ocp.Study`.
    """

    identity: str
    function: Any
    first: Case
    measure: Callable[[Solution], Mapping[str, float]]
    scheme: Scheme | None
    grid: Grid | None
    solver: Ipopt
    polished: bool
    neighbours: bool
    checked: float
    slopes: bool
    compiled: bool
    verified: bool = False
    gentle: bool = False
    starts: int = 1


@dataclass(frozen=True, eq=False)
class SolvedCase:
    """A stored case whose solution is the initial guess of another one.

    Args:
        id: identity of the case.
        case: name -> value.
        content: of its solution file.
    """

    id: str
    case: Case
    content: bytes


@dataclass(frozen=True, eq=False)
class OpenCase:
    """A case to be computed.

    Args:
        id: identity of the case.
        case: name -> value.
        neighbour: solved case that is the initial guess, or None.
        structure: case whose switching structure the neighbour has, or None.
        attempts: how often the case has been tried, this time included.
        thorough: whether continuation from the neighbour and the whole ladder of initial guesses are tried.
        compare: whether only the neighbour is the initial guess, to see whether it leads to a better optimum.
    """

    id: str
    case: Case
    neighbour: SolvedCase | None = None
    structure: SolvedCase | None = None
    attempts: int = 1
    thorough: bool = False
    compare: bool = False


@dataclass(frozen=True, eq=False)
class Solved:
    """The solution of a case and how it was computed: a Solution, or a SequenceSolution for a sequence of phases."""

    solution: Any
    way: str
    structure: str | None = None
    note: str = ""


class CaseSolver:
    """Solves the cases of one study in one process, with the NLP and the arc NLPs cached.

    Args:
        settings: of the study.
    """

    def __init__(self, settings: StudySettings) -> None:
        self.settings = settings
        self._prepared: Prepared | None = None
        self._structures: OrderedDict[str, PreparedStructure] = OrderedDict()

    def solve(self, task: OpenCase, problem: Problem | Sequence, values: dict[str, float]) -> Solved:
        """Solve the problem of a case.

        Args:
            task: the case.
            problem: of the case.
            values: of the parameters of the problem.
        """
        prepared = self._nlp(problem, values)
        ladder = DEFAULT if task.thorough else SHORT_LADDER
        if isinstance(problem, Sequence):
            return Solved(self._cold(prepared, ladder, values), "cold")
        result, note = self._from_neighbour(task, problem, prepared, values)
        if task.compare:
            if result is None:
                raise ValueError(f"not solved from its neighbour: {note}")
            return replace(result, note=note)
        if result is None and task.thorough and task.neighbour is not None:
            near = task.neighbour
            continued = self._continued(task.case, near.case, lambda own: decode(near.content, own, near.id))
            result = self._polished(task, continued, "continued") if continued is not None else None
        if result is None:
            cold = self._cold(prepared, ladder, values)
            if task.thorough and not cold.ok and (continued := self._from_lighter(task.case, problem, values)):
                return replace(self._polished(task, continued, "continued"), note=note)
            return replace(self._polished(task, cold, "cold"), note=note)
        if not self.settings.neighbours or not is_checked(task.id, self.settings.checked) or result.way == "cold":
            return replace(result, note=note)
        return replace(self._better(task, result, self._cold(prepared, ladder, values)), note=note)

    def _cold(self, prepared: Prepared, ladder: tuple[Rung, ...], values: dict[str, float]) -> Any:
        """Return the solution without a neighbour: from the ladder of guesses, or the best of several starts."""
        first, given = prepared(ladder, values), self.settings
        if given.starts == 1:
            return first
        optima = multistart(
            prepared.problem, given.starts, scheme=given.scheme, grid=given.grid, solver=given.solver, values=values,
            first=first,
        )  # fmt: skip
        return optima[0].solution if optima else first

    def _from_neighbour(
        self, task: OpenCase, problem: Problem, prepared: Prepared, values: dict[str, float]
    ) -> tuple[Solved | None, str]:
        """Return the solution that starts from the neighbour, None if there is none, and a note for the message."""
        if task.neighbour is None or not self.settings.neighbours:
            return None, ""
        near, note = decode(task.neighbour.content, problem, task.neighbour.id), ""
        if task.structure is not None and self.settings.polished and near.structure is not None:
            carried = self._arc_nlp(task.structure)(values, problem, near)
            if carried.ok and carried.structure is not None:
                return Solved(carried, "carried", task.structure.id), ""
            note = f"structure not carried over: {carried.message}"
        ladder = DEFAULT if task.thorough else SHORT_LADDER
        if not task.compare and limits_broken(near, problem, values) > ALLOWED:
            cold = self._cold(prepared, ladder, values)
            if cold.ok:
                return self._polished(task, cold, "cold"), note
        warm = prepared.proceed(near, values)
        if warm.ok:
            return self._polished(task, warm, "warm"), note
        return None, f"{note}; warm start: {warm.message}".removeprefix("; ")

    def _from_lighter(self, case: Case, problem: Problem, values: Mapping[str, float]) -> Solution | None:
        """Return the solution of a case by continuation from other values of its parameters, None if that fails.

        These are the nominal values, then shares of the values: smaller loads, masses and frictions are easier.
        """
        nominal = problem.system.nominal
        parameters = [name for name in values if name in nominal and name in case]
        starts = [{name: float(nominal[name]) for name in parameters}]
        starts += [{name: share * values[name] for name in parameters} for share in LIGHTER]
        for chosen in starts:
            first = {**case, **chosen}
            if first == dict(case):
                continue
            start, at = call(self.settings.function, first)
            solved = self._nlp(start, at)(DEFAULT, at)
            if isinstance(solved, Solution) and solved.ok:
                return self._continued(case, first, lambda _, solved=solved: solved)  # type: ignore[misc]
        return None

    def _continued(self, case: Case, first: Case, found: Callable[[Problem], Solution]) -> Solution | None:
        """Return the solution of a case at the end of a path of cases, each started from the last one.

        The path is straight in the values of the cases; a step that fails is halved. None if it becomes too short.

        Args:
            case: at the end of the path.
            first: solved case at its beginning.
            found: of the problem of the first step; returns the solution of the first case.
        """
        solution: Solution | None = None
        done, step = 0.0, 0.5  # the whole step has failed before
        while done < 1.0:
            share = min(1.0, done + step)
            problem, values = call(self.settings.function, between(first, case, share))
            if not isinstance(problem, Problem):
                return None
            near = solution if solution is not None else found(problem)
            tried = self._nlp(problem, values).proceed(near, values)
            if isinstance(tried, Solution) and tried.ok:
                solution, done = tried, share
            elif step <= SHORTEST:
                return None
            else:
                step /= 2.0
        return solution

    def _better(self, task: OpenCase, result: Solved, cold: Solution) -> Solved:
        """Return the better one of the solution from a neighbour and the one from a cold start, and say which."""
        allowed = BETTER * abs(result.solution.cost)
        if not cold.ok or cold.cost >= result.solution.cost - allowed:
            return replace(result, way=f"{result.way}, checked")
        fair = self._polished(task, cold, "cold")  # so that both are polished, or none
        if fair.solution.cost >= result.solution.cost - allowed:
            return replace(result, way=f"{result.way}, checked")
        return replace(fair, way=f"cold, better than {result.way}")

    def _polished(self, task: OpenCase, solution: Solution, way: str) -> Solved:
        if not solution.ok:
            return Solved(solution, way)
        if self.settings.polished:
            solution = polish(solution)
            if solution.structure is not None:
                return Solved(solution, way, task.id)
            way = f"{way}, unpolished"
        return Solved(gentlest(solution) if self.settings.gentle else solution, way)

    def _nlp(self, problem: Problem | Sequence, values: dict[str, float]) -> Prepared:
        """Return the cached NLP with the limits and ends of a problem, or a new NLP if its equations differ."""
        given = self.settings
        if self._prepared is None:
            first, nominal = call(given.function, given.first)
            self._prepared = prepare(
                first, given.scheme, given.grid, given.solver, values=nominal, compiled=given.compiled
            )
        try:
            return self._prepared.adapted(problem, None)
        except ValueError:
            return prepare(problem, given.scheme, given.grid, given.solver, values=values)

    def _arc_nlp(self, origin: SolvedCase) -> PreparedStructure:
        """Return the arc NLP with the switching structure of a solved case, from the cache if it is there."""
        if origin.id not in self._structures:
            problem, _ = call(self.settings.function, origin.case)
            self._structures[origin.id] = prepare_structure(decode(origin.content, problem, origin.id))
            while len(self._structures) > KEPT:
                self._structures.popitem(last=False)
        self._structures.move_to_end(origin.id)
        return self._structures[origin.id]


def is_checked(identity: str, share: float) -> bool:
    """Return whether a case belongs to the share that is solved cold as well; the same cases in every run."""
    return int(identity[:8], 16) < share * 2**32
