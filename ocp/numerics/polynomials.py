"""Lagrange polynomials on given nodes: values, slopes, integrals and quadrature weights."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.checks import Array

Matrix = Callable[[Array, Array], Array]  # (nodes, tau) -> values at tau of the polynomials on the nodes


FEW = 64  # points tau up to which a matrix is cached


def integration_matrix(points: Array) -> Array:
    """Return a_ij, the integral from 0 to c_i of the j-th Lagrange polynomial on the points, shape (d, d)."""
    gauss, weights = polynomials.leggauss(len(points))
    rows = [c * (weights / 2.0) @ lagrange_matrix(points, c * (gauss + 1.0) / 2.0) for c in points]
    return np.array(rows)


def _cached(matrix: Matrix) -> Matrix:
    """Return a matrix function that caches its values for few points: the same ones are needed in every solve."""

    @functools.lru_cache(maxsize=128)
    def known(nodes: bytes, tau: bytes) -> Array:
        return matrix(np.frombuffer(nodes), np.frombuffer(tau))

    @functools.wraps(matrix)
    def remembered(nodes: Array, tau: Array) -> Array:
        return known(nodes.tobytes(), tau.tobytes()).copy() if len(tau) <= FEW else matrix(nodes, tau)

    return remembered


@_cached
def lagrange_matrix(nodes: Array, tau: Array) -> Array:
    """Return l_m(tau_i), shape (len(tau), len(nodes)), of the Lagrange polynomials on `nodes`."""
    others = nodes[_others(len(nodes))]
    return np.asarray(np.prod((tau[:, None, None] - others) / (nodes[:, None] - others), axis=2))


@functools.lru_cache(maxsize=32)
def _others(count: int) -> Array:
    """Return for each of `count` indices all others, shape (count, count - 1)."""
    return np.array([[k for k in range(count) if k != m] for m in range(count)], dtype=int).reshape(count, count - 1)


@_cached
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
