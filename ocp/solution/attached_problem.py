"""A problem for solutions that were loaded from a file without one."""

from __future__ import annotations

from dataclasses import replace

from ocp import checks
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution


def with_problem(function: str, solution: object, problem: object) -> tuple[Solution, Problem]:
    """Return a solution that carries its problem, and the problem.

    Args:
        function: name of the calling function, for messages.
        solution: the argument that must be a Solution.
        problem: the problem that it solves; None for the one that it carries.

    Raises:
        TypeError: no Solution, or no Problem.
        ValueError: no problem at all, or one with another number of states or controls.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"{function}: solution is {checks.shown(solution)}, expected a Solution of a Problem")
    checks.instance(f"{function}: problem", problem, Problem | None, "a Problem, or None for that of the solution")
    result = problem if isinstance(problem, Problem) else solution.problem
    if result is None:
        raise ValueError(f"{function}: this solution was loaded without its problem; pass problem=...")
    has, wanted = (
        (result.system.x.numel(), result.system.u.numel()),
        (solution.states.shape[2], solution.controls.shape[2]),
    )
    if has != wanted:
        raise ValueError(f"{function}: problem has (nx, nu) = {has}, expected {wanted} as the solution")
    return (solution if solution.problem is result else replace(solution, problem=result)), result
