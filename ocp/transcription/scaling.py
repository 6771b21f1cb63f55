"""Scales of the unknowns, the cost and the constraint rows, from bounds, ranges and the initial guess."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import largest_of_unit, probes
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import slopes as slopes_of
from ocp.problem.constraints import Where, single_symbols
from ocp.problem.problem import Problem
from ocp.transcription.guess import Guess

NEGLIGIBLE = 1e-14  # a scale below this share of the largest one is rounding error
COST = 8.0  # scaled cost of the initial guess: IPOPT's first barrier parameter, 0.1, is then about 1/100 of it
OFFSET = 1e-5  # smallest scale of a changing state, relative to its value
STILL = 1e-12  # a state whose range is below this share of its value counts as constant
IDLE = 1e3  # a bound that is larger than the range of the guess by more than this factor does not set the scale
LEAST_COST = 1e-3  # smallest scale of the cost, relative to the cost with states and controls at their scales


@dataclass(frozen=True, eq=False)
class Scaling:
    """Scales by which physical unknowns, cost and constraint rows are divided to give those of the NLP.

    All are powers of two, so that bounds stay exact.
    """

    x: Array  # (nx,)
    u: Array  # (nu,)
    horizon: float  # [s]
    free: Array  # (nf,) free parameters
    cost: float = 1.0
    limits: tuple[Array, ...] = ()  # of the components of every constraint; empty: all are 1

    def of_constraint(self, constraint: int, component: int) -> float:
        """Return the scale of one component of a constraint."""
        return float(self.limits[constraint][component]) if self.limits else 1.0


def table(scaling: Scaling, problem: Problem) -> str:
    """Return the scales in physical units as a table with one line for each unknown.

    Args:
        scaling: of an NLP, such as `prepared.joined.nlps[0].scaling`.
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

    A control is scaled by its bound; a state by its bound or its range in the guess or, without either, by the change
    that its rate causes within a quarter of the guessed duration with the controls at their bounds. A bound more than
    1000 times larger than the guess needs is ignored. The cost is scaled by that of the guess, a constrained
    expression by its bound and by its largest value for states and controls at their scales. The scaled NLP is
    therefore the same in every system of units.

    Args:
        problem: the problem.
        guess: its first guess.
        values: of the parameters.
        free: (nf,) numbers of the parameters that are unknowns.
    """
    system = problem.system
    # A motion that is small compared with the values of its states is resolved as far as rounding allows; a constant
    # state is scaled by its value.
    ranges, value = (np.max(np.abs(x), axis=0, initial=0.0) for x in (guess.x - guess.x[0], guess.x))
    travelled = np.where(ranges > STILL * value, np.maximum(ranges, OFFSET * value), value)
    limited = largest_bound(problem, system.x)
    p, function = np.array(values, dtype=float), slopes_of(system)
    # Rates at a handful of guessed states with every control at its lower and upper limit.
    points = guess.x[:: max(1, len(guess.x) // 4)]
    # In the guess, terms of a rate may cancel; slightly different states show how large they are.
    points = np.vstack([points, points * probes(points.shape, 0.95, 1.0)])
    nu, count = system.u.numel(), len(points)
    lower, upper = problem.limits(Where.ALONG, system.u)
    by_u = evaluate(function, points, _within(np.zeros(nu), lower, upper), p)[2]
    slopes = np.abs(by_u.reshape(count, nu, len(limited)).transpose(0, 2, 1))
    slopes[~np.isfinite(slopes)] = 0.0
    units = [label.unit for label in system.label("x", len(limited))]
    needed = np.where(np.isfinite(limited), limited, travelled) / guess.duration
    guessed = np.max(np.abs(guess.u), axis=0, initial=0.0)
    used = _control_scale(guessed, needed, slopes)
    used = _without_rounding(used, [label.unit for label in system.label("u", len(used))])
    most = np.maximum(
        guessed, _control_scale(0.0 * guessed, largest_of_unit(travelled, units) / guess.duration, slopes)
    )
    u = largest_bound(problem, system.u)
    idle = (most > NEGLIGIBLE * u) & (IDLE * most < u)
    u = np.where(np.isfinite(u), np.where(idle, IDLE * most, u), used)
    # Rates with controls beyond their limits may be anything: a reaction at a negative temperature.
    corners = _within(np.vstack([np.zeros(nu), np.eye(nu), -np.eye(nu)]) * u, lower, upper)
    x_all, u_all = np.repeat(points, len(corners), axis=0), np.tile(corners, (count, 1))
    built = np.abs(evaluate(function, x_all, u_all, p)[0])
    built[~np.isfinite(built)] = 0.0
    reached = np.maximum(travelled, guess.duration / 4.0 * np.max(built, axis=0, initial=0.0))
    reached = _without_rounding(reached, units)
    x = np.where(np.isfinite(limited), np.minimum(limited, IDLE * reached), reached)
    parameters = np.abs([values[i] for i in free]) if len(free) else np.ones(0)
    return Scaling(
        _power_of_two(x), _power_of_two(u), float(_power_of_two(guess.duration)), _power_of_two(parameters),
        float(_power_of_two(_cost_scale(problem, guess, p, (x, u)) / COST)),
        tuple(_constraint_scales(problem, guess, p, (x, u))),
    )  # fmt: skip


def common(scalings: Sequence[Scaling]) -> list[Scaling]:
    """Return the scalings of phases with one common scale for the sum of their costs."""
    cost = float(_power_of_two(sum(scaling.cost for scaling in scalings)))
    return [replace(scaling, cost=cost) for scaling in scalings]


def expression_scales(
    expression: ca.SX, problem: Problem, guess: Guess, values: Sequence[float], scaling: Scaling
) -> Array:
    """Return the scales (m,) of an expression from those of the states and controls that it depends on."""
    p = np.array(values, dtype=float)
    return _power_of_two(_largest_change(expression, problem, guess, p, (scaling.x, scaling.u)))


def _largest_change(expression: ca.SX, problem: Problem, guess: Guess, p: Array, corner: tuple[Array, Array]) -> Array:
    """Return the largest change (m,) of an expression along a guess, to first order, by one scale of all x and u."""
    slope = ca.jacobian(ca.vec(expression), ca.vertcat(problem.system.x, problem.system.u))
    return _largest(ca.fabs(slope) @ np.concatenate(corner), problem, guess, p)


def _largest(expression: ca.SX, problem: Problem, guess: Guess, p: Array) -> Array:
    system = problem.system
    function = ca.Function("size", [system.x, system.u, system.p], [ca.densify(ca.vec(expression))])
    result = np.abs(evaluate(function, guess.x, guess.u, p)[0])
    result[~np.isfinite(result)] = 0.0
    return np.asarray(np.max(result, axis=0, initial=0.0))


def _cost_scale(problem: Problem, guess: Guess, p: Array, corner: tuple[Array, Array]) -> float:
    """Return the sum of the absolute parts of the cost, along the guess or with states and controls at their scales."""
    minimise = problem.minimise
    timed = abs(minimise.time) * guess.duration

    if all(part.is_zero() for part in (minimise.running, minimise.final, minimise.initial)):
        return timed

    def of(motion: Guess) -> float:
        parts = minimise.running, minimise.final, minimise.initial
        results = [0.0 if part.is_zero() else _largest(part, problem, motion, p)[0] for part in parts]
        return float(guess.duration * results[0] + results[1] + results[2])

    x = np.vstack([guess.x[0] + corner[0], guess.x[-1] - corner[0]])
    u = _within(np.vstack([corner[1], -corner[1]]), *problem.limits(Where.ALONG, problem.system.u))
    wide = Guess(np.array([0.0, 1.0]), x, u, guess.duration, guess.free)
    return timed + max(of(guess), LEAST_COST * of(wide))


def _constraint_scales(problem: Problem, guess: Guess, p: Array, corner: tuple[Array, Array]) -> Iterator[Array]:
    """Yield the scales of the components of every constraint."""
    changes = dict[tuple[int, ...], Array]()  # by expression: often the same one is constrained at both ends
    for constraint in problem.subject_to:
        if len(single_symbols(constraint, problem.system)) == len(constraint.lower):
            yield np.ones(len(constraint.lower))  # bounds of unknowns, which have scales of their own
            continue
        sides = np.abs(np.stack([constraint.lower, constraint.upper]))
        limit = np.max(np.where(np.isfinite(sides), sides, 0.0), axis=0)
        key = tuple(component.element_hash() for component in ca.vertsplit(constraint.expression))
        if key not in changes:
            changes[key] = _largest_change(constraint.expression, problem, guess, p, corner)
        seen = changes[key]
        yield _power_of_two(np.where(seen > 0.0, np.clip(limit, seen, IDLE * seen), limit))


def _without_rounding(reached: Array, units: list[str]) -> Array:
    """Replace scales that are rounding errors by the largest one with the same unit, or by one."""
    least = NEGLIGIBLE * np.max(reached, initial=0.0)
    same = largest_of_unit(reached, units)
    return np.where(reached > least, reached, np.where(same > least, same, 1.0))


def _control_scale(guessed: Array, needed: Array, slopes: Array) -> Array:
    """Return the scales (nu,) of controls without bounds: as guessed, or what moves the states through their ranges.

    The controls of a guess at rest are rounding errors and cannot serve as a scale.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        moving = needed[None, :, None] / slopes
    moving[~np.isfinite(moving) | (moving <= 0.0)] = np.inf
    least = np.min(moving, axis=(0, 1), initial=np.inf)
    degenerate = np.where(np.isfinite(least), guessed < 1e-6 * least, guessed == 0.0)
    return np.where(degenerate, np.where(np.isfinite(least), least, 0.0), guessed)


def largest_bound(problem: Problem, symbols: ca.SX) -> Array:
    """Return the largest absolute finite bound of each symbol along the motion; inf without one."""
    sides = np.abs(np.stack(problem.limits(Where.ALONG, symbols)))
    sides[~np.isfinite(sides)] = 0.0
    largest = np.max(sides, axis=0)
    return np.where(largest > 0.0, largest, np.inf)


def _within(u: Array, low: Array, high: Array) -> Array:
    return np.asarray(np.clip(u, low, np.maximum(low, high)))


def _power_of_two(value: Array | float) -> Array:
    value = np.asarray(value, dtype=float)
    sane = np.isfinite(value) & (value > 1e-100) & (value < 1e100)
    return np.where(sane, 2.0 ** np.round(np.log2(np.where(sane, value, 1.0))), 1.0)
