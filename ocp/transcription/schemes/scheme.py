"""Collocation schemes as data: points, defects, quadrature and the shape of the control."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp import checks

Array = np.ndarray
Matrix = Callable[[Array, Array], Array]  # of a polynomial through nodes, at places
FEW = 64  # places at which matrices are kept
FARTHEST = 1e6  # place from which polynomials of an element are asked for


class Control(Enum):
    """Shape of the control on one element; the interpolant that a Solution returns has the same shape."""

    CONSTANT = "constant"  # one value for each element: limits hold everywhere
    LINEAR = "linear"  # continuous, piecewise linear: limits hold everywhere
    COLLOCATED = "collocated"  # a polynomial through the collocation points: limits hold at the points only


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
        """(c,) places of the control unknowns of one element."""
        if self.control is Control.CONSTANT:
            return np.array([0.0])
        return np.array([0.0, 1.0]) if self.control is Control.LINEAR else self.points

    def control_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), c) that takes the control unknowns of an element to u(tau)."""
        return lagrange_matrix(self.control_nodes, _places(tau))

    def state_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), m + e) that takes the data of an element to x(tau).

        The data are the m state unknowns and, if `slope_at_start`, h dx/dt at tau = 0 (e = 1, else 0).
        """
        return self._state_matrix(_places(tau), lagrange_matrix)

    def slope_at(self, tau: Array) -> Array:
        """Return the matrix (len(tau), m + e) that takes the data of an element to dx/dtau."""
        return self._state_matrix(_places(tau), slope_matrix)

    def _state_matrix(self, tau: Array, interpolation: Callable[[Array, Array], Array]) -> Array:
        nodes = self.nodes[list(self.basis)]
        matrix = np.zeros((len(tau), len(self.nodes) + int(self.slope_at_start)))
        matrix[:, list(self.basis)] = interpolation(nodes, tau)
        if self.slope_at_start:
            # One degree more: c (tau - n_1) ... (tau - n_m) vanishes at the nodes, n_1 = 0, and mends the slope there.
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
        return lagrange_matrix(self.points, _places(tau))


def radau(degree: int = 3, control: Control = Control.CONSTANT) -> Scheme:
    """Return the Radau IIA scheme: the last point is the end of the element, order 2 degree - 1.

    Args:
        degree: number of collocation points, 1 to 12.
        control: shape of the control on an element.

    Raises:
        ValueError: degree out of range.
        TypeError: control is no member of Control.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5.
    """
    _check(degree, control)
    return _radau(int(degree), control)


@functools.lru_cache(maxsize=64)
def _radau(degree: int, control: Control) -> Scheme:
    # Roots of P_{d-1} - P_d on [-1, 1]; the root +1 is exact.
    points = _unit(polynomials.legroots([0.0] * (degree - 1) + [1.0, -1.0]))
    points[-1] = 1.0
    nodes = np.concatenate([[0.0], points])
    return Scheme(
        "radau", degree, control, points, quadrature(points), nodes, tuple(range(1, degree + 1)),
        slope_matrix(nodes, points), np.eye(degree), tuple(range(degree + 1)), False, 2 * degree - 1,
    )  # fmt: skip


def legendre(degree: int = 3, control: Control = Control.CONSTANT) -> Scheme:
    """Return the Gauss-Legendre scheme: all points inside the element, order 2 degree.

    Args:
        degree: number of collocation points, 1 to 12.
        control: shape of the control on an element.

    Raises:
        ValueError: degree out of range.
        TypeError: control is no member of Control.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5.
    """
    _check(degree, control)
    return _legendre(int(degree), control)


@functools.lru_cache(maxsize=64)
def _legendre(degree: int, control: Control) -> Scheme:
    points = _unit(polynomials.leggauss(degree)[0])
    inner = np.concatenate([[0.0], points])
    state = np.zeros((degree + 1, degree + 2))
    state[:degree, :-1] = slope_matrix(inner, points)
    state[degree, :-1], state[degree, -1] = -lagrange_matrix(inner, np.array([1.0]))[0], 1.0
    rate = np.vstack([np.eye(degree), np.zeros((1, degree))])
    return Scheme(
        "legendre", degree, control, points, quadrature(points), np.concatenate([inner, [1.0]]),
        tuple(range(1, degree + 1)), state, rate, tuple(range(degree + 1)), False, 2 * degree,
    )  # fmt: skip


def lobatto(degree: int = 3, control: Control = Control.CONSTANT) -> Scheme:
    """Return the Lobatto IIIA scheme: both ends are points, order 2 degree - 2; 2 is the trapezoid, 3 Hermite-Simpson.

    The state is the polynomial of that degree through all points with the slope of the first.

    Args:
        degree: number of collocation points, 2 to 12.
        control: shape of the control on an element.

    Raises:
        ValueError: degree out of range.
        TypeError: control is no member of Control.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5; for degree 3 Hargraves, Paris, Direct
        trajectory optimization using nonlinear programming and collocation, 1987.
    """
    _check(degree, control, least=2)
    return _lobatto(int(degree), control)


@functools.lru_cache(maxsize=64)
def _lobatto(degree: int, control: Control) -> Scheme:
    # Roots of the derivative of P_{d-1}, and both ends.
    inner = polynomials.legroots(polynomials.legder([0.0] * (degree - 1) + [1.0])) if degree > 2 else np.zeros(0)
    points = np.concatenate([[0.0], _unit(inner), [1.0]])
    butcher = integration_matrix(points)  # a_ij, first row zero
    # X_i - X_0 = h (a_i0 F_0 + sum_j a_ij F_j), solved for the rates at all points but the first.
    solved = np.linalg.inv(butcher[1:, 1:])
    state = np.hstack([-solved.sum(axis=1, keepdims=True), solved])
    rate = np.hstack([solved @ butcher[1:, :1], np.eye(degree - 1)])
    return Scheme(
        "lobatto", degree, control, points, quadrature(points), points, tuple(range(degree)),
        state, rate, tuple(range(degree)), True, 2 * degree - 2,
    )  # fmt: skip


def integration_matrix(points: Array) -> Array:
    """Return a_ij, the integral from 0 to c_i of the j-th Lagrange polynomial on the points, shape (d, d)."""
    gauss, weights = polynomials.leggauss(len(points))
    rows = [c * (weights / 2.0) @ lagrange_matrix(points, c * (gauss + 1.0) / 2.0) for c in points]
    return np.array(rows)


def _kept(matrix: Matrix) -> Matrix:
    """Return a matrix function that remembers its values at few places: the same ones are asked for all the time."""

    @functools.lru_cache(maxsize=128)
    def known(nodes: bytes, tau: bytes) -> Array:
        return matrix(np.frombuffer(nodes), np.frombuffer(tau))

    @functools.wraps(matrix)
    def found(nodes: Array, tau: Array) -> Array:
        return known(nodes.tobytes(), tau.tobytes()).copy() if len(tau) <= FEW else matrix(nodes, tau)

    return found


@_kept
def lagrange_matrix(nodes: Array, tau: Array) -> Array:
    """Return l_m(tau_i), shape (len(tau), len(nodes)), of the Lagrange polynomials on `nodes`."""
    columns = []
    for m, node in enumerate(nodes):
        others = np.delete(nodes, m)
        columns.append(np.prod((tau[:, None] - others) / (node - others), axis=1))
    return np.stack(columns, axis=1)


@_kept
def slope_matrix(nodes: Array, tau: Array) -> Array:
    """Return dl_m/dtau (tau_i), shape (len(tau), len(nodes)), of the Lagrange polynomials on `nodes`."""
    matrix = np.zeros((len(tau), len(nodes)))
    for m, node in enumerate(nodes):
        others = np.delete(nodes, m)
        for skipped in range(len(others)):
            kept = np.delete(others, skipped)
            matrix[:, m] += np.prod((tau[:, None] - kept) / (node - kept), axis=1) / (node - others[skipped])
    return matrix


def quadrature(points: Array) -> Array:
    """Return the weights of the interpolatory quadrature on [0, 1] with the given points."""
    powers = np.arange(len(points))
    # Shifted Legendre polynomials: a well-conditioned moment matrix up to high degree.
    matrix = polynomials.legvander(2.0 * points - 1.0, len(points) - 1).T
    return np.linalg.solve(matrix, (powers == 0).astype(float))


def _unit(points: Array) -> Array:
    return np.sort((np.real(points) + 1.0) / 2.0)


def _places(tau: object) -> Array:
    return checks.places("tau", tau, "places on the element, numbers near 0 to 1", -FARTHEST, FARTHEST)


def _check(degree: int, control: Control, least: int = 1) -> None:
    checks.whole("degree", degree, least, 12, of="collocation points")
    checks.instance("control", control, Control, ", ".join(map(str, Control)))
