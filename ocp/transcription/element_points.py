"""Points of an element at which path constraints are rows, and matrices that select unknowns there."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.transcription.schemes.scheme import Control, Scheme


def block_diagonal(*blocks: Array) -> Array:
    """Return the matrix with the given blocks on its diagonal."""
    rows, columns = (np.cumsum([0, *(block.shape[i] for block in blocks)]) for i in (0, 1))
    whole = np.zeros((rows[-1], columns[-1]))
    for block, row, column in zip(blocks, rows, columns, strict=False):
        whole[row : row + block.shape[0], column : column + block.shape[1]] = block
    return whole


def path_points(scheme: Scheme, expression: ca.SX, u: ca.SX) -> list[float]:
    """Return the points of an element at which a path constraint is a row: the collocation points and the ends.

    A constraint on the state alone has the same value on both sides of an end, so the left end is left out; a constant
    control jumps there, so both ends count; a collocated one is not extrapolated to an end that is no point.
    """
    points = scheme.points.tolist()
    jumps = ca.depends_on(expression, u) and scheme.control is not Control.LINEAR
    if jumps:
        return sorted({*points, 0.0, 1.0} if scheme.control is Control.CONSTANT else {*points})
    return sorted({*points, 1.0} - {0.0})
