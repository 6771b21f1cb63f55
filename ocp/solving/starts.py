"""The phases of a problem or a sequence: their parameter values and their guesses."""

from __future__ import annotations

import os
from collections.abc import Callable
from collections.abc import Sequence as Several
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ocp import checks
from ocp.problem.constraints import start
from ocp.problem.problem import Problem, parameters
from ocp.problem.sequence import Sequence, phases_of
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.storage import load
from ocp.solving.ipopt import Ipopt
from ocp.transcription.grid import Grid
from ocp.transcription.guess import Guess
from ocp.transcription.schemes.scheme import Scheme

Start = Guess | Solution | SequenceSolution | str | os.PathLike[str]
Outcome = Any  # Solution for a Problem, SequenceSolution for a Sequence
STARTS = (Guess, Solution, SequenceSolution, str, os.PathLike)


def is_ladder(guess: Any) -> bool:
    """Return whether a guess is a ladder of rungs (see `ocp.solving.guess_ladder`)."""
    rungs = isinstance(guess, list | tuple) and len(guess) > 0 and not isinstance(guess[0], STARTS)
    return rungs and all(callable(rung) and not isinstance(rung, type) for rung in guess)


def as_guesses(problem: Problem | Sequence, guess: Start | Several[Any]) -> list[Guess]:
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
        one = known if isinstance(known, Guess) else from_solution(known)
        sizes = one.x.shape[1], one.u.shape[1]
        if sizes != (phase.system.x.numel(), phase.system.u.numel()):
            expected = phase.system.x.numel(), phase.system.u.numel()
            raise ValueError(f"guess: has (nx, nu) = {sizes}, the system has {expected}")
        made.append(one)
    return made


def check_settings(problem: object, scheme: object, grid: object, solver: object, compiled: object = False) -> None:
    """Raise TypeError unless a solve is given a problem, a scheme, a grid, settings, and whether to compile."""
    checks.truth("compiled", compiled)
    checks.instance("problem", problem, Problem | Sequence, "a Problem or a Sequence")
    checks.instance("scheme", scheme, Scheme, "a Scheme such as radau(3)")
    checks.instance("grid", grid, Grid, "a Grid such as uniform(50)")
    checks.instance("solver", solver, Ipopt, "settings of the solver, Ipopt(...)")


def check_duals(duals: object, sizes: tuple[int, int]) -> None:
    """Raise TypeError or ValueError unless there are multipliers of all bounds (nz,) and of all rows (ng,)."""
    wanted = "None, or multipliers of the bounds and of the rows"
    checks.instance("duals", duals, tuple | None, wanted)
    if duals is not None and tuple(np.size(part) for part in duals) != sizes:  # type: ignore[attr-defined]
        raise checks.refused("duals", duals, wanted)


def check_attempt(problem: Problem | Sequence, guesses: object, values: object, warm: object, rung: object) -> None:
    """Raise TypeError or ValueError unless there is a guess and a list of parameter values for each phase.

    Args:
        problem: with its phases.
        guesses: one Guess for each.
        values: as `parameter_values` returns them.
        warm: True or False.
        rung: a text.
    """
    checks.truth("warm", warm)
    checks.text("rung", rung)
    wanted = "the parameter values of every phase, as numbers(values) returns them"
    phases = phases_of(problem)
    checks.instance("guesses", guesses, list | tuple, "one Guess for each phase")
    as_guesses(problem, guesses)  # type: ignore[arg-type]
    checks.instance("values", values, list | tuple, wanted)
    each: Any = values
    if len(each) != len(phases):
        raise checks.refused("values", values, wanted)
    for phase, given in zip(phases, each, strict=True):
        parameters(phase, given)


def from_solution(solution: Solution) -> Guess:
    """Return a solution as a guess, sampled where it is smooth: at its points, and on both sides of each end."""
    inside = np.concatenate([[1e-6], solution.scheme.points[solution.scheme.points % 1.0 > 0.0], [1.0 - 1e-6]])
    ends, widths = solution.grid.ends, solution.grid.widths
    share = np.concatenate([[0.0], (ends[:-1, None] + widths[:, None] * inside).ravel(), [1.0]])
    t = share * solution.duration
    free = np.array(list(solution.free.values()))
    return Guess(share, solution.x(t), solution.u(t), solution.duration, free)


def chain(
    problem: Problem | Sequence, values: list[list[float]], make: Callable[[Problem, Several[float]], Guess]
) -> list[Guess]:
    """Return one guess for each phase, each beginning where the one before it ends.

    Args:
        problem: a Problem, or a Sequence whose links say what is continuous.
        values: of the parameters of each phase.
        make: straight_line or smooth.
    """
    if isinstance(problem, Problem):
        return [make(problem, values[0])]
    guesses = [make(problem.problems[0], values[0])]
    for k, phase in enumerate(problem.problems[1:]):
        before, after = problem.sides[k]
        old = problem.problems[k].system
        reached = ca.Function("reached", [old.x, old.p], [ca.densify(before)])(guesses[-1].x[-1], values[k])
        there = replace(phase, subject_to=(*phase.subject_to, start(after, np.array(reached).ravel())))
        guesses.append(make(there, values[k + 1]))
    return guesses
