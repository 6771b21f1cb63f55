"""Refinement: solve, estimate the error, refine the grid, until a tolerance is met or a budget is spent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Sequence as Several
from dataclasses import replace
from typing import Any

import numpy as np

from ocp import checks
from ocp.accuracy.control_shape import scheme_for
from ocp.accuracy.error_estimate import estimate
from ocp.accuracy.grid_refinement import refine
from ocp.accuracy.limit_order import Pattern, control_pattern
from ocp.accuracy.refinement_task import Budget, RefinementTask
from ocp.accuracy.sequence_refinement import refined
from ocp.accuracy.tolerances import Cost, Tolerance
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence, parameter_values
from ocp.solution.accuracy import Errors
from ocp.solution.solution import Solution, Status
from ocp.solving.between_nodes import exceeded_between_nodes, with_nodes
from ocp.solving.deadline import within
from ocp.solving.guess_conversion import GuessLike, as_guesses, is_ladder
from ocp.solving.guess_rungs import Smooth
from ocp.solving.ipopt import Ipopt
from ocp.solving.prepared_nlp import prepare
from ocp.solving.resolving_grid import resolved
from ocp.solving.solver import solve
from ocp.transcription.grid import Grid, uniform
from ocp.transcription.schemes.scheme import Control, Scheme

STEPS = 30  # at most
LATER = 1e-3  # share of the last error that the solver may leave in a step
TIGHTEST = 1e-13  # tolerance of the solver
TIGHT = 1e-9  # the same for the last grid, if its motion needs another one
COARSE = 100.0  # error over that of the default solve up to which a coarse grid of higher order is refined on
STALLED = 4  # steps without half the error before
USABLE = (Status.SOLVED, Status.ACCEPTABLE)  # the error estimate includes what a looser solve leaves


def solve_to_accuracy(
    problem: Problem | Sequence,
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
) -> Iterator[Any]:
    """Solve on finer and finer grids until the estimated error is within a tolerance, or a budget is spent.

    Every step is yielded as soon as it is solved, and the one with the smallest error last, with its error, the seconds
    since the beginning and, on the last one, the reason in `accuracy`. An element in which a control jumps is replaced
    by a narrow one around the time of the jump, computed from the mean of the control; other elements with more than
    their share of the error are split, and those in which an obstacle is passed between the nodes; if the error of a
    smooth problem is spread over the grid, the degree is raised instead; neighbours that contribute nothing are merged.
    A step is a warm start from the one before, multipliers included, and a cold start if that fails or leads to a worse
    optimum. The last one is solved on a grid that resolves its motion (`resolved`), if there is time.

    For the best accuracy within T seconds: tol=1e-15, seconds=T, and the last step.

    Args:
        problem: a Problem, or a Sequence, whose phases are refined on one common grid.
        tol: Cost, Share, Seconds or Signal; a number means Cost, which for minimum time are seconds.
        scheme: default radau(3); controls constant on each element where the Hamiltonian is linear in them and all
            of them are limited, else collocated.
        grid: of the first step, default uniform(20).
        solver: settings; the tolerance is tightened from step to step with the error and the number of limits.
        guess: for the first step, as in `solve`.
        values: of parameters, by name.
        seconds: no step is begun that would probably end later, and none goes on longer [s]; the first one has two
            seconds at least.
        elements: largest number of elements of a grid.
        finish: a last stage, Solution -> Solution, such as `polish`, tried on the first step, and on later ones where
            controls and states are at their limits in another order than before; its result is yielded if its error is
            smaller than that of the step, and ends the refinement if it meets the tolerance.

    Raises:
        TypeError, ValueError: wrong input, named. A solve that fails raises nothing: it is the last step.
    """
    wanted: Tolerance = Cost(tol) if isinstance(tol, int | float | np.number) else tol
    called = "solve_to_accuracy"
    checks.instance(f"{called}: problem", problem, Problem | Sequence, "a Problem or a Sequence")
    if not all(callable(getattr(wanted, name, None)) for name in ("error", "parts")) or isinstance(wanted, type):
        raise TypeError(f"{called}: tol is {checks.shown(tol)}, expected a number, Cost, Share, Seconds or Signal")
    for name, value, kind in (("scheme", scheme, Scheme), ("grid", grid, Grid), ("solver", solver, Ipopt)):
        checks.instance(f"{called}: {name}", value, kind | None, f"an object of {kind.__name__}, or None")
    parameter_values(problem, values)
    if guess is not None and not is_ladder(guess):
        as_guesses(problem, guess)
    budget = f"{called}: budget, seconds"
    checks.number(budget, seconds, "a number of seconds > 0, or inf", above=0.0, finite=False)
    checks.whole(f"{called}: budget, elements", elements, 1)
    if finish is not None and not callable(finish):
        raise TypeError(f"{called}: finish is {checks.shown(finish)}, expected a function of a Solution, or None")
    own = Ipopt() if solver is None else solver
    if isinstance(problem, Sequence):
        schemes, begun = [scheme_for(phase) for phase in problem.problems], time.perf_counter()
        chosen = scheme or next((one for one in schemes if one.control is Control.COLLOCATED), schemes[0])
        with within(Budget(seconds, elements, begun).of_first):
            first = solve(problem, chosen, uniform(20) if grid is None else grid, own, guess, values)
        left = max(seconds - (time.perf_counter() - begun), 1e-3)
        return refined(first, wanted, lambda posed, tolerance, one, known: solve_to_accuracy(
            posed, tolerance, chosen, one.grid, own, one, known, seconds=left, elements=elements, finish=finish
        ))  # fmt: skip
    task = RefinementTask(problem, wanted, own, values, Budget(seconds, elements, time.perf_counter()), finish)
    return _steps(task, scheme_for(problem) if scheme is None else scheme, uniform(20) if grid is None else grid, guess)


def _steps(
    task: RefinementTask, scheme: Scheme, grid: Grid, guess: GuessLike | Several[Any] | None
) -> Iterator[Solution]:
    """Yield the steps; the last one is the one with the smallest error."""
    history: list[float] = []
    best: Solution | None = None
    tried: Pattern | None = None  # of the last step on which the last stage was tried
    result, steady = _first(task, scheme, grid, guess)
    begun = time.perf_counter() - result.timings.total
    while True:
        errors = estimate(result)
        step = task.rated(result, errors)
        history.append(task.wanted.error(result, errors))
        usable = result.status in USABLE
        collides = exceeded_between_nodes(result) if usable else {}
        if usable and not collides and (best is None or _error(step) < _error(best) or _other_optimum(best, step)):
            best = step
        met = _met(step) and not collides
        before = time.perf_counter()
        finished, tried = (None, tried) if met else _finished(task, step, errors, tried)
        begun += time.perf_counter() - before  # not a part of the next step
        if finished is not None:
            yield step
            best = step = finished
            met = _met(finished)
        grid, reason = result.grid, "the tolerance is met" if met else "" if usable else result.status.value
        if not reason:
            scheme, grid = (result.scheme, grid) if _met(step) else refine(result, task.wanted, errors)
            grid = with_nodes(grid, collides)
            reason = _reason_to_stop(task, time.perf_counter() - begun, (len(result.grid), grid), history)
        if not reason:
            yield step
            begun = time.perf_counter()
            allowed = max(task.wanted.tol, LATER * history[-1]) * errors.cost / max(history[-1], 1e-300)
            result, reason = _next(task, result, errors, scheme, grid, allowed)
        if not reason:
            continue
        if not met and steady is not None and task.budget.left > 0.0 and _better(task, steady, best):
            # Controls that may swing within an element led nowhere: refine what `solve` returns by default.
            yield step
            begun, result, steady, history = time.perf_counter(), steady, None, []
            scheme = result.scheme
            continue
        ended = step if best is None or met else best
        words = reason if ended is step else f"{reason}; this is the best step"
        yield _last(ended if best is None else _resolved(task, ended), words)
        return


def _better(task: RefinementTask, steady: Solution, best: Solution | None) -> bool:
    return best is None or task.wanted.error(steady, estimate(steady)) < _error(best)


def _error(step: Solution) -> float:
    return step.accuracy.error if step.accuracy is not None else np.inf


def _met(step: Solution) -> bool:
    return step.accuracy is not None and step.accuracy.met


def _other_optimum(best: Solution, step: Solution) -> bool:
    """Return whether a step costs less than the best one by more than the errors of both."""
    if best.accuracy is None or step.accuracy is None:
        return False
    return step.cost + step.accuracy.errors.cost < best.cost - best.accuracy.errors.cost


def _last(step: Solution, reason: str) -> Solution:
    accuracy = None if step.accuracy is None else replace(step.accuracy, reason=reason)
    return replace(step, accuracy=accuracy, message=f"{step.message} ({accuracy})")


def _resolved(task: RefinementTask, step: Solution) -> Solution:
    """Return a step on a grid that resolves its motion, if that is solved in time and its error is no larger."""
    if step.status is not Status.SOLVED or step.structure is not None or not task.budget.left > 0.0:
        return step
    with within(task.budget.left):
        settings = task.timed(min(task.solver.tol, TIGHT))
        finer: Solution = resolved(step, settings, task.values, task.budget.left)
    rated = step if finer is step else task.rated(finer, estimate(finer))
    return rated if _error(rated) <= max(_error(step), task.wanted.tol) else step


def _finished(
    task: RefinementTask, step: Solution, errors: Errors, tried: Pattern | None
) -> tuple[Solution | None, Pattern | None]:
    """Return the result of the last stage if it is better than the step, and the pattern that it was last tried on."""
    if task.finish is None or step.status not in USABLE or not task.budget.left > 0.0:
        return None, tried
    pattern = control_pattern(step)
    if pattern == tried:
        return None, tried
    with within(task.budget.left):
        finished = task.finish(step)
    if not finished.ok:
        return None, pattern
    rated = task.rated(finished, estimate(finished))
    better = rated.accuracy is not None and rated.accuracy.error < task.wanted.error(step, errors)
    return (rated if better else None), pattern


def _reason_to_stop(task: RefinementTask, seconds: float, grids: tuple[int, Grid], history: list[float]) -> str:
    reason = task.budget.refuses(grids[1], seconds, grids[0])
    if not reason and len(history) > STALLED and min(history[-STALLED:]) > 0.5 * min(history[:-STALLED]):
        reason = f"the error has not been halved in {STALLED} steps"
    return reason or (f"{STEPS} steps" if len(history) >= STEPS else "")


def _first(
    task: RefinementTask, scheme: Scheme, grid: Grid, guess: GuessLike | Several[Any] | None
) -> tuple[Solution, Solution | None]:
    """Return the first step, no worse than what `solve` returns by default, and that if it is another one.

    A control that may swing within an element leads to poor local optima and to interpolants that no motion follows.
    Where the control is not constant on each element, the problem is solved by the defaults of `solve` as well; if that
    costs less or has a smaller error, it is the initial guess.
    """
    result = task.solved(scheme, grid, guess)
    if scheme.control is Control.CONSTANT or not task.budget.left > 0.0:
        return result, None
    steady = task.solved(None, None, guess)
    if steady.status not in USABLE:
        return result, None
    allowed = estimate(steady).cost

    def good(candidate: Solution) -> bool:
        error = estimate(candidate).cost
        return candidate.status in USABLE and candidate.cost <= steady.cost + allowed and error <= COARSE * allowed

    if good(result):
        return result, steady
    again = task.solved(scheme, grid, steady)
    return (again, steady) if good(again) else (steady, None)


def _next(
    task: RefinementTask, last: Solution, errors: Errors, scheme: Scheme, grid: Grid, allowed: float
) -> tuple[Solution, str]:
    """Return the next step, warm-started from the last one; or the last one and the reason why there is none.

    Warm with multipliers, then without, then from scratch, until one is solved and leads to no worse optimum.

    Args:
        task: what is refined.
        last: the step before.
        errors: of it.
        scheme, grid: of the next step.
        allowed: error of the cost that the solver may leave, shared by all limits.
    """
    limits = 2 * (last.states.size + last.controls.size)
    tol = float(np.clip(allowed / limits, TIGHTEST, task.solver.tol))
    begun = time.perf_counter()
    prepared = prepare(task.problem, scheme, grid, task.timed(tol, 1.0 / 3.0), last, task.values)
    worst, spent, why = last.cost + errors.cost, 0, "is not begun"
    attempts: tuple[tuple[str, Callable[[], Any]], ...] = (
        ("", lambda: prepared.proceed(last, task.values)),
        ("without multipliers", lambda: prepared(last, task.values)),
        ("from scratch", lambda: prepared((Smooth(),), task.values)),
    )
    for words, attempt in attempts:
        slow = words and time.perf_counter() - begun > task.budget.left
        if slow or not task.budget.left > 0.0:
            return last, f"no time is left within {task.budget.seconds:g} s after a step that {why}"
        with within(task.budget.left):
            result: Solution = attempt()
        spent += result.iterations
        if result.status in USABLE and result.cost <= worst + estimate(result).cost:
            message = f"{result.message}; solved again {words}, as a warm start {why}" if words else result.message
            return replace(result, iterations=spent, message=message), ""
        why = "leads to a worse optimum" if result.status in USABLE else "fails"
    return last, f"the next step {why}"
