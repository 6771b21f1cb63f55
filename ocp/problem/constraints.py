"""Constraints as values: at the start, at the end, along the motion, or between both ends."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import casadi as ca
import numpy as np

from ocp import checks
from ocp.system import System


class Where(Enum):
    """Where a constraint holds."""

    START = "start"
    END = "end"
    ALONG = "along"
    PERIODIC = "periodic"  # value at the end minus value at the start
    INTEGRAL = "integral"  # over the time of the motion; a Problem states it with a further state


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower <= expression <= upper at the start, at the end or along the motion; see start, end, along, periodic."""

    where: Where
    expression: ca.SX  # (m,)
    lower: np.ndarray  # (m,)
    upper: np.ndarray  # (m,)
    name: str = ""  # used in messages; empty: the name of the signal that the expression is
    # Excess between the nodes, in the unit of the expression, up to which the grid of a solve is not refined; None: a
    # thousandth of the scale of the limit. Of nonlinear limits of states along the motion.
    between: float | None = None


Limit = float | Sequence[float] | np.ndarray | None


def start(expression: ca.SX, lower: Limit, upper: Limit = None, name: str = "") -> Constraint:
    """Constrain an expression at t = 0.

    Args:
        expression: (m,) a signal of the system, or any expression in x, u, p.
        lower: (m,) or scalar; the value itself if `upper` is not given.
        upper: (m,) or scalar.
        name: used in messages.

    Raises:
        ValueError: sizes disagree, NaN, lower > upper.
    """
    return _at_end(Where.START, expression, lower, upper, name)


def end(expression: ca.SX, lower: Limit, upper: Limit = None, name: str = "") -> Constraint:
    """Constrain an expression at t = T; arguments as for `start`."""
    return _at_end(Where.END, expression, lower, upper, name)


def along(
    expression: ca.SX, lower: Limit = None, upper: Limit = None, name: str = "", between: float | None = None
) -> Constraint:
    """Constrain an expression along the whole motion.

    A component that is one symbol of x or u becomes a bound of unknowns, one of p makes that parameter an unknown.

    Args:
        expression: (m,) a signal of the system, or any expression in x, u, p.
        lower, upper: (m,) or scalar; None (or infinite) for no limit.
        name: used in messages.
        between: excess over a nonlinear limit of states between the nodes, in the unit of the expression, from which
            `solve` refines the grid; None is a thousandth of the scale of the limit.

    Raises:
        ValueError: sizes disagree, NaN, lower > upper, between <= 0.
    """
    made = _constraint(Where.ALONG, expression, lower, upper, name)
    if between is None:
        return made
    return replace(made, between=checks.number("along: between", between, "an excess > 0, or None", above=0.0))


def periodic(expression: ca.SX, shift: Limit = 0.0) -> Constraint:
    """Constrain an expression to the same value at both ends, expression(T) - expression(0) = shift.

    Args:
        expression: (m,) a signal of the system, or any expression in x, u, p.
        shift: (m,) or scalar, for motions that repeat a number of turns further.

    Raises:
        ValueError: sizes disagree, NaN.
    """
    checks.numbers("periodic: shift", shift)
    return _constraint(Where.PERIODIC, expression, shift, shift, sides=("shift", "shift"))


def integral(expression: ca.SX, lower: Limit = None, upper: Limit = None, name: str = "") -> Constraint:
    """Constrain the integral of an expression over the time of the motion.

    Args:
        expression: (m,) a signal of the system, or any expression in x, u, p.
        lower, upper: (m,) or scalar; None (or infinite) for no limit.
        name: used in messages.

    Raises:
        ValueError: sizes disagree, NaN, lower > upper, no limit at all.
    """
    if lower is None and upper is None:
        raise ValueError("integral: lower and upper are None, expected at least one limit")
    return _constraint(Where.INTEGRAL, expression, lower, upper, name)


