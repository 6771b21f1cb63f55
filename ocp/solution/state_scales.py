"""Scales of the states of a motion; errors of states are stated relative to them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import largest_of_unit
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution

# Smallest scale of a state, relative to its largest value: an integration with a tolerance of 1e-12 has an error of
# about that share of the value, which is then a millionth of the scale.
ROUNDING = 1e-6
LEAST = 1e-3  # smallest scale of a state, relative to the largest of the same unit or to the effect of the controls


def scales_of_states(solution: Solution, problem: Problem) -> tuple[Array, float]:
    """Return the scale (nx,) of each state, and the smallest energy with which an energy balance is compared.

    The scale is the range of the state, at least 1/1000 of the largest range with the same unit, at least 1/1000 of
    the change that the controls could cause within the duration (or within the time in which a state falls back by
    itself, if that is shorter), and at least 1e-6 of the largest value.

    Args:
        solution: with finite states.
        problem: that it solves.
    """
    system = problem.system
    width, value = np.ptp(solution.states, axis=(0, 1)), np.max(np.abs(solution.states), axis=(0, 1))
    units = [label.unit for label in system.label("x", len(width))]
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
    # Where a state falls back by itself, a control moves it for the time that this takes only.
    own = np.diag(by_x)
    lasts = np.where(own * solution.duration > 1.0, 1.0 / np.where(own > 0.0, own, 1.0), solution.duration)
    caused = lasts * (by_u @ control_scales(solution, problem))
    caused = caused + lasts * ((by_x - np.diag(own)) @ caused)
    scale = np.maximum(np.maximum(width, LEAST * np.maximum(largest_of_unit(width, units), caused)), ROUNDING * value)
    energy_scale = float(np.sum(energy_by @ (ROUNDING * value)) + LEAST * solution.duration * np.sum(power_by @ caused))
    return np.where(scale > 0.0, scale, 1.0), energy_scale


def control_scales(solution: Solution, problem: Problem) -> Array:
    """Return the largest allowed value (nu,) of each control, at most 1000 times the largest value in the motion.

    Args:
        solution: of any status.
        problem: that it solves.
    """
    sides = np.abs(np.stack(problem.limits(Where.ALONG, problem.system.u)))
    used = np.max(np.abs(solution.controls), axis=(0, 1))
    limit = np.max(np.where(np.isfinite(sides), sides, 0.0), axis=0)
    # A control that is limited to zero has no scale of its own.
    limit = np.where(limit > 0.0, limit, np.maximum(used, np.max(limit, initial=0.0)))
    return np.asarray(np.where(used > 1e-9 * limit, np.minimum(limit, 1e3 * used), limit))
