"""What there is to make a scene of, by name: machines, forms and effects, found in what the packages export."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Any

from models.machines.manipulator import Manipulator
from models.mechanics.terms import snake


def machines() -> dict[str, Callable[..., Manipulator]]:
    """Return every function of `models` that makes a Manipulator from named numbers, by name."""
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
    """Return every effect that `models.effects` exports, by the name that its symbols begin with."""
    results = [
        thing for thing in _exported("models.effects").values() if inspect.isclass(thing) and is_dataclass(thing)
    ]
    return {snake(thing.__name__): thing for thing in results}


def _exported(package: str) -> dict[str, Any]:
    module = importlib.import_module(package)
    return {name: getattr(module, name) for name in sorted(module.__all__)}
