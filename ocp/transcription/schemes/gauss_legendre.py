"""Gauss-Legendre collocation: all points inside the element."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.numerics.polynomials import _unit, lagrange_matrix, quadrature, slope_matrix
from ocp.transcription.schemes.scheme import Control, Scheme, _check


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
