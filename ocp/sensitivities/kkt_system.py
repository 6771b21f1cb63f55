"""The linearised conditions of optimality of an NLP (Karush, Kuhn, Tucker) as a banded matrix."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import probes
from ocp.transcription.layout import Layout
from ocp.transcription.nlp import Nlp

# Subtracted from the diagonal of the constraint rows, which keeps the matrix regular if rows depend on each other;
# iterative refinement removes its effect.
DEPENDENT = 1e-11


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Values and derivatives of an NLP at one point."""

    gradient: Array  # (nz,) of the cost
    g: Array  # (ng,)
    jacobian: ca.DM  # (ng, nz)
    hessian: ca.DM  # (nz, nz) upper triangle, of the Lagrangian


def conditions(nlp: Nlp, fixed: Array, rows: Array) -> Conditions:
    """Return the structure of the linearised conditions of an NLP; cached for its other solutions.

    Args:
        nlp: transcribed.
        fixed: (nz,) whether the bounds leave an unknown one value only.
        rows: (k,) indices of the inequality rows.
    """
    functions = nlp.derivatives["hess_lag"], nlp.derivatives["jac_g"]
    return _conditions(functions, nlp.layout, len(nlp.grid), fixed.tobytes(), tuple(rows.tolist()))


@functools.lru_cache(maxsize=16)
def _conditions(
    functions: tuple[ca.Function, ca.Function], layout: Layout, elements: int, fixed: bytes, rows: tuple[int, ...]
) -> Conditions:
    patterns = functions[0].sparsity_out(0), functions[1].sparsity_out(1)
    return Conditions(patterns, layout, elements, np.frombuffer(fixed, dtype=bool), np.array(rows, dtype=int))


def evaluate(nlp: Nlp, z: Array, s: Array, y: Array) -> Evaluation:
    """Return cost gradient, constraint rows and their derivatives at z, for parameters s and multipliers y."""
    g, jacobian = nlp.derivatives["jac_g"](z, s)
    gradient = nlp.derivatives["grad_f"](z, s)[1]
    hessian = nlp.derivatives["hess_lag"](z, s, 1.0, y)
    return Evaluation(np.array(gradient).ravel(), np.array(g).ravel(), jacobian, hessian)


@dataclass(frozen=True, eq=False)
class _Entries:
    """Nonzeros of a square matrix (row, column), and the element of the grid that each unknown belongs to."""

    row: Array
    column: Array
    element: Array


def _shared(layout: Layout, count: int) -> Array:
    """Return whether each of `count` unknowns is shared by all elements: duration and free parameters."""
    shared = np.zeros(count, dtype=bool)
    shared[layout.horizon] = shared[layout.free] = True
    return shared


def _entries(
    patterns: tuple[ca.Sparsity, ca.Sparsity], layout: Layout, elements: int, rows: Array
) -> tuple[_Entries, Array]:
    """Return the entries of the matrix in z, w and y, and whether each unknown belongs to a single element."""
    nz, ng, k = layout.size, patterns[1].size1(), len(rows)
    element = np.zeros(nz, dtype=int)
    for number in range(elements):
        element[layout.state[number]] = element[layout.control[number]] = number
    shared = _shared(layout, nz)
    (h_row, h_column), (j_row, j_column) = (np.array(p.get_triplet(), dtype=np.int64).reshape(2, -1)
                                            for p in patterns)  # fmt: skip
    upper = h_row != h_column
    # A row belongs to the first element of which it has an unknown; a row of shared unknowns alone to the last.
    row_of = np.full(ng, elements)
    single = ~shared[j_column]
    np.minimum.at(row_of, j_row[single], element[j_column[single]])
    first = np.concatenate([element, np.minimum(row_of, elements - 1)[rows], np.minimum(row_of, elements - 1)])
    narrow = np.append(~shared, np.append(np.ones(k, dtype=bool), row_of < elements))
    start, slacks = nz + k, nz + np.arange(k)
    entries = [
        (h_row, h_column), (h_column[upper], h_row[upper]), (start + j_row, j_column), (j_column, start + j_row),
        (start + rows, slacks), (slacks, start + rows), (np.arange(nz + k),) * 2, (start + np.arange(ng),) * 2,
    ]  # fmt: skip
    row, column = (np.concatenate([part[i] for part in entries]) for i in (0, 1))
    return _Entries(row, column, first), narrow


def _copied(entries: _Entries, shared: Array, fixed: Array, narrow: Array) -> tuple[_Entries, int]:
    """Return the entries with a copy of every shared unknown for each element, and the number of links added.

    A link is a row and a column that make two neighbouring copies equal.
    """
    row, column, element = entries.row, entries.column, entries.element
    copies = len(shared)
    links = []
    for unknown in np.flatnonzero(shared):
        if fixed[unknown]:
            continue
        by = row[column == unknown]
        by = by[by < len(narrow)]
        used_in = element[by[narrow[by]]]
        low, high = (int(used_in.min()), int(used_in.max())) if len(used_in) else (0, 0)
        mine = np.append(unknown, np.arange(copies, copies + high - low))
        copies += high - low
        element[unknown] = low
        element = np.append(element, np.arange(low + 1, high + 1))
        for index, other in ((row, column), (column, row)):
            here = (index == unknown) & (other < len(shared))
            here[here] = ~shared[other[here]]
            index[here] = mine[np.clip(element[other[here]] - low, 0, high - low)]
        links.append((mine[:-1], mine[1:], np.arange(low + 1, high + 1)))
    before, after, at = (np.concatenate([np.zeros(0, dtype=int), *(link[i] for link in links)]) for i in range(3))
    link = copies + np.arange(len(before))
    row = np.concatenate([row, link, link, before, after])
    column = np.concatenate([column, before, after, link, link])
    return _Entries(row, column, np.append(element, at)), len(before)


