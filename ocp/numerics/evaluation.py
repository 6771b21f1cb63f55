"""Evaluation of a CasADi function on numpy arrays by their addresses, which takes a fraction of a conversion."""

from __future__ import annotations

import functools
from collections.abc import Callable

import casadi as ca
import numpy as np

from ocp.checks import Array


@functools.lru_cache(maxsize=64)
def mapped(function: ca.Function, count: int) -> ca.Function:
    """Return a function of `count` columns, cached: CasADi drops its own copy with the last reference.

    Args:
        function: of one column.
        count: number of columns.
    """
    return function.map(count)


class Evaluation:
    """One CasADi function with dense inputs and outputs, and the memory it reads and writes.

    Args:
        function: with dense inputs and outputs.
    """

    def __init__(self, function: ca.Function) -> None:
        self.inputs = [np.zeros(function.numel_in(i)) for i in range(function.n_in())]  # column by column
        self.outputs = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
        # The buffer keeps bare pointers: it, the function and the arrays must live as long as the call.
        self._function = function
        self._buffer, self.call = function.buffer()
        for i, array in enumerate(self.inputs):
            if array.size:
                self._buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type,call-arg]
        for i, array in enumerate(self.outputs):
            if array.size:
                self._buffer.set_res(i, memoryview(array))  # type: ignore[arg-type,call-arg]


FEW, MANY, CHUNK = 64, 512, 8192  # points of one call
MAPPING = 20_000  # instructions that take as long as to make a mapped function


Progress = Callable[[int, int], None]  # called with the points done and the points in all


def evaluate(function: ca.Function, *columns: Array, progress: Progress | None = None) -> tuple[Array, ...]:
    """Return the outputs of a function at K points.

    Args:
        function: of column vectors, with dense outputs.
        columns: one array (K, size) for each input; (size,) for an input that is the same everywhere.
        progress: called after every chunk.

    Returns:
        One array (K, size) for each output; matrices column by column.
    """
    count = max(len(column) for column in columns if column.ndim == 2)
    size = _size(function, count)
    many, whole = mapped(function, size), -(-count // size) * size
    inputs = [np.zeros((size, function.numel_in(i))) for i in range(function.n_in())]
    results = [np.empty((whole, function.numel_out(i))) for i in range(function.n_out())]
    # The buffer keeps bare pointers: the arrays must live, and stay where they are, until it has been called.
    buffer, call = many.buffer()
    for i, array in enumerate(inputs):
        if array.size:
            buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type,call-arg]
    for start in range(0, whole, size):
        stop = min(start + size, count)
        for array, column in zip(inputs, columns, strict=True):
            array[: stop - start] = column[start:stop] if column.ndim == 2 else column
        for i, array in enumerate(results):
            if array.size:
                buffer.set_res(i, memoryview(array[start : start + size]))  # type: ignore[arg-type,call-arg]
        call()
        if progress is not None:
            progress(stop, count)
    return tuple(array[:count] for array in results)


def _size(function: ca.Function, count: int) -> int:
    """Return the points of one call.

    A few points are filled up to a multiple of 64 where that is cheaper than another mapped function for their number.
    """
    filled = -count % FEW
    if count <= MANY and function.is_a("SXFunction") and filled * function.n_instructions() <= MAPPING:
        return FEW
    return -(-count // -(-count // CHUNK)) if count else 1
