"""Sparse assembly: nonzeros of many small derivatives become the nonzeros of one large sparse matrix."""

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


def matrix_of(rows: Array, columns: Array, values: Array, shape: tuple[int, int]) -> ca.DM:
    """Return the sparse matrix with the given entries, repeated ones added."""
    pattern, place = sparsity_of(rows, columns, shape)
    return ca.DM(pattern, np.bincount(place, weights=values, minlength=pattern.nnz()).tolist())


@dataclass(frozen=True, eq=False)
class Scatter:
    """A large sparse matrix whose nonzeros are constant + operator @ source."""

    pattern: ca.Sparsity
    constant: ca.DM  # (nnz,)
    operator: ca.DM  # (nnz, size of the source)

    def __call__(self, source: ca.MX) -> ca.MX:
        """Return the matrix for one source vector."""
        return ca.MX(self.pattern, self.constant + self.operator @ source)


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
    operator = matrix_of(first, varying.sources, varying.coefficients, (pattern.nnz(), sources))
    return Scatter(pattern, ca.DM(constant.tolist()), operator)
