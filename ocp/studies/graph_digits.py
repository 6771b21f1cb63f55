"""Digits and symbols of CasADi matrices and graphs that their printed form does not show."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca


def hidden_digits(value: ca.SX | ca.MX | ca.DM) -> Iterator[bytes]:
    """Yield the exact content of a matrix or graph whose printed form does not show all of it."""
    if isinstance(value, ca.DM):
        numbers = value.nonzeros()
        if any(float(f"{one:g}") != one for one in numbers) or "..." in str(value):
            yield f"{value.sparsity().serialize()} {[one.hex() for one in numbers]}".encode()
        return
    symbols: list[Any] = list(ca.symvar(value))
    graph = ca.Function("graph", symbols, [value])  # type: ignore[list-item]
    names = [symbol.name() for symbol in symbols]
    shown = isinstance(value, ca.SX) and len(set(names)) == len(names) and "..." not in str(value)
    if not shown or any(float(f"{one:g}") != one for one in _constants(graph)):
        yield graph.serialize().encode()


def _constants(graph: ca.Function) -> Iterator[float]:
    for k in range(graph.n_instructions()):
        if graph.instruction_id(k) == ca.OP_CONST:
            yield float(graph.instruction_constant(k))
