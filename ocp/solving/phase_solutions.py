"""An answer of the solver becomes the solution of every phase."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import replace

import numpy as np

from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.violations import touched
from ocp.solving.nlp_solver import NlpResult
from ocp.transcription.nlp import Nlp
from ocp.transcription.packing import unpack


def solutions_of(
    answer: NlpResult, nlps: Several[Nlp], values: list[list[float]], timings: Timings, rung: str
) -> list[Solution]:
    """Return the solution of every phase; failed where the motion steps over a singularity of its system.

    Args:
        answer: of all phases together.
        NLPs: of the phases.
        values: of the parameters of each phase.
        timings: of the solve.
        rung: what the guess is called.
    """
    sizes = np.cumsum([p.layout.size for p in nlps])[:-1]
    zs, limits = np.split(answer.z, sizes), np.split(answer.limits, sizes)
    mus = np.split(answer.multipliers, np.cumsum([p.rows for p in nlps]))
    results = []
    for nlp, z, mu, held, numbers in zip(nlps, zs, mus, limits, values, strict=False):
        motion = unpack(nlp, z, mu, held, numbers)
        results.append(
            Solution(
                answer.status, answer.status.value, answer.verbatim, motion.duration, answer.cost, motion.states,
                motion.controls, motion.slopes, motion.costates, motion.free, motion.values, timings,
                answer.iterations, nlp.grid, nlp.scheme, nlp.problem, rung, answer.log,
                motion.multipliers,
            )
        )  # fmt: skip
    if answer.status in (Status.SOLVED, Status.ACCEPTABLE) and any(touched(results)):
        # The equations hold at nodes on both sides, and have no meaning between.
        results = [replace(solution, status=Status.FAILED) for solution in results]
    return results
