"""Conversion of the result of the NLP solver to the solution of every phase, and the seconds of several solves."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import astuple, replace

import numpy as np

from ocp.solution.integration_drift import collapsed
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.violations import touched
from ocp.solving.guess_conversion import AnySolution
from ocp.solving.nlp_solver import NlpResult
from ocp.solving.whole_turns import without_whole_turns
from ocp.transcription.nlp import Nlp
from ocp.transcription.packing import unpack


def solutions_of(
    result: NlpResult, nlps: Several[Nlp], values: list[list[float]], timings: Timings, rung: str
) -> list[Solution]:
    """Return the solution of every phase; failed if the motion crosses a singularity of its system.

    Args:
        result: of the NLP of all phases.
        nlps: of the phases.
        values: of the parameters of each phase.
        timings: of the solve.
        rung: name of the initial guess.
    """
    sizes = np.cumsum([p.layout.size for p in nlps])[:-1]
    zs, limits = np.split(result.z, sizes), np.split(result.limits, sizes)
    rows = np.split(result.multipliers, np.cumsum([p.rows for p in nlps]))
    results = []
    for nlp, z, own, held, numbers in zip(nlps, zs, rows, limits, values, strict=False):
        motion = unpack(nlp, z, own, held, numbers)
        found = Solution(
            result.status, result.status.value, result.verbatim, motion.duration, result.cost, motion.states,
            motion.controls, motion.slopes, motion.costates, motion.free, motion.values, timings,
            result.iterations, nlp.grid, nlp.scheme, nlp.problem, rung, result.log,
            motion.multipliers,
        )  # fmt: skip
        results.append(without_whole_turns(found))
    if result.status in (Status.SOLVED, Status.ACCEPTABLE) and any(touched(results)):
        # The collocation equations are satisfied on both sides of the singularity, but the motion between is undefined.
        results = [replace(solution, status=Status.FAILED) for solution in results]
    if result.status in (Status.SOLVED, Status.ACCEPTABLE) and any(collapsed(one) for one in results):
        results = [replace(solution, status=Status.FAILED) for solution in results]
    return results


def timed(result: AnySolution, timings: Timings) -> AnySolution:
    """Return a solution with other seconds, also those of its phases; a message that nobody has read stays unread.

    Args:
        result: of a problem or a sequence.
        timings: of all solves that led to it.
    """
    changes = {"timings": timings, "message": vars(result)["message"]}
    if isinstance(result, SequenceSolution):
        changes["phases"] = tuple(timed(phase, timings) for phase in result.phases)
    return replace(result, **changes)


def added(timings: Timings, more: Timings) -> Timings:
    """Return the sum of the seconds of a solve and those of what was done afterwards."""
    return Timings(*(a + b for a, b in zip(astuple(timings), astuple(more), strict=True)))


def lasting(timings: Timings, seconds: float) -> Timings:
    """Return the same seconds in derivatives and solver as part of a total; the rest of it counts as set-up."""
    inside = timings.derivatives + timings.solver
    return Timings(max(seconds - inside, 0.0), timings.derivatives, timings.solver, max(seconds, inside))
