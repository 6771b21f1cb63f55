"""Radau IIA collocation: the last point is the end of the element."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.numerics.polynomials import _unit, quadrature, slope_matrix
from ocp.transcription.schemes.scheme import Control, Scheme, _check


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
