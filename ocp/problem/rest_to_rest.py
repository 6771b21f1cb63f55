"""The rest-to-rest problem, stated by two positions and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ocp import checks
from ocp.problem.constraints import Limit, along, end, start
from ocp.problem.problem import Bolza, Fixed, Free, Problem
from ocp.system import System

Point = Sequence[float] | np.ndarray


def point_to_point(
    system: System,
    q0: Point,
    q1: Point,
    *,
    minimise: Bolza | str = "time",
    horizon: Free | Fixed | None = None,
    limits: Mapping[str, Limit | tuple[Limit, Limit]] | None = None,
    **named: Limit | tuple[Limit, Limit],
) -> Problem:
    """Return the rest-to-rest problem from q0 to q1: q(0) = q0, q(T) = q1, v(0) = v(T) = 0.

    A system whose rest needs more than v = 0, because its drives have states, has a signal "rest" that is zero at both
    ends instead; signals with an initial value of their own start with it.

    Args:
        system: with signals "q" and "v".
        q0, q1: (n,) positions, units of the signal "q".
        minimise: a Bolza cost, or "time" for the duration.
        horizon: Free (default, guess 1 s) or Fixed.
        limits: signal name -> limit, for limits that a model brings along; those by name come before them.
        named: signal name = limit along the motion: a pair (lower, upper) as a tuple of scalars or (n,) arrays, or
            absolute values >= 0 for both sides, scalar or (n,); as in tau=[400, 250], q=(q_min, q_max), v=2.0.

    Raises:
        KeyError: a limit on a signal that the system does not have.
        ValueError: sizes disagree, an absolute value < 0, or "minimise" is another word.
    """
    checks.instance("point_to_point: system", system, System, "a System")
    for name, position in (("q0", q0), ("q1", q1)):
        _check_size(name, checks.numbers(f"point_to_point: {name}", position), system["q"].numel())
    if isinstance(minimise, str):
        if minimise != "time":
            raise ValueError(f"point_to_point: minimise is {minimise!r}, expected 'time' or a Bolza cost")
        minimise = Bolza(time=1.0)
    if limits is not None:
        checks.mapping("point_to_point: limits", limits, "a dict signal -> limit")
    every = {**({} if limits is None else limits), **named}
    bounded = tuple(along(system[name], *_sides(name, limit, system[name].numel())) for name, limit in every.items())
    still = system.signals.get("rest", system["v"])
    rest = (start(system["q"], q0), start(still, 0.0), end(system["q"], q1), end(still, 0.0))
    initial = tuple(start(system[name], value) for name, value in system.initial.items())
    return Problem(system, Free() if horizon is None else horizon, minimise, (*rest, *initial, *bounded))


def _check_size(name: str, given: np.ndarray, size: int) -> None:
    if given.size not in (1, size):
        raise ValueError(f"point_to_point: {name} has {given.size} components, expected {size}")


def _sides(name: str, limit: Limit | tuple[Limit, Limit], components: int) -> tuple[Limit, Limit]:
    if isinstance(limit, tuple) and len(limit) == 2:
        return limit  # type: ignore[return-value]
    if limit is None:
        return None, None
    size = checks.real(limit)
    if size is None or not np.all(size >= 0.0):
        given = checks.shown(limit)
        raise ValueError(f"point_to_point: {name} = {given}, expected absolute values >= 0 or a tuple (lower, upper)")
    _check_size(name, size, components)
    return -size, size
