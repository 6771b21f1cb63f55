"""Division of a motion into arcs of unknown duration, with conditions and prices at chosen places only."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ocp.checks import Array


@dataclass(frozen=True, eq=False)
class Condition:
    """A condition on an expression at places of chosen elements; what it must be is for the bounds of the rows.

    Args:
        expression: (m,) in x, u, p of the system.
        size: (m,) magnitudes; the rows of the NLP are divided by them.
        elements: (e,) numbers of the elements.
        tau: places on each of them.
    """

    expression: ca.SX
    size: Array
    elements: Array
    tau: tuple[float, ...]

    @property
    def rows(self) -> int:
        """Number of rows of the NLP."""
        return int(self.expression.numel() * len(self.elements) * len(self.tau))


@dataclass(frozen=True, eq=False)
class Near:
    """A price for leaving a reference, weight / 2 * integral of sum_i ((u_i - reference_i) / size_i)^2 dt.

    Args:
        controls: (m,) numbers of the controls.
        reference: (e, d, m) at the collocation points of every element.
        size: (m,) magnitudes.
        weight: [cost/s].
        elements: (e,) numbers of the elements.
        shares: (d,) quadrature weights of the collocation points.
    """

    controls: Array
    reference: Array
    size: Array
    weight: float
    elements: Array
    shares: Array


@dataclass(frozen=True, eq=False)
class Division:
    """Which arc every element belongs to; the widths of elements are shares of their arc.

    Args:
        arc: (N,) number of the arc of each element, increasing from 0.
        conditions: that hold at chosen places.
        total: whether the sum of all durations is a row, to be given or limited by its bounds.
        near: prices for leaving references.
    """

    arc: Array
    conditions: tuple[Condition, ...] = ()
    total: bool = False
    near: tuple[Near, ...] = ()

    @property
    def arcs(self) -> int:
        """Number of arcs."""
        return int(self.arc[-1]) + 1
