"""Sparse assembly: numbers of many small derivatives become the nonzeros of one large sparse matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Triplets:
    """Entries of a large matrix, each a coefficient times one number of a source vector."""

    rows: Array
    columns: Array
    coefficients: Array
    sources: Array

    @classmethod
    def gather(cls, parts: Sequence[tuple[Array, Array | int, Array | float, Array]]) -> Triplets:
        """Concatenate (rows, columns, coefficient, sources) parts, each broadcast within itself, without zeros."""
        if not parts:
            empty = np.zeros(0, dtype=np.int64)
            return cls(empty, empty, np.zeros(0), empty)
        same = [np.broadcast_arrays(*part) for part in parts]
        rows, columns, coefficients, sources = (np.concatenate([part[i].ravel() for part in same]) for i in range(4))
        kept = coefficients != 0.0
        return cls(rows[kept], columns[kept], coefficients[kept].astype(float), sources[kept])


def sparsity_of(rows: Array, columns: Array, shape: tuple[int, int]) -> tuple[ca.Sparsity, Array]:
    """Return the sparsity of the given entries and the nonzero number of each entry (repeated ones share)."""
    keys, place = np.unique(columns.astype(np.int64) * shape[0] + rows, return_inverse=True)
    starts = np.searchsorted(keys // shape[0], np.arange(shape[1] + 1))
    return ca.Sparsity(shape[0], shape[1], starts.tolist(), (keys % shape[0]).tolist()), place


@dataclass(frozen=True, eq=False)
class LinearMap:
    """A sparse linear map: one term for every row by index, further terms by a sparse product.

    Most rows have one term; picking it by index is cheaper to build and to evaluate than a product.
    """

    chosen: Array  # (rows,) number of the source of the first term; the size of the source for none
    factors: Array  # (rows,) its coefficient
    rest: ca.DM  # (rows, size of the source) further terms

    def __call__(self, source: ca.MX) -> ca.MX:
        """Return the image (rows,) of a source vector."""
        size = self.rest.shape[1]
        if len(self.chosen) == 0 or size == 0:
            return ca.MX.zeros(len(self.chosen), 1)
        extended = ca.vertcat(source, 0.0) if np.any(self.chosen == size) else source
        ordered = np.array_equal(self.chosen, np.arange(extended.numel()))
        result = extended if ordered else extended[self.chosen.tolist()]
        if not np.all(self.factors == 1.0):
            alike = np.all(self.factors == self.factors[0])
            result = result * (float(self.factors[0]) if alike else ca.DM(self.factors.tolist()))
        return result + self.rest @ source if self.rest.nnz() else result


def linear_map(rows: Array, columns: Array, coefficients: Array, shape: tuple[int, int]) -> LinearMap:
    """Return the linear map with the given entries, repeated ones added."""
    order = np.argsort(rows, kind="stable")
    rows, columns, coefficients = rows[order], columns[order], coefficients[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = rows[1:] != rows[:-1]
    chosen, factors = np.full(shape[0], shape[1]), np.ones(shape[0])
    chosen[rows[first]], factors[rows[first]] = columns[first], coefficients[first]
    more = ~first
    if not more.any():
        return LinearMap(chosen, factors, ca.DM(shape[0], shape[1]))
    pattern, place = sparsity_of(rows[more], columns[more], shape)
    values = np.bincount(place, weights=coefficients[more], minlength=pattern.nnz())
    return LinearMap(chosen, factors, ca.DM(pattern, values.tolist()))


@dataclass(frozen=True, eq=False)
class Scatter:
    """A large sparse matrix whose nonzeros are constant + operator(source)."""

    pattern: ca.Sparsity
    constant: ca.DM  # (nnz,)
    operator: LinearMap

    def __call__(self, source: ca.MX) -> ca.MX:
        """Return the matrix for one source vector."""
        nonzeros = self.operator(source)
        return ca.MX(self.pattern, nonzeros + self.constant if self.constant.nnz() else nonzeros)


def scatter(varying: Triplets, fixed: Triplets, sources: int, shape: tuple[int, int]) -> Scatter:
    """Return the Scatter of varying entries and fixed ones (coefficients alone).

    Args:
        varying: entries that follow the source.
        fixed: constant entries; their sources are not read.
        sources: size of the source vector.
        shape: of the large matrix.
    """
    rows = np.concatenate([varying.rows, fixed.rows])
    columns = np.concatenate([varying.columns, fixed.columns])
    pattern, place = sparsity_of(rows, columns, shape)
    first, second = place[: len(varying.rows)], place[len(varying.rows) :]
    constant = np.bincount(second, weights=fixed.coefficients, minlength=pattern.nnz())
    operator = linear_map(first, varying.sources, varying.coefficients, (pattern.nnz(), sources))
    return Scatter(pattern, ca.DM(constant.tolist()) if constant.any() else ca.DM(pattern.nnz(), 1), operator)
