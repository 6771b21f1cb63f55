"""Prepare and solve: a problem, or a sequence of them, becomes a solution."""

from __future__ import annotations

import time
from collections.abc import Mapping
from collections.abc import Sequence as Several
from dataclasses import replace
from typing import Any

from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.solution import Status
from ocp.solving.between_nodes import held_between_nodes
from ocp.solving.guess_conversion import AnySolution, GuessLike
from ocp.solving.guess_rungs import Smooth, StraightLine, WiderLimits
from ocp.solving.nlp_solver import NlpSettings
from ocp.solving.phase_solutions import added, lasting, timed
from ocp.solving.prechecks import warnings_before
from ocp.solving.prepared_nlp import prepare
from ocp.solving.resolving_grid import resolved
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme


def solve(
    problem: Problem | Sequence,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: NlpSettings | None = None,
    guess: GuessLike | Several[Any] | None = None,
    values: Mapping[str, float] | None = None,
) -> AnySolution:
    """Solve a problem by direct collocation and return a solution, also if the solve fails.

    Constraints are rows of the NLP at the nodes. Where the motion exceeds a nonlinear limit of states, such as an
    obstacle, between them, the grid is refined there and the problem solved again. The default grid is refined as well
    where it does not resolve the motion, such as dry friction where a velocity reverses (`resolved`). The message says
    so.

    Args:
        problem: a Problem, or a Sequence of them.
        scheme: default radau(3), constant controls.
        grid: one that is given is kept where the motion is not resolved; default uniform(50), refined there.
        solver: settings, default Ipopt().
        guess: a Guess, a solution of the same system (on any grid) or its file, or a ladder of rungs; None for the
            default ladder: a smooth motion, angles within one turn, the straight line, a coarse grid, least effort,
            wider limits, until one is solved.
        values: of parameters, by name; nominal for the others.

    Returns:
        Solution of a Problem, SequenceSolution of a Sequence; `rung` says which guess led to it.

    Raises:
        TypeError, ValueError: wrong input, named. A solve that fails raises nothing: see status and message.
    """
    begun = time.perf_counter()
    prepared = prepare(problem, scheme, grid, solver, guess, values)
    warnings = warnings_before(problem, prepared.numbers(values))
    improbable = warnings and guess is None
    # No long search for a motion that is probably impossible; one with wider limits shows whether it is.
    result = prepared((Smooth(), StraightLine()) if improbable else guess, values)
    if improbable and not (result.ok or result.status is Status.STOPPED or result.solver_status == "not started"):
        wider = prepared((WiderLimits(),), values)
        tried = result.message.removesuffix(")") + ", WiderLimits)"
        spent = added(result.timings, wider.timings)
        result = timed(wider if wider.ok else replace(result, message=tried), spent)
    result = held_between_nodes(result, problem, scheme, solver, values)
    result = resolved(result, solver, values) if grid is None and result.ok else result
    result = timed(result, lasting(result.timings, time.perf_counter() - begun))
    return replace(result, message=f"{result.message}; but {'; '.join(warnings)}") if warnings and result.ok else result
