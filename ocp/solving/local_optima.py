"""Search for local optima: solves from many initial guesses, grouped by the motion that they lead to."""

from __future__ import annotations

import functools
import sys
import time
import uuid
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ocp import checks
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence, parameter_values
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status
from ocp.solving.first_guesses import phase_guesses, scattered, smooth
from ocp.solving.guess_conversion import AnySolution
from ocp.solving.ipopt import Ipopt
from ocp.solving.iteration_watch import QUIET_SECONDS
from ocp.solving.nlp_solver import NlpSettings
from ocp.solving.prepared_nlp import Prepared, prepare
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

SAME_COST = 1e-5  # relative
SAME_MOTION = 1e-2  # of the range of each state, root mean square
COMPARED = 101  # points at which motions are compared


@dataclass(frozen=True, eq=False)
class Optimum:
    """A local optimum and how it was found.

    Args:
        solution: the motion, a Solution; of a Sequence, a SequenceSolution.
        hits: number of starts that led to it.
        starts: numbers of those starts; 0 is the smooth motion, the others are scattered around it.
        seconds: solver time of all its starts together [s].
    """

    solution: Any
    hits: int
    starts: tuple[int, ...]
    seconds: float


class Optima(tuple[Optimum, ...]):
    """Distinct local optima, best first: a tuple with a message that says how many there are, or why there is none."""

    message: str

    def __new__(cls, optima: tuple[Optimum, ...], message: str) -> Optima:
        """Return the tuple with its message."""
        made = super().__new__(cls, optima)
        made.message = message
        return made


@dataclass(frozen=True, eq=False)
class _Task:
    """Everything that a worker process needs for one start; prepared once in each process."""

    token: str
    problem: Problem | Sequence
    scheme: Scheme | None
    grid: Grid | None
    solver: NlpSettings
    values: tuple[tuple[str, float], ...]
    seed: int


def multistart(
    problem: Problem | Sequence,
    starts: int = 20,
    seed: int = 0,
    executor: Executor | None = None,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: NlpSettings | None = None,
    values: Mapping[str, float] | None = None,
    first: AnySolution | None = None,
) -> Optima:
    """Solve from many starts and return the distinct local optima, best first.

    Start k depends on (seed, k) alone, so a result does not depend on the executor or the order of the task. Two
    solutions are one optimum if their costs agree to 1e-5 and their motions to 1e-2 of the range of each state. The
    message of the best one says how many optima there are and how many starts failed.

    Args:
        problem: a Problem or a Sequence, whose phases are scattered together.
        starts: number of starts, >= 1; the first is the smooth motion between the ends.
        seed: of the scattered starts.
        executor: any concurrent.futures.Executor; None solves here. Problems travel to processes as functions.
        scheme: default radau(3).
        grid: default uniform(50).
        solver: settings.
        values: of parameters, by name.
        first: a solution of the problem that takes the place of the first start; None to solve from it.

    Returns:
        The optima, a tuple with `.message`; if no start is solved, nor the default ladder of guesses, it is empty and
        the message says why.

    Raises:
        ValueError: starts is not a whole number >= 1, or a wrong parameter name.
        TypeError: problem is no Problem and no Sequence.
    """
    checks.whole("multistart: starts", starts, 1)
    checks.whole("multistart: seed", seed, 0)
    checks.instance("multistart: problem", problem, Problem | Sequence, "a Problem or a Sequence")
    for name, value, kind in (("scheme", scheme, Scheme), ("grid", grid, Grid), ("solver", solver, NlpSettings)):
        checks.instance(f"multistart: {name}", value, kind | None, f"an object of {kind.__name__}, or None")
    if executor is not None and not callable(getattr(executor, "map", None)):
        raise TypeError(f"multistart: executor is {checks.shown(executor)}, expected a concurrent.futures.Executor")
    parameter_values(problem, values)
    task = _Task(
        uuid.uuid4().hex, problem, scheme, grid, solver or Ipopt(progress=False), tuple((values or {}).items()), seed
    )
    wanted = "a solution of the problem, or None"
    checks.instance("multistart: first", first, Solution | SequenceSolution | None, wanted)
    begun = time.perf_counter()
    results = [_solve_start(task, 0) if first is None else first]
    if not _refused(results[0]):
        rest = range(1, starts)
        others = map if executor is None else executor.map
        for result in others(functools.partial(_solve_start, task), rest):
            results.append(result)
            _show(len(results), starts, begun)
    solved = [(k, _attached(s, problem)) for k, s in enumerate(results) if s.ok]
    optima = _distinct(solved)
    if not optima and not _refused(results[0]):
        last = prepare(problem, scheme, grid, task.solver, values=values)(None, values)
        optima = _distinct([(0, last)]) if last.ok else ()
        solved, results = [(0, last)] if last.ok else [], [*results, last]
    if not optima:
        return Optima((), _why_none(results))
    message = (
        f"{optima[0].solution.message}; {len(optima)} local optima from {starts} starts (costs "
        f"{', '.join(f'{o.solution.cost:.6g} x{o.hits}' for o in optima)}), {starts - len(solved)} starts failed"
    )
    best = replace(optima[0], solution=replace(optima[0].solution, message=message))
    return Optima((best, *optima[1:]), message)


