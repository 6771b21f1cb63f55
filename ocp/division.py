"""Division of a motion into arcs of unknown duration, with conditions and prices at chosen places only."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Condition:
    """expression = value at places of chosen elements.

    Args:
        expression: (m,) in x, u, p of the system.
        value: (m,).
        size: (m,) magnitudes; the rows of the programme are divided by them.
        elements: (e,) numbers of the elements.
        tau: places on each of them.
    """

    expression: ca.SX
    value: Array
    size: Array
    elements: Array
    tau: tuple[float, ...]

    @property
    def rows(self) -> int:
        """Number of rows of the programme."""
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
        total: lower and upper limit of the sum of all durations [s], or None if it is free.
        near: prices for leaving references.
    """

    arc: Array
    conditions: tuple[Condition, ...] = ()
    total: tuple[float, float] | None = None
    near: tuple[Near, ...] = ()

    @property
    def arcs(self) -> int:
        """Number of arcs."""
        return int(self.arc[-1]) + 1
