"""The rate of a system and its Jacobians as CasADi functions, cached."""

from __future__ import annotations

import functools

import casadi as ca

from ocp.system import System


@functools.lru_cache(maxsize=32)
def rates(system: System) -> ca.Function:
    """Return the function (x, u, p) -> rate, dense.

    Args:
        system: x' = f(x, u, p).
    """
    return ca.Function("rates", [system.x, system.u, system.p], [ca.densify(system.rate)])


@functools.lru_cache(maxsize=32)
def slopes(system: System) -> ca.Function:
    """Return the function (x, u, p) -> (rate, d rate/dx, d rate/du), all dense; cached.

    Args:
        system: x' = f(x, u, p).
    """
    by = [ca.densify(ca.jacobian(system.rate, symbols)) for symbols in (system.x, system.u)]
    return ca.Function("slopes", [system.x, system.u, system.p], [ca.densify(system.rate), *by])
