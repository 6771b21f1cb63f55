"""Scales of limits: the physical quantity that an excess over a limit is compared with."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Constraint, Where
from ocp.system import System

SMALLEST = 1e-6  # limits of nonlinear expressions below this share of the range of the expression are no scale
CLIMBS = 80  # steps of the search for the depth of a forbidden region
FARTHEST = 30.0  # scales of the states that this search may go


@dataclass(frozen=True, eq=False)
class Limited:
    """A constraint with all that its values along a motion depend on.

    Args:
        constraint: of m components.
        system: with its symbols.
        parameters: (np,) values.
        scale: (nx,) scales of the states.
    """

    constraint: Constraint
    system: System
    parameters: Array
    scale: Array

    @functools.cached_property
    def function(self) -> ca.Function:
        """(x, u, p) -> values, and the changes that all states together cause by a scale each."""
        system, expression = self.system, self.constraint.expression
        by_states = ca.mtimes(ca.fabs(ca.jacobian(expression, system.x)), self.scale)
        outputs = [ca.densify(expression), ca.densify(by_states)]
        return ca.Function("limit", [system.x, system.u, system.p], outputs)

    @property
    def of_states(self) -> bool:
        """Whether the constraint depends on states and parameters only."""
        return not ca.depends_on(self.constraint.expression, self.system.u)

    @functools.cached_property
    def values(self) -> ca.Function:
        """(x, u, p) -> values alone."""
        system = self.system
        return ca.Function("values", [system.x, system.u, system.p], [ca.densify(self.constraint.expression)])

    def evaluate(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the outputs of the function (m, K) at K points."""
        values, changes = evaluate(self.function, x, u, self.parameters)
        return values.T, changes.T

    def excess(self, x: Array, u: Array) -> Array:
        """Return by how much the limits are exceeded (m, K) at K points; negative within them."""
        return self.beyond(evaluate(self.values, x, u, self.parameters)[0].T)

    def beyond(self, values: Array) -> Array:
        """Return by how much values (m, K) exceed the limits; negative within them."""
        lower, upper = self.constraint.lower[:, None], self.constraint.upper[:, None]
        return np.asarray(np.maximum(lower - values, values - upper))

    def nonlinear(self, c: int) -> bool:
        """Return whether component c depends on states and controls nonlinearly."""
        symbols = ca.vertcat(self.system.x, self.system.u)
        return any(ca.which_depends(self.constraint.expression[c], symbols, 2, True))


def limit_scale(limited: Limited, c: int, spread: float, x: Array, amount: float, enough: float = np.inf) -> float:
    """Return the scale with which an excess over the limits of component c is compared.

    The distance between both limits, or the range of the expression along the motion where there is one limit only.
    The range of a nonlinear expression can be far larger than what its limit means: |r - c|^2 / R^2 >= 1 reaches
    thousands at a distance from a small obstacle. There the scale is at most the limit itself, and at most the depth
    of the forbidden region, max(limit - expression) over the states near the worst point.

    Args:
        limited: the constraint.
        c: its component.
        spread: range of the expression along the motion, at least the change of it by a scale of each state.
        x: (nx,) worst state.
        amount: excess there, > 0.
        enough: depth of the forbidden region at which its search ends, for callers to whom more makes no difference.
    """
    constraint = limited.constraint
    sides = np.array([constraint.lower[c], constraint.upper[c]])
    width = float(np.ptp(sides)) if np.all(np.isfinite(sides)) else 0.0
    scale = width or spread or 1.0
    if constraint.where is not Where.ALONG or sides[0] == sides[1] or not limited.nonlinear(c):
        return scale
    candidates = [scale, spread or scale]
    candidates += [abs(side) for side in sides[np.isfinite(sides)] if abs(side) > SMALLEST * spread]
    if limited.of_states:
        candidates.append(max(_depth(limited, c, x, amount, enough), amount))
    return float(min(candidates))


def _depth(limited: Limited, c: int, x: Array, amount: float, enough: float) -> float:
    """Return the largest excess over the limits of component c near a state, by steepest ascent in scaled states."""
    system, constraint = limited.system, limited.constraint
    value = constraint.expression[c]
    sides = [sign * (value - side) for sign, side in ((-1.0, constraint.lower[c]), (1.0, constraint.upper[c]))
             if np.isfinite(side)]  # fmt: skip
    outputs = [part for side in sides for part in (side, ca.densify(ca.gradient(side, system.x)))]
    function = ca.Function("depth", [system.x, system.p], outputs)

    def at(point: Array) -> tuple[float, Array]:
        results = [np.array(part).ravel() for part in function(point, limited.parameters)] if len(outputs) > 1 else []
        k = 2 * int(np.argmax([float(results[2 * i][0]) for i in range(len(sides))]))
        return float(results[k][0]), results[k + 1] * limited.scale

    here, step = np.array(x, dtype=float), 0.1
    depth, slope = at(here)
    for _ in range(CLIMBS):
        length = float(np.linalg.norm(slope))
        if (
            depth >= enough
            or not np.isfinite(length)
            or length == 0.0
            or np.max(np.abs(here - x) / limited.scale) > FARTHEST
        ):
            break
        there = here + step * limited.scale * slope / length
        deeper, new = at(there)
        if np.isfinite(deeper) and deeper > depth:
            here, depth, slope, step = there, deeper, new, 1.6 * step
        else:
            step *= 0.4
        if step < 1e-9:
            break
    return max(depth, amount)
