"""Derivatives of cost and duration with respect to the values of a case."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ocp.problem.problem import Problem
from ocp.sensitivities.post_optimal import sensitivity
from ocp.solution.solution import Solution

STEP = 2.0**-20  # difference quotient of limits and ends by a value that is no parameter, relative to the value


def slopes(
    solution: Solution,
    case: Mapping[str, Any],
    values: Mapping[str, float],
    problem_of: Callable[[dict[str, Any]], Any],
) -> tuple[dict[str, float], str]:
    """Return the columns "d cost / d NAME" and "d duration / d NAME" of a case, and notes for its message.

    A value that is no parameter of the system may move limits and ends in any smooth way. Where the equations change
    with it as well, the derivative is NaN and a note says so.

    Args:
        solution: of the case, solved.
        case: name -> value.
        values: those values that are parameters of the system.
        problem_of: returns the problem of a case.
    """
    problem = solution.problem
    assert problem is not None
    steps = {
        name: STEP * (abs(value) or 1.0)
        for name, value in case.items()
        if name not in values and isinstance(value, float)
    }
    moved, notes = {}, []
    for name, step in steps.items():
        other = problem_of({**case, name: case[name] + step})
        if isinstance(other, Problem) and other.system is problem.system:
            moved[name] = other
        else:
            notes.append(f"no derivative by {name}: the system changes with it")
    results = {f"d {what} / d {name}": math.nan for name in (*values, *steps) for what in ("cost", "duration")}
    names = [name for name in values if name not in solution.free]
    if not names and not moved:
        return results, "; ".join(notes)
    derivatives = sensitivity(solution, names, moved)
    for name in derivatives.names:
        step = steps.get(name, 1.0)
        results[f"d cost / d {name}"] = derivatives.cost[name] / step
        results[f"d duration / d {name}"] = derivatives.duration[name] / step
    return results, "; ".join([*notes, *derivatives.notes])
