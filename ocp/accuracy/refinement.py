"""Refinement: solve, estimate the error, refine the grid, until a tolerance is met or a budget is spent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ocp import checks
from ocp.accuracy.error_estimate import estimate
from ocp.accuracy.grid_refinement import refine
from ocp.accuracy.tolerances import Cost, Tolerance
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem
from ocp.solution.accuracy import Accuracy, Errors
from ocp.solution.solution import Solution, Status
from ocp.solving.guess_conversion import GuessLike, as_guesses, is_ladder
from ocp.solving.ipopt import Ipopt
from ocp.solving.prepared_nlp import prepare
from ocp.solving.solver import solve
from ocp.transcription.grid import Grid, uniform
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

STEPS = 30  # at most
LATER = 1e-3  # share of the last error that the solver may leave in a step
TIGHTEST = 1e-13  # tolerance of the solver
STALLED = 4  # steps without half the error before
USABLE = (Status.SOLVED, Status.ACCEPTABLE)  # the error estimate includes what a looser solve leaves


@dataclass(frozen=True, eq=False)
class _Budget:
    seconds: float
    elements: int
    begun: float

    @property
    def spent(self) -> float:
        return time.perf_counter() - self.begun

    def refuses(self, grid: Grid, last: float, now: int) -> str:
        """Return why a further step does not fit; empty if it does."""
        if len(grid) > self.elements:
            return f"the next grid would have {len(grid)} elements, {self.elements} are allowed"
        if self.spent + last * len(grid) / max(now, 1) > self.seconds:
            return f"the next step would not end within {self.seconds:g} s"
        return ""


@dataclass(frozen=True, eq=False)
class _Task:
    """What is refined, and how: the same for all steps."""

    problem: Problem
    wanted: Tolerance
    solver: Ipopt
    values: Mapping[str, float] | None
    budget: _Budget
    finish: Callable[[Solution], Solution] | None

    def rated(self, solution: Solution, errors: Errors) -> Solution:
        """Return a solution with its accuracy."""
        wanted, error = self.wanted, self.wanted.error(solution, errors)
        accuracy = Accuracy(error, wanted.tol, wanted.unit, wanted.what, self.budget.spent, errors)
        return replace(solution, accuracy=accuracy)


def solve_to_accuracy(
    problem: Problem,
    tol: float | Tolerance = 1e-6,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: Ipopt | None = None,
    guess: GuessLike | Several[Any] | None = None,
    values: Mapping[str, float] | None = None,
    *,
    seconds: float = float("inf"),
    elements: int = 2000,
    finish: Callable[[Solution], Solution] | None = None,
) -> Iterator[Solution]:
    """Solve on finer and finer grids until the estimated error is within a tolerance, or a budget is spent.

    Every step is yielded as soon as it is solved, with its error, the seconds since the beginning and, on the last
    one, the reason in `accuracy`. An element in which a control jumps is replaced by a narrow one around the time of
    the jump, computed from the mean of the control; other elements with more than their share of the error are split;
    if the error of a smooth problem is spread over the grid, the degree is raised instead; neighbours that contribute
    nothing are merged. A step is a warm start from the one before, multipliers included, and a cold start if that
    fails or leads to a worse optimum.

    For the best accuracy within T seconds: tol=1e-15, seconds=T, and the last step.

    Args:
        problem: a Problem.
        tol: Cost, Share, Seconds or Signal; a number means Cost, which for minimum time are seconds.
        scheme: default radau(3); controls constant on each element where the Hamiltonian is linear in them and all
            of them are limited, else collocated.
        grid: of the first step, default uniform(20).
        solver: settings; the tolerance is tightened from step to step with the error and the number of limits.
        guess: for the first step, as in `solve`.
        values: of parameters, by name.
        seconds: no step is begun that would probably end later [s]; the first is always solved.
        elements: largest number of elements of a grid.
        finish: a last stage, Solution -> Solution, such as `polish`, tried on every step; its result is yielded if
            its error is smaller than that of the step, and ends the refinement if it meets the tolerance.

    Raises:
        TypeError, ValueError: wrong input, named. A solve that fails raises nothing: it is the last step.
    """
    wanted: Tolerance = Cost(tol) if isinstance(tol, int | float | np.number) else tol
    called = "solve_to_accuracy"
    checks.instance(f"{called}: problem", problem, Problem, "a Problem")
    if not all(callable(getattr(wanted, name, None)) for name in ("error", "parts")) or isinstance(wanted, type):
        raise TypeError(f"{called}: tol is {checks.shown(tol)}, expected a number, Cost, Share, Seconds or Signal")
    for name, value, kind in (("scheme", scheme, Scheme), ("grid", grid, Grid), ("solver", solver, Ipopt)):
        checks.instance(f"{called}: {name}", value, kind | None, f"an object of {kind.__name__}, or None")
    problem.system.values(values)
    if guess is not None and not is_ladder(guess):
        as_guesses(problem, guess)
    budget = f"{called}: budget, seconds"
    checks.number(budget, seconds, "a number of seconds > 0, or inf", above=0.0, finite=False)
    checks.whole(f"{called}: budget, elements", elements, 1)
    if finish is not None and not callable(finish):
        raise TypeError(f"{called}: finish is {checks.shown(finish)}, expected a function of a Solution, or None")
    own = Ipopt() if solver is None else solver
    task = _Task(problem, wanted, own, values, _Budget(seconds, elements, time.perf_counter()), finish)
    return _steps(task, _scheme(problem) if scheme is None else scheme, uniform(20) if grid is None else grid, guess)


def _steps(task: _Task, scheme: Scheme, grid: Grid, guess: GuessLike | Several[Any] | None) -> Iterator[Solution]:
    history: list[float] = []
    result: Solution = solve(task.problem, scheme, grid, task.solver, guess, task.values)
    while True:
        errors = estimate(result)
        history.append(task.wanted.error(result, errors))
        step = task.rated(result, errors)
        if _met(step):
            yield _last(step, "the tolerance is met")
            return
        finished = _finished(task, step, errors)
        if finished is not None:
            yield step
            if _met(finished):
                yield _last(finished, "the tolerance is met")
                return
            step = finished
        usable = result.status in USABLE
        scheme, grid = refine(result, task.wanted, errors) if usable else (result.scheme, result.grid)
        reason = _reason_to_stop(task, result, grid, history) if usable else result.status.value
        yield _last(step, reason) if reason else step
        if reason:
            return
        allowed = max(task.wanted.tol, LATER * history[-1]) * errors.cost / history[-1]
        result = _next(task, result, errors, scheme, grid, allowed)


def _met(step: Solution) -> bool:
    return step.accuracy is not None and step.accuracy.met


def _last(step: Solution, reason: str) -> Solution:
    accuracy = None if step.accuracy is None else replace(step.accuracy, reason=reason)
    return replace(step, accuracy=accuracy, message=f"{step.message} ({accuracy})")


def _finished(task: _Task, step: Solution, errors: Errors) -> Solution | None:
    """Return the result of the last stage if it is better than the step."""
    if task.finish is None or step.status not in USABLE:
        return None
    finished = task.finish(step)
    if not finished.ok:
        return None
    rated = task.rated(finished, estimate(finished))
    better = rated.accuracy is not None and rated.accuracy.error < task.wanted.error(step, errors)
    return rated if better else None


def _reason_to_stop(task: _Task, result: Solution, grid: Grid, history: list[float]) -> str:
    reason = task.budget.refuses(grid, result.timings.total, len(result.grid))
    if not reason and len(history) > STALLED and min(history[-STALLED:]) > 0.5 * min(history[:-STALLED]):
        reason = f"the error has not been halved in {STALLED} steps"
    return reason or (f"{STEPS} steps" if len(history) >= STEPS else "")


def _next(task: _Task, last: Solution, errors: Errors, scheme: Scheme, grid: Grid, allowed: float) -> Solution:
    """Return the next step, warm-started from the last one; cold-started if that fails or is worse.

    Args:
        task: what is refined.
        last: the step before.
        errors: of it.
        scheme, grid: of the next step.
        allowed: error of the cost that the solver may leave, shared by all limits.
    """
    limits = 2 * (last.states.size + last.controls.size)
    tol = float(np.clip(allowed / limits, TIGHTEST, task.solver.tol))
    left = max(task.budget.seconds - task.budget.spent, 0.1)
    solver = replace(task.solver, tol=tol, max_seconds=min(task.solver.max_seconds, left))
    prepared = prepare(task.problem, scheme, grid, solver, last, task.values)
    result: Solution = prepared.proceed(last, task.values)
    worst = last.cost + errors.cost
    usable = result.status in USABLE
    if usable and (result.cost <= worst or result.cost <= worst + estimate(result).cost):
        return result
    cold: Solution = prepared(None, task.values)
    best = min((one for one in (result, cold) if one.status in USABLE), key=lambda one: one.cost, default=cold)
    why = "leads to a worse optimum" if usable else "fails"
    return replace(
        best, iterations=result.iterations + cold.iterations,
        message=f"{best.message}; the warm start from the step before {why}, solved from scratch",
    )  # fmt: skip


def _scheme(problem: Problem) -> Scheme:
    """Return radau(3) with constant controls if H is linear in the controls and all are limited, else collocated."""
    system = problem.system
    curved = ca.depends_on(hamiltonian_of(problem).slope, system.u)
    bounded = np.all(np.isfinite(np.concatenate(problem.limits(Where.ALONG, system.u))))
    return radau(3, Control.COLLOCATED if curved or not bounded else Control.CONSTANT)
