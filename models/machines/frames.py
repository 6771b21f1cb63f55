"""Frames of quasi-velocities w = F(q) v: orthogonal ones from a factorisation of the metric, others in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.machines.factorisation import Factors, factorise

# An off-diagonal entry g_ab below this multiple of sqrt(g_aa g_bb) at every sampled state counts as zero.
NEGLIGIBLE = 1e-14
SAMPLES = 12


@dataclass(frozen=True, eq=False)
class Frame:
    """Quasi-velocities w = F(q) v with v = S(q) w and the metric g' = S' g S."""

    name: str
    q: ca.SX  # (n,) coordinates
    matrix: ca.SX  # (n, n) F(q)
    inverse: ca.SX  # (n, n) S(q)
    metric: ca.SX  # (n, n) g'(q)
    vanishes: str = ""  # factor of det F(q) that vanishes at the singularity, such as "sin(theta)"; empty: det F itself

    @property
    def diagonal(self) -> bool:
        """Whether the metric is diagonal in this frame, so that no factorisation is needed."""
        return bool(self.metric.sparsity().is_subset(ca.Sparsity.diag(self.q.numel())))


def fixed(frame: Frame) -> Callable[[ca.SX], Frame]:
    """Return a maker for a frame given in closed form: effects add S' (added) S to its metric."""

    def make(added: ca.SX) -> Frame:
        if added.nnz() == 0:
            return frame
        pulled = frame.metric + frame.inverse.T @ added @ frame.inverse
        return replace(frame, metric=without_negligible(pulled, frame.q))

    return make


def coordinate(q: ca.SX, metric: ca.SX) -> Callable[[ca.SX], Frame]:
    """Return a maker for the frame of the coordinates themselves: w = v, so that (q, p) are canonical coordinates.

    Args:
        q: (n,) coordinates.
        metric: (n, n) metric in coordinates.
    """
    unit = ca.SX.eye(q.numel())
    return lambda added: Frame("coordinate", q, unit, unit, ca.sparsify(metric + added))


def ldl(q: ca.SX, metric: ca.SX) -> Callable[[ca.SX], Frame]:
    """Return a maker for the frame of g = L D L': w = L' v, g' = D, det F = 1.

    Args:
        q: (n,) coordinates.
        metric: (n, n) metric in coordinates.
    """
    order = range(q.numel())
    return lambda added: _orthogonal("ldl", q, factorise(metric + added, order))


def udu(q: ca.SX, metric: ca.SX, name: str = "udu") -> Callable[[ca.SX], Frame]:
    """Return a maker for the frame of g = U D U': w = U' v, g' = D, det F = 1.

    Args:
        q: (n,) coordinates.
        metric: (n, n) metric in coordinates.
        name: of the frame.
    """
    order = range(q.numel() - 1, -1, -1)
    return lambda added: _orthogonal(name, q, factorise(metric + added, order))


def _orthogonal(name: str, q: ca.SX, factors: Factors) -> Frame:
    n = q.numel()
    unit = ca.SX.eye(n)
    inverse = ca.horzcat(*(factors.backward(unit[:, j]) for j in range(n)))
    return Frame(name, q, factors.lower.T, inverse, ca.diag(factors.pivots))


def curl(frame: Frame) -> list[tuple[int, int, int, ca.SX]]:
    """Return the non-zero d_i F_aj - d_j F_ai as (a, i, j, entry); an empty list if the frame is holonomic.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, the bracket of (1.5).
    """
    n = frame.q.numel()
    partial = [partial_derivative(frame.matrix, frame.q[i]) for i in range(n)]
    entries = []
    for a in range(n):
        for i in range(n):
            for j in range(i):
                entry = partial[i][a, j] - partial[j][a, i]
                if not ca.simplify(entry).is_zero():
                    entries += [(a, i, j, entry), (a, j, i, -entry)]
    return entries


def anholonomity(frame: Frame) -> list[ca.SX]:
    """Return the anholonomity object A^b_ca = S_ic S_ja (d_i F_bj - d_j F_bi).

    Returns:
        n matrices (n, n), one for each upper index b, rows c, columns a.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (1.5).
    """
    n = frame.q.numel()
    brackets = [ca.SX(n, n) for _ in range(n)]
    for b, i, j, entry in curl(frame):
        brackets[b][i, j] = entry
    return [frame.inverse.T @ bracket @ frame.inverse for bracket in brackets]


def partial_derivative(matrix: ca.SX, variable: ca.SX) -> ca.SX:
    """Return d(matrix)/d(variable) for one scalar variable, structural zeros dropped."""
    rows, columns = matrix.shape
    return ca.sparsify(ca.reshape(ca.jacobian(ca.densify(matrix)[:], variable), rows, columns))


def without_negligible(metric: ca.SX, q: ca.SX) -> ca.SX:
    """Drop off-diagonal entries that vanish at every one of a set of sampled states.

    A metric that is diagonal in a frame may have off-diagonal expressions that cancel. Symbolic simplification does
    not find that, so they are evaluated at sampled values of every free symbol.
    """
    symbols = ca.symvar(ca.vertcat(metric[:], q))
    n = metric.shape[0]
    values = np.random.default_rng(20260101).uniform(0.3, 1.7, (len(symbols), SAMPLES))
    function = ca.Function("metric", [ca.vertcat(*symbols)], [ca.densify(metric)])
    samples = np.array(function.map(SAMPLES)(values)).reshape(n, SAMPLES, n)
    result = ca.SX(metric)
    for a in range(n):
        for b in range(a):
            scale = np.sqrt(np.abs(samples[a, :, a] * samples[b, :, b]))
            if np.all(np.abs(samples[a, :, b]) <= NEGLIGIBLE * scale):
                result[a, b] = result[b, a] = 0.0
    return ca.sparsify(result)