def simple(constraint: Constraint, symbols: ca.SX) -> list[tuple[int, int]]:
    """Return (index in symbols, component) for the components of a constraint that are single symbols."""
    indices = {symbol.element_hash(): i for i, symbol in enumerate(ca.vertsplit(symbols))} if symbols.numel() else {}
    return [
        (indices[component.element_hash()], c)
        for c, component in enumerate(ca.vertsplit(constraint.expression))
        if component.is_symbolic() and component.element_hash() in indices
    ]


@functools.lru_cache(maxsize=256)
def single_symbols(constraint: Constraint, system: System) -> tuple[tuple[int, int, int], ...]:
    """Return (0, 1, 2 for x, u, p; index in it; component) of the components that are single symbols of a system.

    Asked for many times in one solve.
    """
    known, components = _positions(system), enumerate(ca.vertsplit(constraint.expression))
    single = [(c, one.element_hash()) for c, one in components if one.is_symbolic()]
    return tuple((*known[key], c) for c, key in single if key in known)


@functools.lru_cache(maxsize=64)
def _positions(system: System) -> dict[int, tuple[int, int]]:
    """Return hash of a symbol -> (0, 1, 2 for x, u, p; index in it)."""
    return {
        symbol.element_hash(): (number, i)
        for number, column in enumerate((system.x, system.u, system.p))
        if column.numel()
        for i, symbol in enumerate(ca.vertsplit(column))
    }


def row_components(constraint: Constraint, system: System) -> tuple[int, ...]:
    """Return the components of a constraint that become rows of the NLP; the others are bounds of single unknowns.

    Unknowns are states, controls and parameters along the motion, and states at its ends.
    """
    if constraint.where is Where.PERIODIC:
        return tuple(range(constraint.expression.numel()))
    along_motion = constraint.where is Where.ALONG
    bounds = {c for number, _, c in single_symbols(constraint, system) if along_motion or number == 0}
    return tuple(c for c in range(constraint.expression.numel()) if c not in bounds)


def _at_end(where: Where, expression: ca.SX, lower: Limit, upper: Limit, name: str) -> Constraint:
    if lower is None and upper is None:
        raise ValueError(f"{where.value}: lower and upper are None, expected a value or a lower and an upper limit")
    return _constraint(where, expression, lower, lower if upper is None else upper, name)


def _constraint(
    where: Where, expression: ca.SX, lower: Limit, upper: Limit, called: str = "",
    sides: tuple[str, str] = ("lower", "upper"),
) -> Constraint:  # fmt: skip
    name = where.value
    checks.expression(name, expression)
    checks.text(f"{name}: name", called)
    column = ca.densify(ca.vec(expression))
    size = column.numel()
    if size == 0:
        raise ValueError(f"{name}: the expression is empty, expected at least one component")
    low, high = _limit(name, sides[0], lower, -np.inf, size), _limit(name, sides[1], upper, np.inf, size)
    if np.any(low > high):
        bad = np.flatnonzero(low > high).tolist()
        raise ValueError(
            f"{name}: lower > upper in components {bad}: {low[bad].tolist()} > {high[bad].tolist()} for "
            f"{checks.shown(expression)}, expected lower <= upper"
        )
    if np.any(low == np.inf) or np.any(high == -np.inf):
        raise ValueError(
            f"{name}: a lower limit of +inf or an upper limit of -inf leaves nothing for {checks.shown(expression)}"
        )
    return Constraint(where, column, low, high, called)


def _limit(where: str, side: str, value: Limit, missing: float, size: int) -> np.ndarray:
    array = checks.real(missing if value is None else value)
    if array is None:
        raise checks.refused(f"{where}: {side}", value, "numbers")
    array = array.ravel()
    if array.size not in (1, size):
        raise ValueError(f"{where}: {side} has {array.size} components, expected 1 or {size}")
    if np.any(np.isnan(array)):
        components = np.flatnonzero(np.isnan(array)).tolist()
        raise ValueError(f"{where}: {side} is NaN in components {components}, expected numbers, or inf for no limit")
    return np.broadcast_to(array, (size,)).copy()
