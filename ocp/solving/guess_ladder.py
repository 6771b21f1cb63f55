"""The ladder of initial guesses: one after the other (a rung) is tried until one leads to a solution."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ocp.problem.constraints import Where
from ocp.problem.problem import Bolza, Fixed, Free, Problem
from ocp.problem.sequence import parameter_values, phases_of
from ocp.solution.integration_drift import collapsed
from ocp.solution.solution import Status, Timings
from ocp.solving.deadline import overdue
from ocp.solving.first_guesses import phase_guesses, straight_line
from ocp.solving.guess_conversion import AnySolution
from ocp.solving.guess_rungs import (
    CoarseGrid,
    LeastEffort,
    LongerDuration,
    OneTurn,
    Rung,
    Smooth,
    Solvable,
    StraightLine,
    Values,
    WiderLimits,
)
from ocp.solving.nlp_solver import limited
from ocp.solving.phase_solutions import added, lasting, timed
from ocp.transcription.guess import Guess

INSTANT = 0.02  # seconds within which a rung has found that it does not apply
PATIENCE = 30.0  # seconds after which the default ladder tries no further rung
ADVICE_ITERATIONS, ADVICE_SECONDS = 200, 10.0  # to find the shortest motion when a fixed duration seems too short

DEFAULT: tuple[Rung, ...] = (Smooth(), OneTurn(), StraightLine(), CoarseGrid(), LeastEffort(), WiderLimits())
AT_ONCE = LongerDuration()  # where a duration collapses or iterates diverge


def climb(prepared: Solvable, rungs: tuple[Rung, ...], values: Values) -> AnySolution:
    """Try rungs in order until one is solved; else return the attempt that violates its constraints least.

    Args:
        prepared: the NLP.
        rungs: in order.
        values: of parameters, by name.

    Returns:
        A solution with the seconds of all attempts; those of making a guess count as set-up.
    """
    begun, attempts = time.perf_counter(), list[Timings]()
    result = _climbed(prepared, rungs, values, attempts)
    spent = attempts[0]
    for more in attempts[1:]:
        spent = added(spent, more)
    return timed(result, lasting(spent, prepared.setup + time.perf_counter() - begun))


def _climbed(prepared: Solvable, rungs: tuple[Rung, ...], values: Values, attempts: list[Timings]) -> AnySolution:
    """Return the result of `climb`, with the seconds of its own attempt, and append those of all attempts."""

    def attempt(guesses: list[Guess], warm: bool, rung: str) -> AnySolution:
        result = prepared.attempt(guesses, numbers, warm, rung)
        attempts.append(result.timings)
        return result

    numbers = parameter_values(prepared.problem, values)
    best: AnySolution | None = None
    tried: list[str] = []
    begun = time.perf_counter()
    for rung in rungs:
        if tried and (overdue() or (rungs is DEFAULT and time.perf_counter() - begun > PATIENCE)):
            break
        started = time.perf_counter()
        made = rung(prepared, values)
        if made is None:
            late = time.perf_counter() - started > INSTANT
            tried += [f"{type(rung).__name__} (not solved itself)"] if late else []
            continue
        result = attempt(*made, type(rung).__name__)
        tried.append(type(rung).__name__)
        if rungs is DEFAULT and type(AT_ONCE).__name__ not in tried and _runs_away(result):
            slower = AT_ONCE(prepared, values)
            tried.append(type(AT_ONCE).__name__)
            again = result if slower is None else attempt(*slower, tried[-1])
            result = again if again.ok else result
        if result.ok:
            return result
        if best is None or _infeasibility(result) < _infeasibility(best):
            best = result
        if result.solver_status == "not started" and result.status is Status.INFEASIBLE:
            return result
        if result.status is Status.STOPPED:
            return result
        # Diverging iterates may come from the guess; controls without bounds that make a motion ever shorter do not.
        if result.status is Status.UNBOUNDED and (_without_bounds(prepared) or rungs is not DEFAULT):
            return result
    if best is None:
        guesses = phase_guesses(prepared.problem, numbers, straight_line)
        return attempt(guesses, False, "StraightLine")
    advice = _shortest(prepared, values) if isinstance(prepared.problem, Problem) else ""
    return replace(best, message=f"{best.message}{advice} (guesses tried: {', '.join(tried)})")


def _without_bounds(prepared: Solvable) -> bool:
    """Return whether a motion of minimum time has no bounds on its controls: diverging iterates are then expected."""
    if not any(one.minimise.time > 0.0 for one in phases_of(prepared.problem)):
        return False
    limits = [np.concatenate(one.limits(Where.ALONG, one.system.u)) for one in phases_of(prepared.problem)]
    return not any(np.isfinite(one).any() for one in limits)


def _shortest(prepared: Solvable, values: Values) -> str:
    """Return a sentence with the shortest duration within the same limits if the fixed one is shorter; else nothing."""
    problem = prepared.problem
    if not isinstance(problem, Problem) or not isinstance(problem.horizon, Fixed) or overdue():
        return ""
    asked = problem.horizon.duration
    limits = np.concatenate(problem.limits(Where.ALONG, problem.system.u))
    if not np.all(np.isfinite(limits)):
        return ""  # nothing keeps the motion from being arbitrarily short
    brief = limited(prepared.settings, ADVICE_ITERATIONS, ADVICE_SECONDS)
    fastest = replace(problem, horizon=Free(guess=asked), minimise=Bolza(time=1.0))
    result = prepared.on(fastest, prepared.grid, brief, values)((Smooth(),), values)
    if not result.ok or result.duration <= asked:
        return ""
    return f"; the shortest motion found within these limits takes {result.duration:.4g} s, {asked:.4g} s were asked"


def _runs_away(result: AnySolution) -> bool:
    """Return whether the iterates diverged or a free duration shrank to zero."""
    phases = result.phases if hasattr(result, "phases") else (result,)
    return result.status is Status.UNBOUNDED or any(map(collapsed, phases))


def _infeasibility(solution: AnySolution) -> float:
    log = solution.phases[0].log if hasattr(solution, "phases") else solution.log
    column = log.get("inf_pr", [])
    return float(column[-1]) if len(column) else np.inf
