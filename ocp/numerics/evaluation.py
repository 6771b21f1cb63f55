"""Evaluation of a CasADi function on numpy arrays without copies."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

Array = np.ndarray


@functools.lru_cache(maxsize=64)
def mapped(function: ca.Function, count: int) -> ca.Function:
    """Return a function of `count` columns; CasADi forgets its own as soon as nobody holds them.

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
