"""What there is to make a scene of, by name: machines, forms and effects of the packages, and what a user includes."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from dataclasses import is_dataclass
from types import ModuleType
from typing import Any

from models.machines.manipulator import Manipulator
from models.mechanics.terms import Terms, snake

_included: dict[str, Any] = {}  # machines and effects of the user, by the name that scene files use


def include(module: ModuleType) -> tuple[str, ...]:
    """Make machines and effects of a module known to scene files, until the process ends.

    Functions with named numbers only annotated to return a Manipulator are machines; dataclasses whose call is
    annotated to return Terms are effects. What the module imports from elsewhere is left out.

    Args:
        module: of the user.

    Returns:
        The names by which scene files call them.

    Raises:
        ValueError: there is nothing of the kind, or a name is taken.
    """
    own = {name: thing for name, thing in vars(module).items() if getattr(thing, "__module__", "") == module.__name__}
    new = {name: thing for name, thing in own.items() if inspect.isfunction(thing) and _of_numbers(thing)}
    new |= {snake(name): thing for name, thing in own.items() if _is_effect(thing)}
    if not new:
        raise ValueError(
            f"{module.__name__}: has no machine (a function of named numbers that returns a Manipulator) and no effect "
            "(a dataclass whose call returns Terms); their return types must be written"
        )
    taken = sorted(name for name in new if name in {**_exported_machines(), **_exported_effects()})
    if taken:
        raise ValueError(f"{module.__name__}: {', '.join(taken)} is the name of a machine or an effect of the package")
    _included.update(new)
    return tuple(new)


def _is_effect(thing: object) -> bool:
    if not (inspect.isclass(thing) and is_dataclass(thing) and "__call__" in vars(thing)):
        return False
    return inspect.signature(vars(thing)["__call__"]).return_annotation in ("Terms", Terms)


def machines() -> dict[str, Callable[..., Manipulator]]:
    """Return every function of `models`, or of the user, that makes a Manipulator from named numbers, by name."""
    return {**_exported_machines(), **{name: thing for name, thing in _included.items() if inspect.isfunction(thing)}}


def _exported_machines() -> dict[str, Callable[..., Manipulator]]:
    functions = {name: thing for name, thing in _exported("models").items() if inspect.isfunction(thing)}
    return {name: function for name, function in functions.items() if _of_numbers(function)}


def _of_numbers(function: Callable[..., object]) -> bool:
    signature = inspect.signature(function)
    named = all(parameter.kind is parameter.KEYWORD_ONLY for parameter in signature.parameters.values())
    return named and signature.return_annotation in ("Manipulator", Manipulator)


def forms() -> dict[str, Callable[..., Any]]:
    """Return every form that `models.forms` exports, by name."""
    return {name: thing for name, thing in _exported("models.forms").items() if inspect.isfunction(thing)}


def effects() -> dict[str, type]:
    """Return every effect that `models.effects` exports, or of the user, by the name that its symbols begin with."""
    return {**_exported_effects(), **{name: thing for name, thing in _included.items() if inspect.isclass(thing)}}


def _exported_effects() -> dict[str, type]:
    results = [
        thing for thing in _exported("models.effects").values() if inspect.isclass(thing) and is_dataclass(thing)
    ]
    return {snake(thing.__name__): thing for thing in results}


def _exported(package: str) -> dict[str, Any]:
    module = importlib.import_module(package)
    return {name: getattr(module, name) for name in sorted(module.__all__)}
