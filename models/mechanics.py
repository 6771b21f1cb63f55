"""Equations of motion of a machine with its effects, in any frame, from metric, frame and potential."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from models.frames import Frame, curl, fixed, partial_derivative
from models.manipulator import Manipulator
from models.terms import Effect, Terms, gather


@dataclass(frozen=True, eq=False)
class Mechanics:
    """A machine and the sum of what its effects add, in the symbols q, v and tau."""

    machine: Manipulator
    terms: Terms

    @property
    def metric(self) -> ca.SX:
        """(n, n) metric g(q) in coordinates, with what effects add."""
        return self.machine.metric if self.terms.metric is None else self.machine.metric + self.terms.metric

    @property
    def force(self) -> ca.SX:
        """(n,) generalised forces that are not in the potential: drives and effects."""
        return self.machine.tau if self.terms.force is None else self.machine.tau + self.terms.force

    @property
    def parameters(self) -> dict[str, ca.SX]:
        """Parameters that stay symbols: those of the machine, then those of the effects in their order.

        Raises:
            ValueError: an effect and the machine have one of the same name.
        """
        for name in self.terms.symbols:
            if name in self.machine.symbols:
                raise ValueError(f"an effect defines the parameter {name!r}, which the machine has; rename it")
        return {**self.machine.symbols, **self.terms.symbols}

    @property
    def potential(self) -> ca.SX:
        """Potential energy U(q) [J]: of the effects, and of all masses in their field."""
        total = self.terms.potential
        if self.terms.acceleration is not None:
            for body in (*self.machine.bodies, *self.terms.bodies):
                total = total + body.mass * ca.dot(-self.terms.acceleration, body.centre)
        return total

    def frame(self, chosen: str | Frame | None) -> Frame:
        """Return the frame called `chosen` (default "regular"), or `chosen` itself, with what effects add."""
        if isinstance(chosen, Frame):
            return fixed(chosen)(self._added())
        return self.machine.frame("regular" if chosen is None else chosen, self._added())

    def _added(self) -> ca.SX:
        n = self.machine.q.numel()
        return ca.SX(n, n) if self.terms.metric is None else self.terms.metric


@dataclass(frozen=True, eq=False)
class Partials:
    """d g'_ab / d q_i of a frame metric, entry by entry, so that both uses share their sub-expressions."""

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


def assemble(machine: Manipulator, effects: Sequence[Effect]) -> Mechanics:
    """Put a machine and its effects together.

    Args:
        machine: a Manipulator.
        effects: in any order that makes sense; each sees the terms of those before it.

    Raises:
        TypeError, ValueError: see `models.terms.gather`.
    """
    if not isinstance(machine, Manipulator):
        raise TypeError(f"machine: got {machine!r}, expected a Manipulator such as spherical()")
    return Mechanics(machine, gather(machine, effects))


def momentum_rate(mechanics: Mechanics, frame: Frame, w: ca.SX, p: ca.SX, partials: Partials) -> ca.SX:
    """Return dp'/dt in a frame, from quasi-velocities w and momenta p = g' w.

    p'_a = S_ia [ 1/2 w_b w_c d_i g'_bc + p_b (d_i F_bj - d_j F_bi) v_j - d_i U + Q_i ],  v = S w

    which is (2.3) with the velocities kept as a common factor: the force is 1/2 w' (dg') w, never -1/2 p' d(g'^-1) p.

    Args:
        mechanics: machine and effects.
        frame: the frame, with its metric.
        w: (n,) quasi-velocities.
        p: (n,) momenta.
        partials: of the metric of the frame.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (1.5) and (2.3).
    """
    v = frame.inverse @ w
    force = partials.kinetic_gradient(w) - ca.gradient(mechanics.potential, frame.q)
    for b, i, j, entry in curl(frame):
        force[i] += p[b] * entry * v[j]
    applied = ca.substitute(mechanics.force, mechanics.machine.v, v)
    return frame.inverse.T @ (force + applied)
