"""Computation of one case in a worker process: call the function, solve its problem, measure the solution."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ocp import checks
from ocp.accuracy.verification import verify
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.storage import encode
from ocp.studies.case_call import call
from ocp.studies.case_result import CaseResult
from ocp.studies.case_slopes import slopes
from ocp.studies.case_solver import CaseSolver, OpenCase, StudySettings
from ocp.studies.content_hash import as_json
from ocp.studies.default_measures import named_numbers
from ocp.studies.sending import end_with_parent
from ocp.studies.sweeping import in_words


def compute(settings: StudySettings, task: OpenCase) -> CaseResult:
    """Compute a case; whatever goes wrong becomes a result with the status "failed".

    Args:
        settings: of the study.
        task: the case.
    """
    begun = time.perf_counter()
    origin = task.neighbour.id if task.neighbour else None
    blank = CaseResult(task.id, task.case, "failed", "", "", origin=origin, attempts=task.attempts)
    try:
        result = _computed(settings, task, blank)
    except (Exception, SystemExit) as error:
        result = replace(blank, message=f"{in_words(error)}{_line_of(error)}")
    return replace(result, timings={**result.timings, "total": time.perf_counter() - begun})


def compute_for(owner: int, settings: StudySettings, task: OpenCase) -> CaseResult:
    """Compute a case in a worker process, which ends when the process that started it is gone.

    Args:
        owner: id of the process that runs the study.
        settings: of the study.
        task: the case.
    """
    end_with_parent(owner)
    return compute(settings, task)


def _computed(settings: StudySettings, task: OpenCase, blank: CaseResult) -> CaseResult:
    solver = _solver_of_this_process(settings)
    returned, values = call(settings.function, task.case)
    if not isinstance(returned, Problem | Sequence):
        return _result_of_value(settings, returned, blank)
    solved = solver.solve(task, returned, values)
    blank = replace(blank, way=solved.way, structure=solved.structure)
    result = _result_of_solution(settings, solved.solution, blank, solved.note)
    if not (settings.slopes and result.ok and isinstance(solved.solution, Solution)):
        return result
    derivatives, note = slopes(solved.solution, task.case, values, lambda case: call(settings.function, case)[0])
    message = f"{result.message}; {note}".removesuffix("; ")
    return replace(result, results={**result.results, **derivatives}, message=message)


def _result_of_solution(settings: StudySettings, solution: Any, blank: CaseResult, note: str = "") -> CaseResult:
    if isinstance(solution, SequenceSolution):
        results = {"cost": float(solution.cost), "duration": float(solution.duration)}
        files = {f"phase {k}": encode(phase) for k, phase in enumerate(solution.phases, 1)}
    else:
        results = named_numbers("the measure", settings.measure(solution))
        files = {"solution": encode(solution)}
    seconds, message = solution.timings, solution.message
    if note and note.removeprefix("warm start: ") not in message:
        message = f"{message}; {note}".removeprefix("; ")
    if settings.verified and solution.ok:
        report = verify(solution)
        results["verified"] = float(report.ok)
        message = "; ".join([message, *(f"not verified: {one}" for one in report.failures)])
    return replace(
        blank,
        status="solved" if solution.ok else solution.status.name.lower(),
        message=message,
        results={**results, "iterations": float(solution.iterations)},
        timings={"derivatives": seconds.derivatives, "solver": seconds.solver},
        solutions=files,
    )


def _result_of_value(settings: StudySettings, value: Any, blank: CaseResult) -> CaseResult:
    """Return the result of a case whose function returned no problem."""
    blank = replace(blank, way="function", origin=None)
    if isinstance(value, Solution | SequenceSolution):
        return _result_of_solution(settings, value, blank)
    if isinstance(value, bool | int | float | np.number | np.bool_):
        value = {"value": value}
    if not isinstance(value, Mapping):
        shown = checks.shown(value)
        raise TypeError(f"the function returned {shown}, expected a Problem, a Solution, a number or name -> number")
    return replace(blank, status="solved", message="", results=named_numbers("the function", value))


def _line_of(error: BaseException) -> str:
    """Return file and line of the user's code in which an exception was raised."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).parent != Path(__file__).parent]
    return f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""


_SOLVERS: dict[tuple[str, str], CaseSolver] = {}  # of the study that this process computed last


def _solver_of_this_process(settings: StudySettings) -> CaseSolver:
    # Studies of one function over other cases prepare their NLP for another first case.
    key = settings.identity, as_json(settings.first)
    if key not in _SOLVERS:
        _SOLVERS.clear()
        _SOLVERS[key] = CaseSolver(settings)
    return _SOLVERS[key]
