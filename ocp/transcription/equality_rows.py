"""Rows for equations along the motion: as many on each element as the control has values there.

An equation on x and u that held at every collocation point would fix the control several times on an element with one
value of it. So it holds

- with constant controls in the mean over the element;
- with linear controls at the ends of the elements;
- with collocated controls at the collocation points.

An equation without controls is differentiated until one appears, in the k-th derivative. With collocated controls
that derivative is zero at the collocation points, with the other shapes the one before it at the ends of the elements
(with linear controls also the k-th one at the start). All derivatives before are zero at the start.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.problem.constraints import Where
from ocp.problem.equations_along import PathEquality, path_equalities
from ocp.problem.problem import Problem
from ocp.transcription.arc_layout import Condition
from ocp.transcription.scaling import Scaling
from ocp.transcription.schemes.scheme import Control, Scheme


def equality_conditions(problem: Problem, scheme: Scheme, elements: int, scaling: Scaling) -> tuple[Condition, ...]:
    """Return the rows of the equations along the motion; those that fixed ends decide are left out.

    Args:
        problem: with its constraints.
        scheme: with the shape of the control.
        elements: number of elements.
        scaling: of the NLP.
    """
    every, results = np.arange(elements), list[Condition]()
    for equality in path_equalities(problem):
        scale = scaling.of_constraint(equality.constraint, equality.component)
        scales = [np.array([scale / scaling.horizon**j]) for j in range(equality.order + 1)]
        for j, derivative in enumerate(equality.chain[:-1]):
            if not _fixed(problem, derivative, Where.START):
                results.append(Condition(derivative, scales[j], every[:1], (0.0,)))
        results += _along(problem, scheme, equality, every, scales)
    return tuple(results)


def _along(
    problem: Problem, scheme: Scheme, equality: PathEquality, every: np.ndarray, scales: list[np.ndarray]
) -> list[Condition]:
    chain, order = equality.chain, equality.order
    if scheme.control is Control.COLLOCATED:
        return [Condition(chain[-1], scales[-1], every, tuple(scheme.points.tolist()))]
    linear = scheme.control in (Control.LINEAR, Control.SEGMENTS)
    starts = every if scheme.control is Control.SEGMENTS else every[:1]
    at_start = [Condition(chain[-1], scales[-1], starts, (0.0,))] if linear else []
    if order == 0 and linear:
        return [*at_start, Condition(chain[0], scales[0], every, (1.0,))]
    if order == 0:
        points, weights = tuple(scheme.points.tolist()), tuple(scheme.weights.tolist())
        return [Condition(chain[0], scales[0], every, points, weights)]
    last = _fixed(problem, chain[-2], Where.END)
    return [*at_start, Condition(chain[-2], scales[-2], every[:-1] if last else every, (1.0,))]


def _fixed(problem: Problem, expression: ca.SX, where: Where) -> bool:
    """Return whether an expression of states contains only states that have a fixed value at an end."""
    low, high = problem.limits(where, problem.system.x)
    free = [symbol for symbol, a, b in zip(ca.vertsplit(problem.system.x), low, high, strict=True) if a != b]
    return not free or not ca.depends_on(expression, ca.vertcat(*free))
