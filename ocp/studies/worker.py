"""The work of a study on one case, in whatever process: state the problem, solve it on the shortest way, measure."""

from __future__ import annotations

import functools
import inspect
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ocp import checks
from ocp.arcs.carry_over import PreparedStructure, prepare_structure
from ocp.arcs.polishing import polish
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.storage import decode, encode
from ocp.solving.guess_ladder import DEFAULT, Smooth, StraightLine
from ocp.solving.ipopt import Ipopt
from ocp.solving.prepared_nlp import Prepared, prepare
from ocp.studies.case_record import Record
from ocp.studies.case_slopes import tangents
from ocp.studies.content_hash import canonical
from ocp.studies.default_measures import named_numbers
from ocp.studies.designs import Case
from ocp.studies.sweeping import in_words
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

FIRST_LADDER = (Smooth(), StraightLine())  # of a case that is solved for the first time
BETTER = 1e-6  # share of the cost by which a cold start counts as better
KEPT = 8  # prepared structures in a process


@dataclass(frozen=True, eq=False)
class Work:
    """What all cases of a study share; it travels with each of them and is prepared once in each process."""

    token: str  # identity of function and settings
    function: Any  # of a case: a Problem, a Sequence, a Solution or numbers; or a Problem itself
    root: Case  # for which NLPs are prepared, so that results do not depend on the order of the work
    measure: Callable[[Solution], Mapping[str, float]]
    scheme: Scheme | None
    grid: Grid | None
    solver: Ipopt
    polished: bool
    neighbours: bool
    checked: float
    slopes: bool
    compiled: bool


@dataclass(frozen=True, eq=False)
class Known:
    """A solved case that another one starts from."""

    id: str
    case: Case
    content: bytes  # of its solution


@dataclass(frozen=True, eq=False)
class Task:
    """One case."""

    id: str
    case: Case
    start: Known | None = None  # a neighbour
    structure: Known | None = None  # the case whose structure the neighbour has
    attempts: int = 1
    thorough: bool = False  # the whole ladder of guesses


@dataclass(frozen=True, eq=False)
class _Found:
    solution: Any
    way: str
    structure: str | None = None
    note: str = ""


def compute(work: Work, task: Task) -> Record:
    """Return what is stored about a case; whatever goes wrong is a record, too.

    Args:
        work: of the study.
        task: the case.
    """
    begun = time.perf_counter()
    origin = task.start.id if task.start else None
    blank = Record(task.id, task.case, "failed", "", "", origin=origin, attempts=task.attempts)
    try:
        record = _recorded(work, task, blank)
    except Exception as error:
        record = replace(blank, message=f"{in_words(error)}{_place(error)}")
    return replace(record, timings={**record.timings, "total": time.perf_counter() - begun})


def stated(function: Any, case: Case) -> tuple[Any, dict[str, float]]:
    """Return what a function makes of a case, and the values that it did not take: those of parameters.

    Args:
        function: of keyword arguments, or a problem that takes none. A dot in a name may be an underscore in the
            function: payload.mass goes to payload_mass.
        case: name -> value.

    Raises:
        TypeError: the function takes less than the case has, and returns no problem.
    """
    if isinstance(function, Problem | Sequence):
        return function, _numbers(case)
    taken, rest = {}, {}
    known, anything = _arguments(function)
    for name, value in case.items():
        spelled = name if name in known else name.replace(".", "_")
        if spelled in known or anything:
            taken[spelled if spelled in known else name] = value
        else:
            rest[name] = value
    made = function(**taken)
    if rest and not isinstance(made, Problem | Sequence):
        raise TypeError(f"the function takes no {', '.join(rest)}; it takes {', '.join(known) or 'nothing'}")
    return made, _numbers(rest)


def _arguments(function: Any) -> tuple[tuple[str, ...], bool]:
    """Return the names of the arguments of a function, and whether it takes any other."""
    parameters = inspect.signature(function).parameters.values()
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return tuple(p.name for p in parameters if p.kind in kinds), any(p.kind is p.VAR_KEYWORD for p in parameters)


def _recorded(work: Work, task: Task, blank: Record) -> Record:
    here = _here(work)
    made, values = stated(here.function, task.case)
    if not isinstance(made, Problem | Sequence):
        return _of_value(work, made, blank)
    result = _of_problem(here, task, made, values)
    record = replace(blank, way=result.way, structure=result.structure)
    record = _of_solution(work, result.solution, record, result.note)
    if not (work.slopes and record.ok and isinstance(result.solution, Solution)):
        return record
    slopes, note = tangents(result.solution, task.case, values, lambda case: stated(here.function, case)[0])
    message = f"{record.message}; {note}".removesuffix("; ")
    return replace(record, results={**record.results, **slopes}, message=message)


def _of_problem(here: _Here, task: Task, problem: Problem | Sequence, values: dict[str, float]) -> _Found:
    """Solve a problem: by the neighbour's structure, from the neighbour's motion, or from nothing."""
    work = here.work
    prepared = here.prepared_for(problem, values)
    ladder = DEFAULT if task.thorough else FIRST_LADDER
    if isinstance(problem, Sequence):
        return _Found(prepared(ladder, values), "cold")
    cold = functools.partial(_cold, prepared, ladder, values)
    result, note = None, ""
    if task.start is not None and work.neighbours:
        near = decode(task.start.content, problem, task.start.id)
        if task.structure is not None and work.polished and near.structure is not None:
            carried = here.structure(task.structure)(values, problem, near)
            if carried.ok and carried.structure is not None:
                result = _Found(carried, "carried", task.structure.id)
            else:
                note = f"structure not carried over: {carried.message}"
        if result is None:
            warm = prepared.proceed(near, values)
            result = _finished(work, task, warm, "warm") if warm.ok else None
            note = note if warm.ok else f"{note}; warm start: {warm.message}".removeprefix("; ")
    if result is None:
        return replace(_finished(work, task, cold(), "cold"), note=note)
    if not work.neighbours or not _chosen(task.id, work.checked):
        return replace(result, note=note)
    return replace(_compared(work, task, result, cold()), note=note)