class Conditions:
    """Sparsity of the linearised conditions of an NLP and the solver for it; values are filled in by `at`.

    An unknown shared by all elements, such as the duration, would fill the factors. Every element gets a copy of it,
    and rows added to the matrix make neighbouring copies equal. Ordered by time the matrix is then banded.
    """

    def __init__(
        self, patterns: tuple[ca.Sparsity, ca.Sparsity], layout: Layout, elements: int, fixed: Array, rows: Array
    ) -> None:
        nz, ng, k = layout.size, patterns[1].size1(), len(rows)
        entries, narrow = _entries(patterns, layout, elements, rows)
        entries, self.links = _copied(entries, _shared(layout, nz + k + ng), fixed, narrow)
        self.keep = np.append(np.flatnonzero(~fixed), nz + np.arange(k))
        self.sizes, self.fixed, self.total = (nz, k, ng), fixed, len(entries.element)
        h_row, h_column = patterns[0].get_triplet()
        self.upper = np.array(h_row) != np.array(h_column)
        alive = np.ones(self.total, dtype=bool)
        alive[:nz] = ~fixed
        order = np.argsort(entries.element[alive], kind="stable")
        self.order = np.flatnonzero(alive)[order]
        rank = np.full(self.total, -1)
        rank[self.order] = np.arange(len(self.order))
        row, column = rank[entries.row], rank[entries.column]
        self.chosen = (row >= 0) & (column >= 0)
        keys, self.positions = np.unique(column[self.chosen] * len(order) + row[self.chosen], return_inverse=True)
        starts = np.searchsorted(keys, len(order) * np.arange(len(order) + 1))
        self.row, self.column = keys % len(order), keys // len(order)
        self.pattern = ca.Sparsity(len(order), len(order), starts.tolist(), self.row.tolist())
        self.solver = ca.Linsol("kkt", "qr", self.pattern)

    def at(self, hessian: ca.DM, jacobian: ca.DM, stiffness: Array) -> Linearised:
        """Return the matrix with its values.

        Args:
            hessian: (nz, nz) upper triangle.
            jacobian: (ng, nz).
            stiffness: (nz + k,) added to the diagonal; rows and columns are scaled by its root.
        """
        scale = np.ones(self.total)
        scale[: len(stiffness)] = 1.0 / np.sqrt(np.maximum(stiffness, 1.0))
        scale = scale[self.order]
        h, j = (np.array(matrix.nz[:]).ravel() for matrix in (hessian, jacobian))
        (_, k, ng), ones = self.sizes, np.ones(self.links)
        parts = [h, h[self.upper], j, j, -np.ones(2 * k), stiffness, np.full(ng, -DEPENDENT), ones, -ones, ones, -ones]
        values = np.bincount(self.positions, np.concatenate(parts)[self.chosen], self.pattern.nnz())
        values *= scale[self.row] * scale[self.column]
        shift = np.zeros(sum(self.sizes))
        shift[-ng:] = DEPENDENT
        known = self.order < len(shift)
        shifts = np.zeros((len(self.order), 1))
        shifts[known, 0] = shift[self.order[known]]
        return Linearised(self, ca.DM(self.pattern, ca.DM(values)), scale, shifts)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The linearised conditions at one point, rows and columns scaled."""

    conditions: Conditions
    matrix: ca.DM
    scale: Array
    shift: Array  # (n, 1) what was subtracted from the diagonal

    def solve(self, right: Array, refinements: int = 0) -> tuple[Array, Array, float]:
        """Solve for right-hand sides; fixed unknowns do not move.

        Args:
            right: (nz + k + ng, c).
            refinements: rounds of iterative refinement, which remove the regularisation and rounding.

        Returns:
            Z and y, (nz + k + ng, c).
            (c,) residuals relative to the right-hand sides; large if dependent rows contradict each other. NaN
            without refinements.
            Largest error of a random vector recovered from its image; small if the unknowns are determined.
        """
        order, count = self.conditions.order, sum(self.conditions.sizes)
        known = order < count
        b = np.zeros((len(order), right.shape[1] + 1))
        b[known, :-1] = right[order[known]]
        b *= self.scale[:, None]
        random = probes((len(order),), -1.0, 1.0)
        b[:, -1] = self._product(random[:, None])[:, 0]
        size = np.max(np.abs(b), axis=0, initial=1e-300)
        # Every call of the solver factorises again.
        left = np.full(len(size), np.nan)
        result = self._solved(b if refinements else b[:, :-1])
        for _ in range(refinements):
            result = result + self._solved(b - self._product(result))
            left = np.max(np.abs(b - self._product(result)), axis=0) / size
        full = np.zeros((count, right.shape[1]))
        full[order[known]] = (result[:, : right.shape[1]] * self.scale[:, None])[known]
        if not refinements:
            return full, left[:-1], np.nan
        missed = np.abs(result[:, -1] - random)[order < self.conditions.sizes[0]]
        return full, left[:-1], float(np.nan_to_num(np.max(missed, initial=0.0), nan=np.inf))

    def _solved(self, b: Array) -> Array:
        try:
            return np.array(self.conditions.solver.solve(self.matrix, b))
        except RuntimeError:  # exactly singular
            return np.full_like(b, np.nan)

    def _product(self, columns: Array) -> Array:
        return np.asarray(np.array(ca.mtimes(self.matrix, columns)) + self.shift * columns)
