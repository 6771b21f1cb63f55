"""Magnitudes of the states in a motion, by which its errors are measured."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import largest_of_unit
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution

# A drift of a millionth of this share of a value is what an integration at 1e-12 leaves of it.
ROUNDING = 1e-6


def extent(solution: Solution, problem: Problem) -> tuple[Array, float]:
    """Return what drift is measured by, for each state, and the least work that an energy balance is measured by.

    The range of the state, at least a thousandth of the largest range with the same unit, a thousandth of what the
    controls could make of it in the duration, and a share of its value that rounding makes of it along a motion.
    """
    system = problem.system
    span, value = np.ptp(solution.states, axis=(0, 1)), np.max(np.abs(solution.states), axis=(0, 1))
    units = [label.unit for label in system.label("x", len(span))]
    power, energy = (ca.sum1(ca.SX(system.signals.get(name, 0))) for name in ("power", "energy"))
    parts = [ca.jacobian(a, b) for a, b in ((system.rate, system.x), (system.rate, system.u), (power, system.x),
                                            (energy, system.x))]  # fmt: skip
    function = ca.Function("slopes", [system.x, system.u, system.p], [ca.densify(ca.fabs(part)) for part in parts])
    x, u = (
        np.array([part[0], part[len(part) // 2], part[-1]]) for part in (solution.states[:, 0], solution.controls[:, 0])
    )
    p = solution.parameters
    results = [
        [np.nan_to_num(np.array(part), posinf=0.0) for part in function(a, b, p)] for a, b in zip(x, u, strict=True)
    ]
    largest = [np.nan_to_num(np.max([one[i] for one in results], axis=0), posinf=0.0) for i in range(len(parts))]
    by_x, by_u, power_by, energy_by = largest
    reach = solution.duration * by_u @ _range(solution, problem)
    reach = reach + solution.duration * by_x @ reach
    size = np.maximum(np.maximum(span, 1e-3 * np.maximum(largest_of_unit(span, units), reach)), ROUNDING * value)
    work = float(np.sum(energy_by @ (ROUNDING * value)) + 1e-3 * solution.duration * np.sum(power_by @ reach))
    return np.where(size > 0.0, size, 1.0), work


def _range(solution: Solution, problem: Problem) -> Array:
    """Return how large each control may be, or a thousand times what the motion uses if that is far less."""
    sides = np.abs(np.stack(problem.limits(Where.ALONG, problem.system.u)))
    used = np.max(np.abs(solution.controls), axis=(0, 1))
    limit = np.max(np.where(np.isfinite(sides), sides, 0.0), axis=0)
    # A drive that may do nothing has no size of its own.
    limit = np.where(limit > 0.0, limit, np.maximum(used, np.max(limit, initial=0.0)))
    return np.asarray(np.where(used > 1e-9 * limit, np.minimum(limit, 1e3 * used), limit))
