"""What a one-step method is: a function that takes the state over one step."""

from __future__ import annotations

import functools
from typing import Protocol

import casadi as ca
import numpy as np

from ocp.system import System

Array = np.ndarray


class Rule(Protocol):
    """A one-step method, with fixed steps or, if it estimates its error, with a step control."""

    def __hash__(self) -> int:
        """Return a hash: compiled steps are kept for rules seen before."""

    @property
    def order(self) -> int:
        """Order of convergence."""

    @property
    def places(self) -> Array:
        """(s,) places in [0, 1] of the step at which the control is needed."""

    @property
    def error_order(self) -> int:
        """Order in h of the error estimate; 0 without one."""

    def step(self, system: System) -> ca.Function:
        """Return the function (x, h, u, p) -> (x_next, errors, change, evaluations) of one step.

        x is (nx,), h a scalar [s], u (nu, s) the control at the places; errors (nx, k) estimates; change the last
        correction of an iteration, relative (0 without one); evaluations counts those of f.

        Args:
            system: x' = f(x, u, p).

        Raises:
            ValueError: the method does not apply to this system.
        """

    def error(self, norms: Array) -> float:
        """Return the error of a step from the norms (k,) of its estimates in units of the tolerance."""


def symbols(system: System, stages: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return symbols of x, h, u (nu, stages) and p for a step of a system."""
    nx, nu, np_ = system.x.numel(), system.u.numel(), system.p.numel()
    return ca.SX.sym("x", nx), ca.SX.sym("h"), ca.SX.sym("u", nu, stages), ca.SX.sym("p", np_)


@functools.lru_cache(maxsize=32)
def rate(system: System) -> ca.Function:
    """Return f: (x, u, p) -> dx/dt, dense."""
    return ca.Function("rate", [system.x, system.u, system.p], [ca.densify(system.rate)])
