"""Tangents of a study: the derivatives of cost and duration of a case by its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ocp.problem.problem import Problem
from ocp.sensitivities.post_optimal import sensitivity
from ocp.solution.solution import Solution

STEP = 2.0**-20  # share of a number that is no parameter of the system; the number itself may be tiny or huge


def tangents(
    solution: Solution, case: Mapping[str, Any], values: Mapping[str, float], state: Callable[[dict[str, Any]], Any]
) -> tuple[dict[str, float], str]:
    """Return "d cost / d NAME" and "d duration / d NAME" for the numbers of a case, and what is to be said about them.

    Args:
        solution: of the case, solved.
        case: name -> value.
        values: those that are parameters of the system.
        state: returns the problem of a case. Limits and ends may depend on a number in any smooth way; where more does,
            the derivative is NaN.
    """
    problem = solution.problem
    assert problem is not None
    steps = {name: STEP * (abs(value) or 1.0) for name, value in case.items() if name not in values and _real(value)}
    toward, notes = {}, []
    for name, step in steps.items():
        other = state({**case, name: case[name] + step})
        if isinstance(other, Problem) and other.system is problem.system:
            toward[name] = other
        else:
            notes.append(f"no derivative by {name}: the system changes with it")
    results = {f"d {what} / d {name}": math.nan for name in (*values, *steps) for what in ("cost", "duration")}
    names = [name for name in values if name not in solution.free]
    if not names and not toward:
        return results, "; ".join(notes)
    known = sensitivity(solution, names, toward)
    for name in known.names:
        step = steps.get(name, 1.0)
        results[f"d cost / d {name}"] = known.cost[name] / step
        results[f"d duration / d {name}"] = known.duration[name] / step
    return results, "; ".join([*notes, *known.notes])


def _real(value: object) -> bool:
    return isinstance(value, float)
