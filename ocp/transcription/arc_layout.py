"""Extra NLP parts of a motion made of arcs: durations, equations at chosen points, penalties on chosen controls."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ocp.checks import Array
from ocp.transcription.local_functions import Repeated


@dataclass(frozen=True, eq=False)
class Condition:
    """An expression that becomes constraint rows at chosen points; the bounds of the rows say which value it must have.

    Args:
        expression: (m,) in x, u, p of the system.
        scale: (m,) what the rows of the NLP are divided by.
        elements: (e,) indices of the elements.
        tau: points on each of these elements, in [0, 1].
        weights: of the points in a weighted sum that is the only row; empty for a row at every point.
        made: the expression with its derivatives, if they are there already.
    """

    expression: ca.SX
    scale: Array
    elements: Array
    tau: tuple[float, ...]
    weights: tuple[float, ...] = ()
    made: Repeated | None = None

    @property
    def rows(self) -> int:
        """Number of rows of the NLP."""
        return int(self.expression.numel() * len(self.elements) * (1 if self.weights else len(self.tau)))


@dataclass(frozen=True, eq=False)
class Penalty:
    """A quadratic penalty, weight / 2 * integral of sum_i ((u_i - reference_i) / scale_i)^2 dt, added to the cost.

    Args:
        controls: (m,) indices of the controls.
        reference: (e, c, m) values of the control unknowns of every element [unit of the control].
        scale: (m,) scales of the controls.
        weight: [cost/s].
        elements: (e,) indices of the elements.
        quadrature: (c,) weights of the control unknowns, sum 1.
    """

    controls: Array
    reference: Array
    scale: Array
    weight: float
    elements: Array
    quadrature: Array


@dataclass(frozen=True, eq=False)
class ArcLayout:
    """The arc that every element belongs to; the width of an element is a share of the duration of its arc.

    Args:
        arc: (N,) index of the arc of each element, increasing from 0.
        conditions: constraint rows at chosen points.
        total: whether the sum of all arc durations is a constraint row.
        penalties: on chosen controls, part of the cost.
        evenness: weight w >= 0 of the cost w sum_k ((h_k+1 - h_k) / scale)^2 on the arc durations h.
        ties: (t,) indices k and ratios r of rows h_k+1 = r h_k; arcs of one element each that are tied together keep
            the equations of neighbouring elements sparse.
    """

    arc: Array
    conditions: tuple[Condition, ...] = ()
    total: bool = False
    penalties: tuple[Penalty, ...] = ()
    evenness: float = 0.0
    ties: tuple[Array, Array] | None = None

    @property
    def arcs(self) -> int:
        """Number of arcs."""
        return int(self.arc[-1]) + 1
