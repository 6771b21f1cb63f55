"""Magnitudes of the unknowns, taken from limits, ranges and the guess of the duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.constraint import Where
from ocp.guess import Guess
from ocp.problem import Problem
from ocp.system import slopes as slopes_of

Array = np.ndarray
NEGLIGIBLE = 1e-16  # share of the largest size below which a size is rounding


@dataclass(frozen=True, eq=False)
class Scaling:
    """Unknowns of the programme are physical ones divided by these; all powers of two, so that bounds stay exact."""

    x: Array  # (nx,)
    u: Array  # (nu,)
    horizon: float  # [s]
    free: Array  # (nf,) free parameters


def table(scaling: Scaling, problem: Problem) -> str:
    """Return the magnitudes in physical units, one line for each unknown.

    Args:
        scaling: of a programme, such as `prepared.compound.programmes[0].scaling`.
        problem: that it belongs to.
    """
    system = problem.system
    rows = [("duration", scaling.horizon, "s")]
    rows += [(label.name, s, label.unit) for label, s in zip(system.label("x", len(scaling.x)), scaling.x, strict=True)]
    rows += [(label.name, s, label.unit) for label, s in zip(system.label("u", len(scaling.u)), scaling.u, strict=True)]
    width = max(len(name) for name, _, _ in rows)
    return "\n".join(f"{name:{width}s}  {size:12.6g} {unit}".rstrip() for name, size, unit in rows)


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
    travelled = np.max(np.abs(guess.x), axis=0, initial=0.0)
    limited = magnitude(problem, system.x)
    p = ca.DM(list(values))
    function = slopes_of(system)
    # Rates at a handful of guessed states with every control at its lower and upper limit.
    places = guess.x[:: max(1, len(guess.x) // 4)]
    # A guess may keep a state still by terms that cancel; slightly other states show what its rate is made of.
    places = np.vstack([places, places * np.random.default_rng(1).uniform(0.95, 1.0, places.shape)])
    nu, count = system.u.numel(), len(places)
    held = np.zeros((nu, count)), ca.repmat(p, 1, count)
    slopes = np.abs(
        np.array(function.map(count)(places.T, *held)[2]).T.reshape(count, nu, len(limited)).transpose(0, 2, 1)
    )
    slopes[~np.isfinite(slopes)] = 0.0
    needed = np.where(np.isfinite(limited), limited, travelled) / guess.duration
    u = magnitude(problem, system.u)
    u = np.where(np.isfinite(u), u, _control_size(np.max(np.abs(guess.u), axis=0, initial=0.0), needed, slopes))
    corners = np.vstack([np.zeros(nu), np.eye(nu), -np.eye(nu)]) * u
    x_all, u_all = np.repeat(places, len(corners), axis=0), np.tile(corners, (count, 1))
    built = np.abs(np.array(function.map(len(x_all))(x_all.T, u_all.T, ca.repmat(p, 1, len(x_all)))[0]).T)
    built[~np.isfinite(built)] = 0.0
    reached = np.maximum(travelled, guess.duration / 4.0 * np.max(built, axis=0, initial=0.0))
    units = [label.unit for label in system.label("x", len(reached))]
    x = np.where(np.isfinite(limited), limited, _without_rounding(reached, units))
    parameters = np.abs([values[i] for i in free]) if len(free) else np.ones(0)
    return Scaling(_power_of_two(x), _power_of_two(u), float(_power_of_two(guess.duration)), _power_of_two(parameters))


def _without_rounding(reached: Array, units: list[str]) -> Array:
    """Replace sizes that are rounding beside the others by the largest with the same unit, or by one."""
    least = NEGLIGIBLE * np.max(reached, initial=0.0)
    same = [max(r for r, other in zip(reached, units, strict=True) if other == unit) for unit in units]
    alike = np.where(np.array(same) > least, same, 1.0) if len(same) else reached
    return np.where(reached > least, reached, alike)


def _control_size(guessed: Array, needed: Array, slopes: Array) -> Array:
    """Return the size of controls without limits: as guessed, or what moves the states through their ranges in time.

    A guess at rest needs no control, and then what it has is rounding and no magnitude.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        moving = needed[None, :, None] / slopes
    moving[~np.isfinite(moving) | (moving <= 0.0)] = np.inf
    least = np.min(moving, axis=(0, 1), initial=np.inf)
    degenerate = guessed < 1e-6 * np.where(np.isfinite(least), least, 1.0)
    return np.where(degenerate, np.where(np.isfinite(least), least, 1.0), guessed)


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
