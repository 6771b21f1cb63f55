"""States that a guess may leave out: the time, and integrals of the others."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

import casadi as ca
import numpy as np

from ocp.numerics.evaluation import mapped
from ocp.problem.integral_constraints import integrands, without_integrals
from ocp.problem.problem import Bolza, Problem
from ocp.system import System
from ocp.transcription.guess import Guess


def completed(system: System, guess: Guess, values: Sequence[float] | None = None) -> Guess:
    """Return a guess with the time and the integrals of a system, where it has them and the guess leaves them out.

    Args:
        system: of the problem.
        guess: with all states, or without the integrals, or without integrals and time.
        values: of the parameters; None for nominal ones.
    """
    integrals, clock = system.integrals, system.clock
    missing = system.x.numel() - guess.x.shape[1]
    if clock >= 0 and missing == integrals + 1:
        guess = replace(guess, x=np.insert(guess.x, clock, guess.share * guess.duration, axis=1))
        missing -= 1
    if not integrals or missing != integrals:
        return guess
    p = np.tile(np.array(system.values() if values is None else values, dtype=float)[:, None], len(guess.share))
    rate = np.array(mapped(integrands(system), len(guess.share))(guess.x.T, guess.u.T, p)).T
    steps = np.diff(guess.share)[:, None] * guess.duration * (rate[:-1] + rate[1:]) / 2.0
    y = np.vstack([np.zeros((1, integrals)), np.cumsum(steps, axis=0)])
    return replace(guess, x=np.hstack([guess.x, y]))


Make = TypeVar("Make", bound=Callable[..., Guess])


def of_main_states(make: Make) -> Make:
    """Return a function that makes the guess without the states that are integrals, and adds them afterwards."""

    @functools.wraps(make)
    def made(problem: Problem, values: Sequence[float], *more: Any) -> Guess:
        if not (isinstance(problem, Problem) and problem.system.integrals):
            return make(problem, values, *more)
        return completed(problem.system, make(_main(problem), values, *more), values)

    return cast(Make, made)


@functools.lru_cache(maxsize=16)
def _main(problem: Problem) -> Problem:
    """Return a problem without integrals and what depends on them."""
    system, cost = problem.system, problem.minimise
    y = system.x[system.x.numel() - system.integrals :]

    def kept(part: ca.SX) -> ca.SX:
        return ca.SX(0) if ca.depends_on(part, y) else part

    minimise = Bolza(cost.time, *map(kept, (cost.running, cost.final, cost.initial)))
    constraints = tuple(c for c in problem.subject_to if not ca.depends_on(c.expression, y))
    return Problem(without_integrals(system), problem.horizon, minimise, constraints)
