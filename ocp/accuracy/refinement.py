"""Refinement: solve, estimate the error, refine where it is made, until a tolerance is met or a budget is spent."""

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
from ocp.accuracy.tolerances import Cost, Tolerance
from ocp.checks import Array
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
from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.lobatto_iiia import lobatto
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

RUNGS = 30
SPARE = 0.5  # share of the tolerance that the elements together may use
CONCENTRATED = 0.01  # share of the largest part below which a part waits
EVEN = 0.1  # median over largest part from which an error is spread over the grid
NEGLIGIBLE = 1e-3  # share of its allowance below which two neighbours are merged
WIDEST = 0.1  # share of the horizon, of a merged element
NARROWEST = 1e-9  # share of the horizon
MOST_PIECES = 4
HIGHEST = 9  # degree
LATER = 1e-3  # share of the last error that the solver may leave in a rung
TIGHTEST = 1e-13
STALLED = 4  # rungs without half the error before
LONGEST_RUN = 3  # neighbouring elements that one jump of a control may disturb
USABLE = (Status.SOLVED, Status.ACCEPTABLE)  # the estimate judges what a looser solve is worth
SCHEMES = {"radau": radau, "legendre": legendre, "lobatto": lobatto}


@dataclass(frozen=True, eq=False)
class _Budget:
    seconds: float
    elements: int
    begun: float

    @property
    def spent(self) -> float:
        return time.perf_counter() - self.begun

    def refuses(self, grid: Grid, last: float, now: int) -> str:
        """Return why a further rung does not fit; empty if it does."""
        if len(grid) > self.elements:
            return f"the next grid would have {len(grid)} elements, {self.elements} are allowed"
        if self.spent + last * len(grid) / max(now, 1) > self.seconds:
            return f"the next rung would not end within {self.seconds:g} s"
        return ""


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

    Every rung is yielded as soon as it is solved, with its error, the seconds since the beginning and, on the last
    one, the reason in `accuracy`. An element in which a control jumps is replaced by a narrow one around the place of
    the jump, found from the mean of the control; other elements that make more than their part of the error are
    split; where the error is spread over the grid of a smooth problem, the degree is raised instead; neighbours with
    no part in the error are merged. A rung starts from the one before it, multipliers included, and from scratch if
    that fails or leads to a worse optimum.

    For the best accuracy within T seconds: tol=1e-15, seconds=T, and the last rung.

    Args:
        problem: a Problem.
        tol: Cost, Share, Seconds or Signal; a number means Cost, which for minimum time are seconds.
        scheme: default radau(3); controls constant on each element where the Hamiltonian is linear in them and all
            of them are limited, else collocated.
        grid: the first one, default uniform(20).
        solver: settings; the tolerance is tightened from rung to rung as the error and the number of limits ask.
        guess: for the first rung, as in `solve`.
        values: of parameters, by name.
        seconds: no rung is begun that would probably end later [s]; the first is always solved.
        elements: most elements of a grid.
        finish: a last stage, Solution -> Solution, tried on every rung; what it returns ends the ladder if its own
            estimate meets the tolerance, and is yielded if it is better than the rung.

    Raises:
        TypeError, ValueError: wrong input, named. A solve that fails raises nothing: it is the last rung.
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
    return _rungs(
        problem, wanted, _scheme(problem) if scheme is None else scheme, uniform(20) if grid is None else grid,
        Ipopt() if solver is None else solver, guess, values,
        _Budget(seconds, elements, time.perf_counter()), finish,
    )  # fmt: skip


def _rungs(
    problem: Problem, wanted: Tolerance, scheme: Scheme, grid: Grid, solver: Ipopt,
    guess: GuessLike | Several[Any] | None, values: Mapping[str, float] | None, budget: _Budget,
    finish: Callable[[Solution], Solution] | None,
) -> Iterator[Solution]:  # fmt: skip
    history: list[float] = []
    result: Solution = solve(problem, scheme, grid, solver, guess, values)
    while True:
        errors = estimate(result)
        history.append(wanted.error(result, errors))
        rung = _told(result, wanted, errors, budget)
        if rung.accuracy is not None and rung.accuracy.met:
            yield _ended(rung, "the tolerance is met")
            return
        if finish is not None and result.status in USABLE:
            finished = finish(result)
            last = _told(finished, wanted, estimate(finished), budget) if finished.ok else rung
            if last.accuracy is not None and last.accuracy.error < history[-1]:
                yield rung
                if last.accuracy.met:
                    yield _ended(last, "the tolerance is met")
                    return
                rung = last
        stuck = result.status not in USABLE
        scheme, grid = (result.scheme, result.grid) if stuck else refine(result, wanted, errors)
        reason = result.status.value if stuck else budget.refuses(grid, result.timings.total, len(result.grid))
        if len(history) > STALLED and min(history[-STALLED:]) > 0.5 * min(history[:-STALLED]):
            reason = reason or f"the error has not been halved in {STALLED} rungs"
        if len(history) >= RUNGS:
            reason = reason or f"{RUNGS} rungs"
        yield _ended(rung, reason) if reason else rung
        if reason:
            return
        left = max(budget.seconds - budget.spent, 0.1)
        limited = replace(
            _tight(solver, result, max(wanted.tol, LATER * history[-1]) * errors.cost / history[-1]),
            max_seconds=min(solver.max_seconds, left),
        )
        result = _next(result, errors, scheme, grid, limited, values)


