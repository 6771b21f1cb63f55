"""Lobatto IIIA collocation: both ends of the element are points; trapezoid and Hermite-Simpson among them."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.numerics.polynomials import _unit, integration_matrix, quadrature
from ocp.transcription.schemes.scheme import Control, Scheme, _check


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
