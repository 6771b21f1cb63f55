"""Derivatives of a motion at the last times asked for: all orders are computed together, and asked for one by one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ocp.checks import Array


def remembered(last: dict[str, Array], t: Array, order: int, derivatives: Callable[[Array, int], list[Array]]) -> Array:
    """Return the derivative of the given order (K, n) at times (K,), from the last call if the times are the same.

    Args:
        last: times and derivatives of the last call, replaced in place.
        t: (K,) times [s].
        order: of the derivative.
        derivatives: returns q, v, a, ... (K, n) each, at times and up to the highest order given.
    """
    if len(last) > order + 1 and np.array_equal(last["t"], t):
        return last[str(order)]
    results = derivatives(t, max(order, 2))
    last.clear()
    last.update({"t": t.copy(), **{str(k): part for k, part in enumerate(results)}})
    return results[order]
