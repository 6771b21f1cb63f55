"""What is refined, how accurately, and what it may spend: seconds and elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ocp.accuracy.tolerances import Tolerance
from ocp.problem.problem import Problem
from ocp.solution.accuracy import Accuracy, Errors
from ocp.solution.solution import Solution
from ocp.solving.deadline import within
from ocp.solving.ipopt import Ipopt
from ocp.solving.solver import solve
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

FIRST = 2.0  # seconds that the first step has in any case


@dataclass(frozen=True, eq=False)
class Budget:
    """Seconds since a beginning, and elements of a grid.

    Args:
        seconds: of wall-clock time [s].
        elements: of the largest grid.
        begun: time.perf_counter() at the beginning.
    """

    seconds: float
    elements: int
    begun: float

    @property
    def spent(self) -> float:
        """Seconds since the beginning."""
        return time.perf_counter() - self.begun

    @property
    def left(self) -> float:
        """Seconds until the budget is spent."""
        return self.seconds - self.spent

    @property
    def of_first(self) -> float:
        """Seconds that the first step may still take."""
        return max(self.seconds, FIRST) - self.spent

    def refuses(self, grid: Grid, last: float, now: int) -> str:
        """Return why a further step does not fit; empty if it does.

        Args:
            grid: of the next step.
            last: seconds of the last step, with the estimate of its error.
            now: elements of the last step.
        """
        if len(grid) > self.elements:
            return f"the next grid would have {len(grid)} elements, {self.elements} are allowed"
        if self.spent + last * len(grid) / max(now, 1) > self.seconds:
            return f"the next step would not end within {self.seconds:g} s"
        return ""


@dataclass(frozen=True, eq=False)
class RefinementTask:
    """What is refined, and how: the same for all steps."""

    problem: Problem
    wanted: Tolerance
    solver: Ipopt
    values: Mapping[str, float] | None
    budget: Budget
    finish: Callable[[Solution], Solution] | None

    def timed(self, tol: float, share: float = 1.0) -> Ipopt:
        """Return settings of one solve with a tolerance `tol` and a share of the seconds that are left."""
        seconds = min(self.solver.max_seconds, max(share * self.budget.left, 0.1))
        return replace(self.solver, tol=tol, max_seconds=seconds)

    def solved(self, scheme: Scheme | None, grid: Grid | None, guess: Any) -> Solution:
        """Return the solution of a first step, as far as it comes within the seconds of the budget."""
        with within(self.budget.of_first):
            result: Solution = solve(self.problem, scheme, grid, self.solver, guess, self.values)
        return result

    def rated(self, solution: Solution, errors: Errors) -> Solution:
        """Return a solution with its accuracy."""
        wanted, error = self.wanted, self.wanted.error(solution, errors)
        accuracy = Accuracy(error, wanted.tol, wanted.unit, wanted.what, self.budget.spent, errors)
        return replace(solution, accuracy=accuracy)
