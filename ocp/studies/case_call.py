"""Call of the function of a study with the values of a case."""

from __future__ import annotations

import inspect
from typing import Any

from ocp import checks
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.studies.designs import Case


def call(function: Any, case: Case) -> tuple[Any, dict[str, float]]:
    """Call the function of a study with the values of a case.

    Args:
        function: of keyword arguments, or a Problem, which takes none. A dot in a name may be an underscore in the
            function: payload.mass is passed as payload_mass.
        case: name -> value.

    Returns:
        What the function returned, and the values that it does not take: those of parameters of the problem.

    Raises:
        TypeError: a value that the function does not take and that cannot be a parameter of what it returned.
    """
    if isinstance(function, Problem | Sequence):
        return function, _numbers(case)
    taken, rest = {}, {}
    names, any_name = _arguments(function)
    for name, value in case.items():
        argument = name if name in names else name.replace(".", "_")
        if argument in names or any_name:
            taken[argument if argument in names else name] = value
        else:
            rest[name] = value
    returned = function(**taken)
    if rest and not isinstance(returned, Problem | Sequence):
        raise TypeError(f"the function takes no {', '.join(rest)}; it takes {', '.join(names) or 'nothing'}")
    return returned, _numbers(rest)


def _arguments(function: Any) -> tuple[tuple[str, ...], bool]:
    """Return the names of the arguments of a function, and whether it takes any others by **name."""
    parameters = inspect.signature(function).parameters.values()
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return tuple(p.name for p in parameters if p.kind in kinds), any(p.kind is p.VAR_KEYWORD for p in parameters)


def _numbers(values: Case) -> dict[str, float]:
    for name, value in values.items():
        if isinstance(value, str | tuple | bool):
            shown = checks.shown(value)
            raise TypeError(f"{name} is {shown}, expected a number as the value of a parameter of the problem")
    return {name: float(value) for name, value in values.items()}  # type: ignore[arg-type]