def _tight(solver: Ipopt, last: Solution, error: float) -> Ipopt:
    """Return settings that leave a tenth of an error: at the end each limit costs about the tolerance."""
    limits = 2 * (last.states.size + last.controls.size)
    return replace(solver, tol=float(np.clip(error / limits, TIGHTEST, solver.tol)))


def _told(solution: Solution, wanted: Tolerance, errors: Errors, budget: _Budget) -> Solution:
    error = wanted.error(solution, errors)
    return replace(solution, accuracy=Accuracy(error, wanted.tol, wanted.unit, wanted.what, budget.spent, errors))


def _ended(rung: Solution, reason: str) -> Solution:
    accuracy = None if rung.accuracy is None else replace(rung.accuracy, reason=reason)
    return replace(rung, accuracy=accuracy, message=f"{rung.message} ({accuracy})")


def _next(
    last: Solution, errors: Errors, scheme: Scheme, grid: Grid, solver: Ipopt, values: Mapping[str, float] | None
) -> Solution:
    """Return the next rung, continued from the last one, or from scratch where that fails or is worse."""
    problem = last.problem
    assert problem is not None
    prepared = prepare(problem, scheme, grid, solver, last, values)
    result: Solution = prepared.proceed(last, values)
    worst = last.cost + errors.cost
    usable = result.status in USABLE
    if usable and (result.cost <= worst or result.cost <= worst + estimate(result).cost):
        return result
    cold: Solution = prepared(None, values)
    best = min((one for one in (result, cold) if one.status in USABLE), key=lambda one: one.cost, default=cold)
    why = "lead to a worse optimum" if usable else "fail"
    return replace(
        best, iterations=result.iterations + cold.iterations,
        message=f"{best.message}; the multipliers of the rung before {why}, solved from scratch",
    )  # fmt: skip


def refine(solution: Solution, wanted: Tolerance, errors: Errors) -> tuple[Scheme, Grid]:
    """Return the scheme and the grid of the next rung.

    Args:
        solution: with its problem.
        wanted: the tolerance.
        errors: estimated.
    """
    parts, ends, count = wanted.parts(solution, errors), solution.grid.ends, len(solution.grid)
    allowed = SPARE * wanted.tol / count
    marked = parts > max(allowed, CONCENTRATED * float(np.max(parts)))
    if not marked.any():
        marked = parts >= np.max(parts)
    scheme = solution.scheme
    jumps = _jumps(solution, marked)
    spread = np.median(parts) > EVEN * np.max(parts) and not jumps
    if spread and scheme.control is Control.COLLOCATED and scheme.degree < HIGHEST:
        return SCHEMES[scheme.name](min(scheme.degree + 2, HIGHEST), scheme.control), solution.grid
    kept, added = np.ones(count + 1, dtype=bool), []
    done = np.zeros(count, dtype=bool)
    for first, last, places in jumps:
        kept[first + 1 : last] = False
        done[first:last] = True
        a, b = ends[first], ends[last]
        reach = (b - a) * float(np.clip(2.0 * (b - a), 0.02, 0.125))
        added += [one for place in places for one in (place - reach, place + reach) if 0.0 < one < 1.0]
    for k in np.flatnonzero(marked & ~done).tolist():
        pieces = int(np.clip(np.ceil((parts[k] / allowed) ** (1.0 / 3.0)), 2, MOST_PIECES))
        added += list(np.linspace(ends[k], ends[k + 1], pieces + 1)[1:-1])
    k = 1
    while k < count:
        pair = parts[k - 1] + parts[k]
        if not (marked[k - 1] or marked[k]) and pair < NEGLIGIBLE * allowed and ends[k + 1] - ends[k - 1] < WIDEST:
            kept[k] = False
            k += 1
        k += 1
    nodes = np.unique(np.concatenate([ends[kept], added]))
    apart = np.append(True, np.diff(nodes) > NARROWEST)
    apart[-1] = True
    return scheme, Grid(nodes[apart])


def _jumps(solution: Solution, marked: Array) -> list[tuple[int, int, list[float]]]:
    """Return (first, last, places) of runs of marked elements in which controls jump from limit to limit."""
    problem = solution.problem
    assert problem is not None
    nodes, weights = np.polynomial.legendre.leggauss(8)
    means = np.einsum("s,sc,kca->ka", weights / 2.0, solution.scheme.control_at((nodes + 1.0) / 2.0), solution.controls)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    span = np.where(np.isfinite(high - low), high - low, np.ptp(means, axis=0))
    ends, widths, count = solution.grid.ends, solution.grid.widths, len(solution.grid)
    results = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(int), [0]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first > LONGEST_RUN or first == 0 or last == count:
            continue
        places = []
        for i in range(means.shape[1]):
            before, after = means[first - 1, i], means[last, i]
            if abs(after - before) < 0.5 * span[i]:
                continue
            share = np.clip((means[first:last, i] - after) / (before - after), 0.0, 1.0)
            places.append(float(ends[first] + share @ widths[first:last]))
        if places:
            results.append((int(first), int(last), places))
    return results


def _scheme(problem: Problem) -> Scheme:
    system = problem.system
    curved = ca.depends_on(hamiltonian_of(problem).slope, system.u)
    bounded = np.all(np.isfinite(np.concatenate(problem.limits(Where.ALONG, system.u))))
    return radau(3, Control.COLLOCATED if curved or not bounded else Control.CONSTANT)
