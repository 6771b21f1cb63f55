"""Vectors and matrices (3, 3) as lists of floats and CasADi scalars; zeros and ones never become operations."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

Entry = float | ca.SX
Vector = Sequence[Entry]
Matrix = Sequence[Sequence[Entry]]

ZERO: tuple[float, ...] = (0.0, 0.0, 0.0)
SNAP = 1e-12  # rotation entries and shares closer than this to 0, 1 or -1 are rounding errors of these numbers


def is_zero(a: Entry) -> bool:
    """Return whether an entry is the number 0."""
    return type(a) is float and a == 0.0


def add(*entries: Entry) -> Entry:
    """Return the sum, all numbers added first."""
    number, total = 0.0, None
    for entry in entries:
        if type(entry) is float:
            number += entry
        else:
            total = entry if total is None else total + entry
    if total is None:
        return number
    return total if number == 0 else total + number


def neg(a: Entry) -> Entry:
    """Return -a."""
    return 0.0 if is_zero(a) else -a


def sub(a: Entry, b: Entry) -> Entry:
    """Return a - b."""
    if is_zero(b):
        return a
    return -b if is_zero(a) else a - b


def mul(a: Entry, b: Entry) -> Entry:
    """Return a b."""
    if is_zero(a) or is_zero(b):
        return 0.0
    if type(a) is float and abs(a) == 1.0:
        return b if a == 1.0 else -b
    if type(b) is float and abs(b) == 1.0:
        return a if b == 1.0 else -a
    return a * b


def div(a: Entry, b: Entry) -> Entry:
    """Return a / b."""
    return 0.0 if is_zero(a) else a / b


def plus(*vectors: Vector) -> list[Entry]:
    """Return the sum of vectors of one length."""
    return [add(*components) for components in zip(*vectors, strict=True)]


def minus(a: Vector, b: Vector) -> list[Entry]:
    """Return a - b of two vectors."""
    return [sub(x, y) for x, y in zip(a, b, strict=True)]


def scaled(k: Entry, a: Vector) -> list[Entry]:
    """Return k a of a vector."""
    return [mul(k, x) for x in a]


def dot(a: Vector, b: Vector) -> Entry:
    """Return a . b."""
    return add(*(mul(x, y) for x, y in zip(a, b, strict=True)))


def cross(a: Vector, b: Vector) -> list[Entry]:
    """Return a x b."""
    return [sub(mul(a[i], b[j]), mul(a[j], b[i])) for i, j in ((1, 2), (2, 0), (0, 1))]


def apply(matrix: Matrix, a: Vector) -> list[Entry]:
    """Return the product of a matrix and a vector."""
    return [dot(row, a) for row in matrix]


def transposed(matrix: Matrix) -> list[list[Entry]]:
    """Return the transposed matrix."""
    return [list(column) for column in zip(*matrix, strict=True)]


def product(a: Matrix, b: Matrix) -> list[list[Entry]]:
    """Return the product of two matrices."""
    columns = transposed(b)
    return [[dot(row, column) for column in columns] for row in a]


def total(*matrices: Matrix) -> list[list[Entry]]:
    """Return the sum of matrices (3, 3)."""
    return [[add(*(m[i][j] for m in matrices)) for j in range(3)] for i in range(3)]


def scaled_matrix(k: Entry, a: Matrix) -> list[list[Entry]]:
    """Return k times a matrix."""
    return [scaled(k, row) for row in a]


def negative(a: Matrix) -> list[list[Entry]]:
    """Return minus a matrix."""
    return [[neg(x) for x in row] for row in a]


def symmetric(a: Sequence[Sequence[Entry]]) -> list[list[Entry]]:
    """Return the symmetric matrix of an upper triangle, with the same entries in the lower one."""
    return [[a[min(i, j)][max(i, j)] for j in range(3)] for i in range(3)]


def skew(p: Vector) -> list[list[Entry]]:
    """Return the matrix of p x."""
    return [[0.0, neg(p[2]), p[1]], [p[2], 0.0, neg(p[0])], [neg(p[1]), p[0], 0.0]]


def identity() -> list[list[Entry]]:
    """Return the unit matrix (3, 3)."""
    return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def zeros() -> list[list[Entry]]:
    """Return a zero matrix (3, 3)."""
    return [[0.0, 0.0, 0.0] for _ in range(3)]


def numeric(matrix: Matrix) -> np.ndarray:
    """Return a matrix of numbers as an array."""
    return np.array([[float(x) for x in row] for row in matrix])


def snapped(matrix: np.ndarray) -> list[list[Entry]]:
    """Return a rotation matrix as lists, with entries within rounding of 0, 1 and -1 made exact."""
    rows = np.array(matrix, dtype=float)
    for value in (0.0, 1.0, -1.0):
        rows[np.abs(rows - value) < SNAP] = value
    return [[float(x) for x in row] for row in rows]


def without_rounding(a: Vector, scale: float = 1.0) -> list[Entry]:
    """Return a vector with numbers below 1e-13 times a scale made 0."""
    return [0.0 if isinstance(x, int | float) and abs(x) <= 1e-13 * scale else x for x in a]


def column(entries: Vector) -> ca.SX:
    """Return entries as a CasADi column."""
    return ca.vertcat(*(ca.SX(x) for x in entries)) if len(entries) else ca.SX(0, 1)


def matrix_of(rows: Matrix) -> ca.SX:
    """Return rows of entries as a sparse CasADi matrix."""
    result = ca.SX(len(rows), len(rows[0]))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            if not is_zero(entry):
                result[i, j] = entry
    return result
