"""Checks of the arguments of `prepare`, `solve` and `Prepared.attempt`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ocp import checks
from ocp.problem.problem import Problem, parameters
from ocp.problem.sequence import Sequence, phases_of
from ocp.solving.guess_conversion import as_guesses
from ocp.solving.nlp_solver import NlpSettings
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme


def check_settings(problem: object, scheme: object, grid: object, solver: object, compiled: object = False) -> None:
    """Raise TypeError unless there are a problem, a scheme, a grid and settings of a solver.

    Args:
        problem: a Problem or a Sequence.
        scheme: a Scheme.
        grid: a Grid.
        solver: settings that follow `NlpSettings`, such as Ipopt().
        compiled: True or False.
    """
    checks.truth("compiled", compiled)
    checks.instance("problem", problem, Problem | Sequence, "a Problem or a Sequence")
    checks.instance("scheme", scheme, Scheme, "a Scheme such as radau(3)")
    checks.instance("grid", grid, Grid, "a Grid such as uniform(50)")
    if isinstance(solver, type) or not isinstance(solver, NlpSettings):
        raise TypeError(f"solver: got {checks.shown(solver)}, expected settings of the solver, Ipopt(...)")


def check_multipliers(multipliers: object, sizes: tuple[int, int]) -> None:
    """Raise TypeError or ValueError unless there are multipliers of all bounds (nz,) and of all rows (ng,), or None."""
    wanted = "None, or multipliers of the bounds and of the rows"
    checks.instance("multipliers", multipliers, tuple | None, wanted)
    given: Any = multipliers
    if given is not None and tuple(np.size(part) for part in given) != sizes:
        raise checks.refused("multipliers", multipliers, wanted)


def check_attempt(problem: Problem | Sequence, guesses: object, values: object, warm: object, rung: object) -> None:
    """Raise TypeError or ValueError unless there are a guess and a list of parameter values for each phase.

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
