"""Whatever a user gives as an initial guess becomes one Guess for each phase."""

from __future__ import annotations

import os
from collections.abc import Sequence as Several
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ocp import checks
from ocp.problem.problem import Fixed, Problem
from ocp.problem.sequence import Sequence, phases_of
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.storage import load
from ocp.solving.guess_completion import completed
from ocp.transcription.guess import Guess

GuessLike = Guess | Solution | SequenceSolution | str | os.PathLike[str]
KINDS = (Guess, Solution, SequenceSolution, str, os.PathLike)
AnySolution = Any  # Solution for a Problem, SequenceSolution for a Sequence


def is_ladder(guess: Any) -> bool:
    """Return whether a guess is a ladder of rungs (see `ocp.solving.guess_ladder`)."""
    rungs = isinstance(guess, list | tuple) and len(guess) > 0 and not isinstance(guess[0], KINDS)
    return rungs and all(callable(rung) and not isinstance(rung, type) for rung in guess)


def as_guesses(problem: Problem | Sequence, guess: GuessLike | Several[Any]) -> list[Guess]:
    """Return one Guess for each phase.

    Raises:
        TypeError, ValueError: not a guess, or one of another size.
    """
    if isinstance(guess, SequenceSolution):
        parts: Several[Any] = guess.phases
    else:
        parts = guess if isinstance(guess, list | tuple) else [guess]
    wanted = phases_of(problem)
    if len(parts) != len(wanted):
        raise ValueError(f"guess: has {len(parts)} parts, the problem has {len(wanted)} phases; give one for each")
    made = []
    for phase, part in zip(wanted, parts, strict=True):
        try:
            known = load(part) if isinstance(part, str | os.PathLike) and Path(part).is_file() else part
        except ValueError as error:
            raise ValueError(f"guess: {error}") from None
        described = "a Guess, a solution, its file, a ladder of rungs or None"
        checks.instance("guess", known, Guess | Solution, described)
        one = completed(phase.system, known if isinstance(known, Guess) else from_solution(known))
        if one.duration == 0.0:  # of a motion without a way to go, which says nothing about the next one
            horizon = phase.horizon
            one = replace(one, duration=horizon.duration if isinstance(horizon, Fixed) else horizon.guess)
        sizes = one.x.shape[1], one.u.shape[1]
        if sizes != (phase.system.x.numel(), phase.system.u.numel()):
            expected = phase.system.x.numel(), phase.system.u.numel()
            raise ValueError(f"guess: has (nx, nu) = {sizes}, the system has {expected}")
        made.append(one)
    return made


def from_solution(solution: Solution, more: int = 0) -> Guess:
    """Return a solution as a guess, sampled where it is smooth: at its points, and on both sides of each end.

    Args:
        solution: of one phase.
        more: samples between the ends of every element, for grids with other elements; 0 for its points only.
    """
    points = (np.arange(more) + 1.0) / (more + 1.0) if more else solution.scheme.points
    inside = np.concatenate([[1e-6], points[points % 1.0 > 0.0], [1.0 - 1e-6]])
    ends, widths = solution.grid.ends, solution.grid.widths
    share = np.concatenate([[0.0], (ends[:-1, None] + widths[:, None] * inside).ravel(), [1.0]])
    t = share * solution.duration
    free = np.array(list(solution.free.values()))
    if solution.duration == 0.0:
        x, u = solution.states[:1, 0], solution.controls[:1, 0]
        return Guess(np.array([0.0, 1.0]), np.repeat(x, 2, axis=0), np.repeat(u, 2, axis=0), 0.0, free)
    return Guess(share, solution.x(t), solution.u(t), solution.duration, free)


def is_fresh(guess: Any) -> bool:
    """Return whether a guess is made of Guess objects only: a rough motion, not a solution."""
    return all(isinstance(part, Guess) for part in (guess if isinstance(guess, list | tuple) else [guess]))
