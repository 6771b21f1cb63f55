"""Parameters of a machine or an effect: numbers, or numbers that stay symbols in the graph."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

import casadi as ca

from ocp import checks

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Parameter:
    """A parameter that stays a symbol, so that one NLP serves many of its values."""

    value: float  # nominal value, unit of the argument it is given for; checked there, where it has a name


@dataclass(frozen=True)
class Follows:
    """A default that equals `factor` times another parameter of the same call."""

    name: str
    factor: float = 1.0


Value = float | Parameter
Default = float | Parameter | Follows


@dataclass(frozen=True, eq=False)
class Parameters:
    """Checked parameters of one call: numbers or symbols for the graph, and the nominal values."""

    entries: Mapping[str, ca.SX | float]  # name -> number (folded in) or symbol
    nominal: Mapping[str, float]  # name -> number, SI
    symbols: Mapping[str, ca.SX]  # only those that stay symbols

    def __getitem__(self, name: str) -> ca.SX | float:
        return self.entries[name]


def number(name: str, value: object, unit: str) -> float:
    """Return `value` as a float, or raise a sentence that names it.

    Args:
        name: of the argument, for the message.
        value: what the user gave.
        unit: SI unit, for the message.

    Raises:
        ValueError: not one finite real number.
    """
    expected = f"one finite number in {unit}"
    if isinstance(value, ca.SX | ca.MX):
        message = f"{name}: got the symbol {checks.shown(value)}, expected {expected}"
        raise ValueError(f"{message}, or Parameter(number) for one that stays a symbol")
    return checks.number(name, value, expected)


def read(given: Mapping[str, Default], unit_of: Callable[[str], str], prefix: str = "") -> Parameters:
    """Check every parameter and make symbols of those wrapped in `Parameter`.

    Args:
        given: name -> number, Parameter or Follows.
        unit_of: name -> SI unit.
        prefix: put before the names of the symbols, as in `gravity.g`.

    Raises:
        ValueError: a value is not one finite number.
    """
    nominal: dict[str, float] = {}
    entries: dict[str, ca.SX | float] = {}
    symbols: dict[str, ca.SX] = {}
    for name, value in given.items():
        if isinstance(value, Follows):
            continue
        raw = value.value if isinstance(value, Parameter) else value
        nominal[name] = number(prefix + name, raw, unit_of(name))
        entries[name] = nominal[name]
        if isinstance(value, Parameter):
            symbols[prefix + name] = entries[name] = ca.SX.sym(prefix + name)
    for name, value in given.items():
        if isinstance(value, Follows):
            nominal[name] = value.factor * nominal[value.name]
            entries[name] = value.factor * entries[value.name]
    return Parameters(entries, nominal, symbols)


def lists_its_parameters(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Return a keyword-only function whose TypeError for an unknown argument lists all parameters."""
    known = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def checked(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        if args:
            raise TypeError(f"{function.__name__} takes keyword arguments only: {', '.join(known)}")
        for name in kwargs:
            if name not in known:
                raise TypeError(f"{function.__name__} has no parameter {name!r}; it has {', '.join(known)}")
        return function(*args, **kwargs)

    return checked


def unit_of(name: str) -> str:
    """Return the SI unit of a machine parameter: masses m_k, inertias Theta_k_ij, lengths otherwise."""
    if name.startswith("m_"):
        return "kg"
    return "kg m^2" if name.startswith("Theta_") else "m"