def _cold(prepared: Prepared, ladder: Any, values: dict[str, float]) -> Solution:
    solution: Solution = prepared(ladder, values)
    return solution


def _compared(work: Work, task: Task, result: _Found, cold: Solution) -> _Found:
    """Return the better one of what was found from a neighbour and from nothing, and say which one that is."""
    allowed = BETTER * abs(result.solution.cost)
    if not cold.ok or cold.cost >= result.solution.cost - allowed:
        return replace(result, way=f"{result.way}, checked")
    fair = _finished(work, task, cold, "cold")  # polished as well, if the study asks for it
    if fair.solution.cost >= result.solution.cost - allowed:
        return replace(result, way=f"{result.way}, checked")
    return replace(fair, way=f"cold, better than {result.way}")


def _finished(work: Work, task: Task, solution: Solution, way: str) -> _Found:
    if not (work.polished and solution.ok):
        return _Found(solution, way)
    fine = polish(solution)
    return _Found(fine, way, task.id) if fine.structure is not None else _Found(fine, f"{way}, unpolished")


def _chosen(name: str, share: float) -> bool:
    """Return whether a case belongs to the share that is checked; the same one in every run."""
    return int(name[:8], 16) < share * 2**32


def _of_solution(work: Work, solution: Any, blank: Record, note: str = "") -> Record:
    if isinstance(solution, SequenceSolution):
        results = {"cost": float(solution.cost), "duration": float(solution.duration)}
        contents = {f"phase {k}": encode(phase) for k, phase in enumerate(solution.phases, 1)}
    else:
        results = named_numbers("the measure", work.measure(solution))
        contents = {"solution": encode(solution)}
    seconds = solution.timings
    return replace(
        blank,
        status="solved" if solution.ok else solution.status.name.lower(),
        message=f"{solution.message}; {note}".removesuffix("; "),
        results={**results, "iterations": float(solution.iterations)},
        timings={"derivatives": seconds.derivatives, "solver": seconds.solver},
        solutions=contents,
    )


def _of_value(work: Work, value: Any, blank: Record) -> Record:
    """Return the record of what a plain function returned."""
    blank = replace(blank, way="function", origin=None)
    if isinstance(value, Solution | SequenceSolution):
        return _of_solution(work, value, blank)
    if isinstance(value, bool | int | float | np.number | np.bool_):
        value = {"value": value}
    if not isinstance(value, Mapping):
        told = checks.shown(value)
        raise TypeError(f"the function returned {told}, expected a Problem, a Solution, a number or name -> number")
    return replace(blank, status="solved", message="", results=named_numbers("the function", value))


def _place(error: BaseException) -> str:
    """Return where in the user's code an exception came up."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).parent != Path(__file__).parent]
    return f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""


class _Here:
    """What a process has prepared for a study."""

    def __init__(self, work: Work) -> None:
        self.work, self.function = work, work.function
        self._prepared: Prepared | None = None
        self._structures: OrderedDict[str, PreparedStructure] = OrderedDict()

    def prepared_for(self, problem: Problem | Sequence, values: dict[str, float]) -> Prepared:
        """Return the NLP of the study for the numbers of a case, or one of its own if its structure differs."""
        work = self.work
        if self._prepared is None:
            first, nominal = stated(self.function, work.root)
            self._prepared = prepare(first, work.scheme, work.grid, work.solver, values=nominal, compiled=work.compiled)
        try:
            return self._prepared.adapted(problem, None)
        except ValueError:
            return prepare(problem, work.scheme, work.grid, work.solver, values=values)

    def structure(self, origin: Known) -> PreparedStructure:
        """Return the NLP of the structure of a case, prepared once."""
        if origin.id not in self._structures:
            problem, _ = stated(self.function, origin.case)
            solution = decode(origin.content, problem, origin.id)
            self._structures[origin.id] = prepare_structure(solution)
            while len(self._structures) > KEPT:
                self._structures.popitem(last=False)
        self._structures.move_to_end(origin.id)
        return self._structures[origin.id]


def _numbers(values: Case) -> dict[str, float]:
    for name, value in values.items():
        if isinstance(value, str | tuple | bool):
            told = checks.shown(value)
            raise TypeError(f"{name} is {told}, expected a number as the value of a parameter of the problem")
    return {name: float(value) for name, value in values.items()}  # type: ignore[arg-type]


_IN_THIS_PROCESS: dict[tuple[str, str], _Here] = {}


def _here(work: Work) -> _Here:
    # Two studies of one function with other cases have other NLPs: each is prepared for its own root.
    key = work.token, canonical(work.root)
    if key not in _IN_THIS_PROCESS:
        _IN_THIS_PROCESS.clear()
        _IN_THIS_PROCESS[key] = _Here(work)
    return _IN_THIS_PROCESS[key]
