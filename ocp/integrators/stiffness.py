"""Eigenvalues and rounding errors of x' = f(x, u, p) near a state: is it stiff, and how accurate is f?"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import Evaluation
from ocp.system import System

EPS = float(np.finfo(float).eps)


class Linearisation:
    """f(x, u, p) linearised at any state.

    Args:
        system: x' = f(x, u, p).
        parameters: values of p.
    """

    def __init__(self, system: System, parameters: Sequence[float]) -> None:
        f, x, u = ca.densify(system.rate), system.x, system.u
        slope, push = ca.jacobian(f, x), ca.jacobian(f, u)
        terms = ca.fabs(slope) @ ca.fabs(x) + ca.fabs(push) @ ca.fabs(u) + ca.fabs(f)
        made = ca.Function("linearised", [x, u, system.p], [ca.densify(slope), ca.densify(terms)], {"cse": True})
        self._evaluation, self._nx = Evaluation(made), x.numel()
        self._evaluation.inputs[2][:] = parameters

    def _at(self, x: Array, u: Array) -> tuple[Array, Array]:
        self._evaluation.inputs[0][:], self._evaluation.inputs[1][:] = x, u
        self._evaluation.call()
        return self._evaluation.outputs[0].reshape(self._nx, self._nx).T, self._evaluation.outputs[1]

    def rounding(self, x: Array, u: Array) -> Array:
        """Return the rounding error of f, eps (|df/dx| |x| + |df/du| |u| + |f|), shape (nx,)."""
        terms = EPS * self._at(x, u)[1]
        return np.where(np.isfinite(terms), terms, 0.0)

    def fastest(self, x: Array, u: Array) -> complex:
        """Return the eigenvalue of df/dx of the largest modulus [1/s]; nan if there is none."""
        slope = self._at(x, u)[0]
        if not slope.size or not np.all(np.isfinite(slope)):
            return complex(np.nan, np.nan)
        values = np.linalg.eigvals(slope)
        return complex(values[int(np.argmax(np.abs(values)))])


def decays(mode: complex) -> bool:
    """Return whether a mode decays faster than it oscillates, so that an implicit method need not resolve it."""
    return mode.real < 0.0 and -mode.real >= abs(mode.imag)


def describe(mode: complex) -> str:
    """Return advice for the fastest mode [1/s] as the end of a message; empty if the mode is NaN."""
    if not np.isfinite(mode):
        return ""
    if decays(mode):
        return (
            f"; the fastest mode of the system decays in {-1.0 / mode.real:.2g} s, so it is stiff there: use an "
            "implicit method, such as integrators.radau_5, or shorter steps"
        )
    if abs(mode.imag) > abs(mode.real):
        return (
            f"; the fastest mode of the system oscillates at {abs(mode.imag):.2g} rad/s and must be resolved: shorter "
            "steps, a looser tolerance, more damping, or integrators.radau_5, which damps it away"
        )
    return ""
