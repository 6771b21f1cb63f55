"""Symbolic factorisation M = L D L' of a symmetric positive definite matrix that skips its structural zeros."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, eq=False)
class Factors:
    """M = L D L' with L unit lower triangular after the symmetric permutation `order`."""

    lower: ca.SX  # (n, n) L in the original numbering
    pivots: ca.SX  # (n,) diagonal of D
    order: tuple[int, ...]  # order of elimination

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 right, right of shape (n,)."""
        return self.backward(self.forward(right) / self.pivots)

    def forward(self, right: ca.SX) -> ca.SX:
        """Return L^-1 right, right of shape (n,)."""
        entries = ca.vertsplit(ca.densify(right))
        for position, k in enumerate(self.order):
            for i in self.order[position + 1 :]:
                if self.lower.has_nz(i, k):
                    entries[i] = entries[i] - self.lower[i, k] * entries[k]
        return ca.vertcat(*entries)

    def backward(self, right: ca.SX) -> ca.SX:
        """Return L'^-1 right, right of shape (n,)."""
        entries = ca.vertsplit(ca.densify(right))
        for position in reversed(range(len(self.order))):
            k = self.order[position]
            for i in self.order[position + 1 :]:
                if self.lower.has_nz(i, k):
                    entries[k] = entries[k] - self.lower[i, k] * entries[i]
        return ca.vertcat(*entries)


def factorise(matrix: ca.SX, order: Sequence[int] | None = None) -> Factors:
    """Factorise M = L D L' symbolically; structural zeros cause no operations.

    Args:
        matrix: (n, n) symmetric positive definite.
        order: order of elimination; None = fewest couplings first (minimum degree).
    """
    n = matrix.shape[0]
    rest: dict[tuple[int, int], ca.SX] = {
        (i, j): matrix[i, j] for i in range(n) for j in range(i + 1) if matrix.has_nz(i, j)
    }
    lower, pivots = ca.SX.eye(n), ca.SX.zeros(n)
    left = list(range(n)) if order is None else list(order)
    done: list[int] = []
    while left:
        k = min(left, key=lambda i: (_degree(rest, i, left), -i)) if order is None else left[0]
        left.remove(k)
        done.append(k)
        pivots[k] = rest.get((k, k), ca.SX(0))  # a joint that moves nothing has none
        coupled = [i for i in left if _key(i, k) in rest]
        for i in coupled:
            lower[i, k] = rest[_key(i, k)] / pivots[k]
        for position, i in enumerate(coupled):
            for j in coupled[: position + 1]:
                rest[_key(i, j)] = rest.get(_key(i, j), ca.SX(0)) - lower[i, k] * rest[_key(j, k)]
    return Factors(lower, pivots, tuple(done))


def _key(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i >= j else (j, i)


def _degree(rest: dict[tuple[int, int], ca.SX], i: int, left: Sequence[int]) -> int:
    return sum(_key(i, j) in rest for j in left)
