"""Solutions that were loaded without their problem."""

from __future__ import annotations

from ocp import checks
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution


def with_model(function: str, solution: object, problem: Problem | None) -> Problem:
    """Return the problem of a solution, or the one given for a solution that was loaded without it.

    Args:
        function: that asks, for the message.
        solution: what was given as one.
        problem: what was given for it; None for its own.

    Raises:
        TypeError: no Solution, or no Problem.
        ValueError: no problem at all, or one with another number of states or controls.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"{function}: solution is {checks.shown(solution)}, expected a Solution of a Problem")
    checks.instance(f"{function}: problem", problem, Problem | None, "a Problem, or None for that of the solution")
    result = solution.problem if problem is None else problem
    if result is None:
        raise ValueError(f"{function}: this solution was loaded without its model; pass problem=...")
    has, wanted = (
        (result.system.x.numel(), result.system.u.numel()),
        (solution.states.shape[2], solution.controls.shape[2]),
    )
    if has != wanted:
        raise ValueError(f"{function}: problem has (nx, nu) = {has}, expected {wanted} as the solution")
    return result
