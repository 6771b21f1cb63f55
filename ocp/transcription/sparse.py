"""Sparse assembly: numbers of many small derivatives become the nonzeros of one large sparse matrix."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

Array = np.ndarray
Entries = tuple[Array, Array, ca.MX]  # rows, columns and values (k,) of entries of a large matrix


def sparse_matrix(parts: Sequence[Entries], shape: tuple[int, int]) -> ca.MX:
    """Return the sparse matrix with the given entries; several at one place are added.

    Args:
        parts: rows, columns and values, in any order.
        shape: of the matrix.
    """
    none = np.zeros(0, dtype=np.int64)
    rows, columns = (np.concatenate([none, *(part[i] for part in parts)]) for i in (0, 1))
    values = ca.vertcat(ca.MX(0, 1), *(part[2] for part in parts))
    keys = columns * shape[0] + rows
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.diff(keys, prepend=-1) != 0
    places = keys[first]
    starts = np.searchsorted(places, shape[0] * np.arange(shape[1] + 1))
    pattern = ca.Sparsity(*shape, starts.tolist(), (places % shape[0]).tolist())
    nonzeros = values[order[first].tolist()]
    if not first.all():
        more, at = order[~first], np.cumsum(first)[~first] - 1
        add = ca.Sparsity.triplet(len(places), len(more), at.tolist(), list(range(len(more))))
        nonzeros += ca.DM(add, 1.0) @ values[more.tolist()]
    return ca.MX(pattern, nonzeros)
