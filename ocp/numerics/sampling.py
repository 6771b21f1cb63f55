"""Evaluation of a CasADi function at many points, in bounded memory and without copies."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from models.motions.piecewise import Array

CHUNK = 8192  # points of one call
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
    sizes = [function.numel_out(i) for i in range(function.n_out())]
    results = tuple(np.empty((count, size)) for size in sizes)
    mapped: dict[int, ca.Function] = {}
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        many = mapped.setdefault(stop - start, function.map(stop - start))
        # The buffer keeps bare pointers: the arrays must live, and stay where they are, until it has been called.
        buffer, call = many.buffer()
        parts = [
            np.ascontiguousarray(column[start:stop], dtype=float)
            if column.ndim == 2
            else np.tile(np.asarray(column, dtype=float), (stop - start, 1))
            for column in columns
        ]
        for i, part in enumerate(parts):
            if part.size:
                buffer.set_arg(i, memoryview(part))  # type: ignore[arg-type,call-arg]
        for i, result in enumerate(results):
            buffer.set_res(i, memoryview(result[start:stop]))  # type: ignore[arg-type,call-arg]
        call()
        if progress is not None:
            progress(stop, count)
    return results
