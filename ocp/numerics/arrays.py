"""Arrays: quantities with units, and points at which structure is decided by numbers."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ocp.checks import Array


def largest_of_unit(values: Array, units: Sequence[str]) -> Array:
    """Return for each value the largest one that has the same unit.

    Args:
        values: (n,) numbers, one for each quantity.
        units: n units, such as "rad", "m".

    Returns:
        (n,).
    """
    names = np.array(units, dtype=object)
    largest = {unit: np.max(values[names == unit]) for unit in dict.fromkeys(units)}
    return np.array([largest[unit] for unit in units], dtype=float)


@functools.lru_cache(maxsize=64)
def _draws(shape: tuple[int, ...], low: float, high: float) -> Array:
    return np.random.default_rng(1).uniform(low, high, shape)


def probes(shape: tuple[int, ...], low: float, high: float) -> Array:
    """Return scattered numbers between two values, the same ones in every run.

    Graphs that look different may have equal values: structure is decided by values at such points.
    """
    return _draws(shape, low, high).copy()
