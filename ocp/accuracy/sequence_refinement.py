"""Refinement of a sequence: solved once, then refined as one problem in which its phases run in parallel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ocp.accuracy.tolerances import Seconds, Tolerance
from ocp.checks import Array
from ocp.problem.parallel_phases import ParallelPhases
from ocp.problem.problem import Problem
from ocp.solution.accuracy import Errors
from ocp.solution.parallel_solution import as_sequence, with_sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status

Refine = Callable[[Problem, Tolerance, Solution, Mapping[str, float]], Iterator[Solution]]


@dataclass(frozen=True, eq=False)
class _Total:
    """The duration of all phases together, for solutions of the phases in parallel [s]."""

    tol: float
    parallel: ParallelPhases
    unit: str = "s"
    what: str = "optimal duration"

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the error of the duration [s]."""
        order = 1.0 if self.parallel.timed else float(solution.scheme.order)
        total = sum(solution.values[part.duration] for part in self.parallel.parts)
        return order * total * errors.cost / errors.cost_scale

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the part of every element (N,) in it."""
        return np.asarray(errors.elements * (self.error(solution, errors) / max(errors.cost, 1e-300)))


def refined(first: SequenceSolution, wanted: Tolerance, refine: Refine) -> Iterator[SequenceSolution]:
    """Yield the steps of the refinement of a sequence; only the first solution if it is not solved.

    Args:
        first: of the sequence, on the first grid.
        wanted: the tolerance.
        refine: (problem, tolerance, first solution, parameter values) -> steps.
    """
    if first.status not in (Status.SOLVED, Status.ACCEPTABLE):
        yield first
        return
    one, parallel = with_sequence("solve_to_accuracy", first)
    tolerance = _Total(wanted.tol, parallel) if isinstance(wanted, Seconds) else wanted
    for step in refine(parallel.problem, tolerance, one, one.values):
        yield as_sequence(step, parallel)
