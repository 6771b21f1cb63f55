"""What a problem says about one point of a motion: rate, constrained expressions and running cost."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem


@functools.lru_cache(maxsize=16)
def point_values(problem: Problem) -> ca.Function:
    """Return the function (x, u, p) -> (rate, expressions of all constraints in one column, running cost); cached.

    Args:
        problem: one phase.
    """
    system = problem.system
    constrained = ca.vertcat(ca.SX(0, 1), *(constraint.expression for constraint in problem.subject_to))
    outputs = [system.rate, constrained, problem.minimise.running]
    return ca.Function("point", [system.x, system.u, system.p], [ca.densify(one) for one in outputs])


def controls_without_bounds(problem: Problem) -> Array:
    """Return the indices of the controls that lack a bound on one side or both along the motion.

    Args:
        problem: one phase.
    """
    sides = problem.limits(Where.ALONG, problem.system.u)
    return np.flatnonzero(~np.all(np.isfinite(sides), axis=0))


def components_along(problem: Problem) -> Array:
    """Return whether each of the constrained expressions of `point_values` is constrained along the motion.

    Args:
        problem: one phase.
    """
    flags = [np.full(one.expression.numel(), one.where is Where.ALONG) for one in problem.subject_to]
    return np.concatenate([np.zeros(0, dtype=bool), *flags])
