"""Problems that are asked for every day, written for the user."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp.constraint import Limit, along, end, start
from ocp.problem import Bolza, Fixed, Free, Problem
from ocp.system import System

Point = Sequence[float] | np.ndarray


def point_to_point(
    system: System,
    q0: Point,
    q1: Point,
    *,
    minimise: Bolza | str = "time",
    horizon: Free | Fixed | None = None,
    **limits: Limit | tuple[Limit, Limit],
) -> Problem:
    """Return the rest-to-rest problem from q0 to q1: q(0) = q0, q(T) = q1, v(0) = v(T) = 0.

    Where v = 0 does not make a rest, as the drives have states, the signal "rest" is zero at both ends in its place;
    signals with an initial value of their own start with it.

    Args:
        system: with signals "q" and "v".
        q0, q1: (n,) positions, units of the signal "q".
        minimise: a Bolza cost, or "time" for the duration.
        horizon: Free (default, guess 1 s) or Fixed.
        limits: signal name = limit along the motion: a pair (lower, upper) as a tuple of scalars or (n,) arrays, or
            magnitudes >= 0 for both sides, scalar or (n,); as in tau=[400, 250], q=(q_min, q_max), v=2.0.

    Raises:
        KeyError: a limit on a signal that the system does not have.
        ValueError: sizes disagree, a magnitude < 0, or "minimise" is another word.
    """
    if not isinstance(system, System):
        raise TypeError(f"point_to_point: system is {system!r}, expected a System")
    if isinstance(minimise, str):
        if minimise != "time":
            raise ValueError(f"point_to_point: minimise is {minimise!r}, expected 'time' or a Bolza cost")
        minimise = Bolza(time=1.0)
    bounded = tuple(along(system[name], *_sides(name, limit)) for name, limit in limits.items())
    still = system.signals.get("rest", system["v"])
    rest = (start(system["q"], q0), start(still, 0.0), end(system["q"], q1), end(still, 0.0))
    initial = tuple(start(system[name], value) for name, value in system.initial.items())
    return Problem(system, Free() if horizon is None else horizon, minimise, (*rest, *initial, *bounded))


def _sides(name: str, limit: Limit | tuple[Limit, Limit]) -> tuple[Limit, Limit]:
    if isinstance(limit, tuple) and len(limit) == 2:
        return limit  # type: ignore[return-value]
    try:
        size = np.asarray(limit, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"point_to_point: {name} = {limit!r}, expected numbers or a tuple (lower, upper)") from None
    if np.any(size < 0.0) or np.any(np.isnan(size)):
        raise ValueError(f"point_to_point: {name} = {limit}, expected magnitudes >= 0 or a tuple (lower, upper)")
    return -size, size
