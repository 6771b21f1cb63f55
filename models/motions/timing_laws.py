"""A path run through by a timing law: q(s(t))."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.motions.motion import Motion
from ocp.checks import Array

# A timing law may leave its path by this share of it: the tolerance of a solver.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Composed:
    """Derivatives of order 0 .. 3 of path(law(t)) by the chain rule (Faa di Bruno)."""

    path: Callable[[Array, int], Array]  # (s (K,), order) -> (K, n)
    law: Motion  # of one coordinate s

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        s = self.law.derivative(t, 0)[:, 0]
        rates = [self.law.derivative(t, k) for k in range(1, order + 1)]
        slopes = [self.path(s, k) for k in range(order + 1)]
        if order == 0:
            return slopes[0]
        if order == 1:
            return np.asarray(slopes[1] * rates[0])
        if order == 2:
            return np.asarray(slopes[2] * rates[0] ** 2 + slopes[1] * rates[1])
        if order == 3:
            return np.asarray(slopes[3] * rates[0] ** 3 + 3.0 * slopes[2] * rates[0] * rates[1] + slopes[1] * rates[2])
        raise ValueError(f"derivatives of order 0 .. 3 are formed, not {order}")


def on_path(path: Motion, law: Motion) -> Motion:
    """Return the motion q(s(t)) of a path q(s) under a timing law s(t).

    Args:
        path: a motion whose "time" is the path parameter s, such as Motion.through(s, waypoints).
        law: a motion of one coordinate, s(t), within the range of the path.

    Raises:
        ValueError: the law has more than one coordinate, or leaves the path.
    """
    check_law(law, path.start, path.end)
    curve = Composed(lambda s, order: path.curve(np.clip(s, path.start, path.end), order), law)
    smoothness = min(path.smoothness, law.smoothness)
    return Motion(curve, law.start, law.end, path.labels, smoothness, law.breaks, law.times, notes=path.notes)


def check_law(law: Motion, first: float, last: float) -> None:
    """Refuse a timing law that is no s(t) within [first, last]."""
    if len(law.labels) != 1:
        raise ValueError(f"law: a motion of {len(law.labels)} coordinates, expected one, s(t)")
    s = law.q(law.times)
    slack = ROUNDING * (last - first)
    if s.min() < first - slack or s.max() > last + slack:
        raise ValueError(f"law: s runs from {s.min():g} to {s.max():g}, the path from {first:g} to {last:g}")