def _show(done: int, starts: int, begun: float) -> None:
    """Show on a terminal how many starts are done, once they have taken a while; the last one wipes the line."""
    spent = time.perf_counter() - begun
    if sys.stderr.isatty() and spent > QUIET_SECONDS:
        line = f"  multistart, {done} of {starts} starts, {spent:.0f} s" if done < starts else ""
        print(f"\r{line:76s}" + ("" if line else "\r"), end="", file=sys.stderr, flush=True)


def _refused(solution: AnySolution) -> bool:
    """Return whether a problem contradicts itself, so that no start can be solved."""
    return solution.status is Status.INFEASIBLE and solution.solver_status == "not started"


def _why_none(results: list[AnySolution]) -> str:
    """Return how often the starts failed in which way, with the message of the last one."""
    counts = Counter(solution.status.name.lower() for solution in results)
    each = ", ".join(f"{count} {name}" for name, count in counts.most_common())
    return f"none of {len(results)} starts was solved ({each}): {results[-1].message}"


def _solve_start(task: _Task, start: int) -> AnySolution:
    prepared = _prepared(task)
    values = dict(task.values)
    random = np.random.default_rng([task.seed, start])
    make = smooth if start == 0 else lambda phase, numbers: scattered(phase, numbers, random)
    result = prepared(phase_guesses(prepared.problem, prepared.numbers(values), make), values)
    # CasADi graphs cannot be sent back; the caller has the problem.
    if isinstance(result, SequenceSolution):
        phases = tuple(_detached(phase, start) for phase in result.phases)
        return replace(result, problem=None, phases=phases)  # type: ignore[arg-type]
    return _detached(result, start)


def _detached(solution: Solution, start: int) -> Solution:
    return replace(solution, problem=None, rung=f"start {start}")


def _attached(solution: AnySolution, problem: Problem | Sequence) -> AnySolution:
    if not isinstance(problem, Sequence):
        return replace(solution, problem=problem)
    phases = zip(solution.phases, problem.problems, strict=True)
    return replace(solution, problem=problem, phases=tuple(replace(one, problem=own) for one, own in phases))


_IN_THIS_PROCESS: dict[str, Prepared] = {}


def _prepared(task: _Task) -> Prepared:
    if task.token not in _IN_THIS_PROCESS:
        _IN_THIS_PROCESS.clear()
        made = prepare(task.problem, task.scheme, task.grid, task.solver, values=dict(task.values))
        _IN_THIS_PROCESS[task.token] = made
    return _IN_THIS_PROCESS[task.token]


def _distinct(solved: list[tuple[int, AnySolution]]) -> tuple[Optimum, ...]:
    groups: list[list[tuple[int, AnySolution]]] = []
    for k, solution in sorted(solved, key=lambda pair: pair[1].cost):
        for group in groups:
            if _same(group[0][1], solution):
                group.append((k, solution))
                break
        else:
            groups.append([(k, solution)])
    return tuple(
        Optimum(
            group[0][1],
            len(group),
            tuple(sorted(k for k, _ in group)),
            sum(s.timings.derivatives + s.timings.solver for _, s in group),
        )
        for group in groups
    )


def _same(one: AnySolution, other: AnySolution) -> bool:
    if abs(one.cost - other.cost) > SAME_COST * max(abs(one.cost), abs(other.cost)):
        return False
    if isinstance(one, SequenceSolution):
        return all(_same_motion(*pair) for pair in zip(one.phases, other.phases, strict=True))
    return _same_motion(one, other)


def _same_motion(one: Solution, other: Solution) -> bool:
    share = np.linspace(0.0, 1.0, COMPARED)
    a, b = one.x(share * one.duration), other.x(share * other.duration)
    most = np.max(np.abs(a), axis=0)
    size = np.maximum(np.ptp(a, axis=0), np.maximum(1e-6 * most, 1e-9 * np.max(most, initial=0.0)))
    size = np.where(size > 0.0, size, 1.0)
    return bool(np.all(np.sqrt(np.mean((a - b) ** 2, axis=0)) <= SAME_MOTION * size))
