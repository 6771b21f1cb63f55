"""Derivatives of the optimal cost with respect to single limits and boundary values, from the multipliers."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.sensitivities.kkt_derivatives import Direction, envelope
from ocp.sensitivities.kkt_root import Optimum
from ocp.sensitivities.nlp_of_solution import Reconstruction

STEP = 2.0**-20  # relative change of a number; the bounds of the NLP are piecewise linear in it, so this is exact
SMALL = 1e-9  # share of the largest derivative below which one counts as zero


class LimitSensitivity(NamedTuple):
    """Derivative of the optimal cost with respect to one active limit or boundary value."""

    name: str  # of the limited component
    unit: str  # of it
    where: Where
    side: str  # "lower", "upper", or "value" for a condition
    limit: float
    cost: float  # d cost / d limit


def sensitivities_to_limits(here: Reconstruction, at: Optimum) -> tuple[LimitSensitivity, ...]:
    """Return the derivatives of the optimal cost with respect to all active limits and boundary values of a problem.

    Args:
        here: a solution as unknowns of its NLP.
        at: the root of its conditions of optimality.
    """
    problem, result, slope = here.problem, [], here.slope(at)
    for i, constraint in enumerate(problem.subject_to):
        labels = problem.labels(constraint)
        for c, label in enumerate(labels):
            low, high = float(constraint.lower[c]), float(constraint.upper[c])
            for side, limit in (("value", low),) if low == high else (("lower", low), ("upper", high)):
                if not np.isfinite(limit):
                    continue
                step = STEP * max(abs(limit), 1.0) * (-1.0 if side == "lower" else 1.0)
                moved = here.moved(_with(problem, i, c, side, limit + step))
                direction = Direction.between((here.head, here.bounds), moved)
                cost = envelope(here.bounds, at, (direction,), slope)[0] / step
                result.append(LimitSensitivity(label.name, label.unit, constraint.where, side, limit, float(cost)))
    least = SMALL * max((abs(one.cost) for one in result), default=0.0)
    return tuple(one for one in result if abs(one.cost) > least)


def _with(problem: Problem, number: int, component: int, side: str, value: float) -> Problem:
    """Return the problem with one number changed."""
    old = problem.subject_to[number]
    lower, upper = old.lower.copy(), old.upper.copy()
    for name, array in (("lower", lower), ("upper", upper)):
        if side in (name, "value"):
            array[component] = value
    new = replace(old, lower=lower, upper=upper)
    others = list(problem.subject_to)
    others[number] = new
    return replace(problem, subject_to=tuple(others))
