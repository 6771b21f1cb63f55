"""Derivatives of a metric and the forces of inertia that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from models.machines.frames import Frame, partial_derivative


@dataclass(frozen=True, eq=False)
class Partials:
    """Derivatives d g'_ab / d q_i of a frame metric, formed once so that both sums share their sub-expressions."""

    by_coordinate: tuple[ca.SX, ...]  # n matrices (n, n)

    @classmethod
    def of(cls, frame: Frame) -> Partials:
        """Differentiate the metric of a frame."""
        metric = ca.cse(frame.metric)
        return cls(tuple(partial_derivative(metric, qi) for qi in ca.vertsplit(frame.q)))

    def kinetic_gradient(self, w: ca.SX) -> ca.SX:
        """Return 1/2 w_a w_b d_i g'_ab, shape (n,)."""
        return ca.vertcat(*(ca.dot(w, partial @ w) / 2 for partial in self.by_coordinate))

    def metric_rate(self, v: ca.SX, w: ca.SX) -> ca.SX:
        """Return (dg'/dt) w, shape (n,)."""
        return sum((partial @ w * v[i] for i, partial in enumerate(self.by_coordinate)), ca.SX(*w.shape))


def inertial(metric: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Return g(q) a + Gamma(q)(v, v), shape (n,), of a metric g."""
    momentum = metric @ v
    return metric @ a + ca.jtimes(momentum, q, v) - ca.gradient(ca.dot(v, momentum) / 2, q)
