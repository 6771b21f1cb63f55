"""The contracts of integrators and one-step methods, and checks of their settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.integrators.control_segments import Segment
from ocp.system import System


@dataclass(frozen=True, eq=False)
class Passage:
    """The states of an integration at all stops of all segments, the first of each segment left out."""

    x: Array  # (S, nx), NaN from where the integration could not go on
    message: str  # empty, or why it stopped
    evaluations: int  # of f, those of rejected steps included


class Method(Protocol):
    """An integrator: a frozen dataclass of settings. A new one is a new class with this method."""

    def march(self, system: System, parameters: Sequence[float], x0: Array, segments: Sequence[Segment]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all segments.

        Args:
            system: x' = f(x, u, p).
            parameters: values of p.
            x0: (nx,) state at the first stop.
            segments: that follow each other without a gap.
        """


def check_tolerances(rtol: float | Array, atol: float | Array) -> None:
    """Raise ValueError if a tolerance is not a number > 0."""
    relative, absolute = checks.real(rtol), checks.real(atol)
    if (
        relative is None
        or absolute is None
        or relative.ndim
        or absolute.ndim > 1
        or not absolute.size
        or not (0.0 < relative < np.inf and np.all((absolute > 0.0) & (absolute < np.inf)))
    ):
        raise ValueError(f"rtol, atol: got {checks.shown(rtol)}, {checks.shown(atol)}, expected numbers > 0")


def check_components(atol: float | Array, nx: int) -> None:
    """Raise ValueError if an absolute tolerance is neither a scalar nor has a component for each state."""
    if checks.real(atol) is not None and np.size(atol) not in (1, nx):
        raise ValueError(f"atol: has {np.size(atol)} components, expected 1 or {nx}")


def check_step(step: float) -> None:
    """Raise ValueError if a step is not a finite number > 0."""
    checks.number("step", step, "a finite number of seconds > 0", above=0.0)


def stopped(t: float, reason: str) -> str:
    """Return the message of an integration that stopped at t [s]."""
    return f"the integration stopped at t = {t:.9g} s: {reason}"


class Rule(Protocol):
    """A one-step method, with fixed steps or, if it estimates its error, with a step control."""

    def __hash__(self) -> int:
        """Return a hash, for the cache of step functions."""

    @property
    def order(self) -> int:
        """Order of convergence."""

    @property
    def nodes(self) -> Array:
        """(s,) points of the step, from 0 to 1, at which the control is needed."""

    @property
    def error_order(self) -> int:
        """Order in h of the error estimate; 0 without one."""

    def step(self, system: System) -> ca.Function:
        """Return the function (x, h, u, p) -> (x_next, errors, change, evaluations) of one step.

        x is (nx,), h a scalar [s], u (nu, s) the control at `nodes`; errors (nx, k) are estimates, change is the last
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
