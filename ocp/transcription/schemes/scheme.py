"""Collocation schemes as data: points, defects, quadrature and the shape of the control."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.polynomials import lagrange_matrix, slope_matrix

FARTHEST = 1e6  # largest |tau| at which the polynomials of an element are evaluated


class Control(Enum):
    """Shape of the control on one element; the interpolant that a Solution returns has the same shape."""

    CONSTANT = "constant"  # one value for each element: bounds are satisfied everywhere
    LINEAR = "linear"  # continuous, piecewise linear: bounds are satisfied everywhere
    SEGMENTS = "segments"  # linear on each element, jumps between them: bounds are satisfied everywhere
    COLLOCATED = "collocated"  # a polynomial through the collocation points: bounds are satisfied at the points only


@dataclass(frozen=True, eq=False)
class Scheme:
    """A collocation scheme on one element, tau in [0, 1].

    With state values X_m at `nodes` and h F_j = h T f at `points`, the defects are state @ X - h * rate @ F = 0.
    """

    name: str
    degree: int  # number of collocation points
    control: Control
    points: Array  # (d,) collocation points
    weights: Array  # (d,) quadrature weights, sum 1
    nodes: Array  # (m,) where state values are unknowns; first 0, last 1
    at: tuple[int, ...]  # (d,) node that lies at each point
    state: Array  # (rows, m) defect matrix of the state values
    rate: Array  # (rows, d) defect matrix of the rates
    basis: tuple[int, ...]  # nodes whose values define the state polynomial
    slope_at_start: bool  # whether h dx/dt at tau = 0 defines it as well
    order: int  # of the state at the ends of elements, for a smooth problem

    def __repr__(self) -> str:
        return f"{self.name}({self.degree}, control={self.control})"

    @property
    def control_nodes(self) -> Array:
        """(c,) points tau of the control unknowns of one element."""
        if self.control is Control.CONSTANT:
            return np.array([0.0])
        return self.points if self.control is Control.COLLOCATED else np.array([0.0, 1.0])

    def control_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), c) that takes the control unknowns of an element to u(tau)."""
        return lagrange_matrix(self.control_nodes, _points(tau))

    def state_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), m + e) that takes the data of an element to x(tau).

        The data are the m state unknowns and, if `slope_at_start`, h dx/dt at tau = 0 (e = 1, else 0).
        """
        return self._state_matrix(_points(tau), lagrange_matrix)

    def slope_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), m + e) that takes the data of an element to dx/dtau."""
        return self._state_matrix(_points(tau), slope_matrix)

    def _state_matrix(self, tau: Array, interpolation: Callable[[Array, Array], Array]) -> Array:
        nodes = self.nodes[list(self.basis)]
        matrix = np.zeros((len(tau), len(self.nodes) + int(self.slope_at_start)))
        matrix[:, list(self.basis)] = interpolation(nodes, tau)
        if self.slope_at_start:
            # One degree more: c (tau - n_1) ... (tau - n_m) vanishes at the nodes and corrects the slope at n_1 = 0.
            at_start = slope_matrix(nodes, np.zeros(1))[0]
            products = np.prod(-nodes[1:])
            value = np.prod(tau[:, None] - nodes, axis=1)
            slope = sum(np.prod(tau[:, None] - np.delete(nodes, i), axis=1) for i in range(len(nodes)))
            bump = (value if interpolation is lagrange_matrix else slope) / products
            matrix[:, list(self.basis)] -= bump[:, None] * at_start
            matrix[:, -1] = bump
        return matrix

    def costate_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), d) that takes costates at the points to lambda(tau)."""
        return lagrange_matrix(self.points, _points(tau))


def _points(tau: object) -> Array:
    return checks.points("tau", tau, "points on the element, numbers near 0 to 1", -FARTHEST, FARTHEST)


def _check(degree: int, control: Control, least: int = 1) -> None:
    checks.whole("degree", degree, least, 12, of="collocation points")
    checks.instance("control", control, Control, ", ".join(map(str, Control)))
