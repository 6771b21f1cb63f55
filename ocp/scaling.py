"""Magnitudes of the unknowns, taken from limits, ranges and the guess of the duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.guess import Guess
from ocp.problem import Problem, Where

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Scaling:
    """Unknowns of the programme are physical ones divided by these; all powers of two, so that bounds stay exact."""

    x: Array  # (nx,)
    u: Array  # (nu,)
    horizon: float  # [s]
    free: Array  # (nf,) free parameters


def unscaled(problem: Problem, free: int) -> Scaling:
    """Return the scaling that leaves every unknown in its physical unit."""
    system = problem.system
    return Scaling(np.ones(system.x.numel()), np.ones(system.u.numel()), 1.0, np.ones(free))


def from_limits(problem: Problem, guess: Guess, values: Sequence[float], free: Array) -> Scaling:
    """Return the scaling of a problem.

    A control is scaled by its limit; a state by the largest of its limits, its range in the guess and, where neither
    speaks, what its rate builds up in a quarter of the guessed duration with the controls at their limits.

    Args:
        problem: the problem.
        guess: its first guess.
        values: of the parameters.
        free: (nf,) numbers of the parameters that are unknowns.
    """
    system = problem.system
    u = magnitude(problem, system.u)
    u = np.where(np.isfinite(u), u, np.max(np.abs(guess.u), axis=0, initial=0.0))
    x = magnitude(problem, system.x)
    travelled = np.max(np.abs(guess.x), axis=0, initial=0.0)
    # Rates at a handful of guessed states with every control at its lower and upper limit.
    rate = ca.Function("rate", [system.x, system.u], [ca.substitute(system.rate, system.p, ca.DM(list(values)))])
    corners = [signs * u for signs in np.vstack([np.zeros(len(u)), np.eye(len(u)), -np.eye(len(u))])]
    rates = [np.abs(np.array(rate(xk, uk))).ravel() for xk in guess.x[:: max(1, len(guess.x) // 4)] for uk in corners]
    built = np.array(rates)
    built[~np.isfinite(built)] = 0.0
    reached = np.maximum(travelled, guess.duration / 4.0 * np.max(built, axis=0, initial=0.0))
    x = np.where(np.isfinite(x), x, reached)
    parameters = np.abs([values[i] for i in free]) if len(free) else np.ones(0)
    return Scaling(_power_of_two(x), _power_of_two(u), float(_power_of_two(guess.duration)), _power_of_two(parameters))


def magnitude(problem: Problem, symbols: ca.SX) -> Array:
    """Return the largest finite limit along the motion of each symbol; inf where there is none."""
    sides = np.abs(np.stack(problem.limits(Where.ALONG, symbols)))
    sides[~np.isfinite(sides)] = 0.0
    largest = np.max(sides, axis=0)
    return np.where(largest > 0.0, largest, np.inf)


def _power_of_two(value: Array | float) -> Array:
    value = np.asarray(value, dtype=float)
    sane = np.isfinite(value) & (value > 1e-100) & (value < 1e100)
    return np.where(sane, 2.0 ** np.round(np.log2(np.where(sane, value, 1.0))), 1.0)
