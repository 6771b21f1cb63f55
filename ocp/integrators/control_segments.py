"""The control of a motion, divided into segments on which it is smooth, with the stops of the integration."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.solution.solution import Solution

ControlOf = Callable[[float], Array]
Controls = Solution | ControlOf | Sequence[float] | Array


@dataclass(frozen=True, eq=False)
class Polynomial:
    """u(t) = sum_m L_m((t - start) / width) U_m, with the Lagrange polynomials L_m on the nodes; smooth."""

    start: float  # [s]
    width: float  # [s]
    nodes: Array  # (c,) in [0, 1]
    values: Array  # (c, nu)
    matrix_at: Callable[[Array], Array]  # points (K,) in [0, 1] -> (K, c), the Lagrange polynomials

    def __call__(self, t: float) -> Array:
        """Return u(t), shape (nu,)."""
        if len(self.values) == 1:
            constant: Array = self.values[0]
            return constant
        tau, nodes = (t - self.start) / self.width, self._nodes
        # Plain numbers: an integrator evaluates one time after the other, for which arrays are far slower.
        basis = [
            factor * math.prod(tau - other for k, other in enumerate(nodes) if k != m)
            for m, factor in enumerate(self._factors)
        ]
        value: Array = np.array(basis) @ self.values
        return value

    @cached_property
    def _nodes(self) -> list[float]:
        return [float(node) for node in self.nodes]

    @cached_property
    def _factors(self) -> list[float]:
        """Reciprocals of prod_k (node_m - node_k), k != m."""
        nodes = self._nodes
        return [
            1.0 / math.prod(node - other for k, other in enumerate(nodes) if k != m) for m, node in enumerate(nodes)
        ]

    def sample(self, times: Array) -> Array:
        """Return u at times (K,), shape (K, nu)."""
        if len(self.values) == 1:
            return np.broadcast_to(self.values[0], (len(times), self.values.shape[1]))
        sampled: Array = self.matrix_at((times - self.start) / self.width) @ self.values
        return sampled

    def expression(self, tau: ca.MX, values: ca.MX) -> ca.MX:
        """Return u at tau = (t - start) / width as an expression in tau and the values (c, nu)."""
        terms = []
        for m, node in enumerate(self.nodes):
            factors = [(tau - other) / (node - other) for k, other in enumerate(self.nodes) if k != m]
            basis = ca.MX(1)
            for factor in factors:
                basis = basis * factor
            terms.append(basis * values[m, :].T)
        return sum(terms[1:], terms[0])


@dataclass(frozen=True, eq=False)
class Sampled:
    """A control given as a function of time, evaluated strictly inside (a, b) so that a jump at an end does no harm."""

    function: ControlOf
    inset: float  # distance from a and b within which the function is not evaluated [s]
    a: float  # [s]
    b: float  # [s]
    nu: int  # number of controls

    def __call__(self, t: float) -> Array:
        """Return u(t), shape (nu,)."""
        inside = min(max(t, self.a + self.inset), self.b - self.inset)
        value = checks.real(self.function(inside))
        if value is None or value.size != self.nu:
            wanted = f"a function that returns {self.nu} numbers at t = {inside:.9g} s, too"
            raise checks.refused("control", self.function if value is None else value, wanted)
        return value.ravel()

    def sample(self, times: Array) -> Array:
        """Return u at times (K,), shape (K, nu)."""
        return np.array([self(t) for t in times.tolist()], dtype=float)


@dataclass(frozen=True, eq=False)
class Segment:
    """An interval on which the control is smooth."""

    stops: Array  # (K + 1,) [s], increasing: the start, times to report, the end
    control: Polynomial | Sampled


def segments(control: Controls, reported: Array, breaks: Sequence[float] | Array, nu: int) -> Iterator[Segment]:
    """Yield the segments of a motion that ends at the last reported time.

    Args:
        control: (nu,) constant, a function t -> (nu,), or a Solution, whose elements are the segments.
        reported: (K,) times to report [s], increasing, >= 0.
        breaks: times where a function jumps or has a kink [s].
        nu: number of controls.

    Raises:
        ValueError: the control has not nu components.
    """
    end = float(reported[-1])

    def stops(a: float, b: float) -> Array:
        return np.array([a, *reported[(reported > a) & (reported < b)], b])

    if isinstance(control, Solution):
        scheme = control.scheme
        for k, (a, b) in enumerate(pairwise(control.nodes)):
            if a < end:
                shape = Polynomial(a, b - a, scheme.control_nodes, control.controls[k], scheme.control_at)
                yield Segment(stops(a, min(b, end)), shape)
        return
    first = at_start(control, nu)
    inner = sorted({float(b) for b in breaks if 0.0 < b < end})
    for a, b in pairwise([0.0, *inner, end]):
        if a == b:
            return
        if callable(control):
            yield Segment(stops(a, b), Sampled(control, 1e-12 * (b - a) if inner else 0.0, a, b, nu))
        else:
            yield Segment(stops(a, b), Polynomial(a, b - a, np.zeros(1), first[None, :], np.ones_like))


def at_start(control: Controls, nu: int) -> Array:
    """Return the control at t = 0, shape (nu,).

    Raises:
        ValueError: it has not nu components.
    """
    if isinstance(control, Solution):
        return control.u(0.0)
    value = checks.real(control(0.0) if callable(control) and not isinstance(control, type) else control)
    if value is None or not np.all(np.isfinite(value)):
        wanted = f"{nu} finite numbers, a function of t that returns them, or a Solution"
        raise checks.refused("control", control, wanted)
    if value.size != nu:
        raise ValueError(f"control: got {value.size} numbers, expected {nu}")
    return value.ravel()
