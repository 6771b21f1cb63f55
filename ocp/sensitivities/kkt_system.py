"""The linearised conditions of optimality of an NLP (Karush, Kuhn, Tucker), as a banded matrix."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.transcription.layout import Layout
from ocp.transcription.nlp import Nlp

DEPENDENT = 1e-11  # taken off the diagonal of the rows, so that rows may depend on each other; refined away


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Values and derivatives of an NLP at one place."""

    gradient: Array  # (nz,) of the cost
    g: Array  # (ng,)
    jacobian: ca.DM  # (ng, nz)
    hessian: ca.DM  # (nz, nz) upper triangle, of the Lagrangian


def conditions(nlp: Nlp, fixed: Array, rows: Array) -> Conditions:
    """Return the linearised conditions of an NLP, kept for its other solutions.

    Args:
        NLP: transcribed.
        fixed: (nz,) whether an unknown has one value only.
        rows: (k,) numbers of the rows that have limits.
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
    """Return cost gradient, rows and their derivatives."""
    g, jacobian = nlp.derivatives["jac_g"](z, s)
    gradient = nlp.derivatives["grad_f"](z, s)[1]
    hessian = nlp.derivatives["hess_lag"](z, s, 1.0, y)
    return Evaluation(np.array(gradient).ravel(), np.array(g).ravel(), jacobian, hessian)


class Conditions:
    """The linearised conditions of an NLP: where their entries stand, once for all values.

    An unknown that all elements share, such as the duration, would fill the factors; every element gets its own copy,
    with the copies linked in a chain. In the order of time the matrix is then banded.
    """

    def __init__(
        self, patterns: tuple[ca.Sparsity, ca.Sparsity], layout: Layout, elements: int, fixed: Array, rows: Array
    ) -> None:
        nz, ng, k = layout.size, patterns[1].size1(), len(rows)
        place = np.zeros(nz, dtype=int)
        for number in range(elements):
            place[layout.state[number]] = place[layout.control[number]] = number
        shared = np.zeros(nz + k + ng, dtype=bool)
        shared[layout.horizon] = shared[layout.free] = True
        (h_row, h_column), (j_row, j_column) = (np.array(p.get_triplet(), dtype=np.int64).reshape(2, -1)
                                                for p in patterns)  # fmt: skip
        upper = h_row != h_column
        # A row belongs to the first element that it speaks of; one of shared unknowns alone to the last.
        row_of = np.full(ng, elements)
        single = ~shared[j_column]
        np.minimum.at(row_of, j_row[single], place[j_column[single]])
        when = np.concatenate([place, np.minimum(row_of, elements - 1)[rows], np.minimum(row_of, elements - 1)])
        narrow = np.append(~shared[:nz], np.append(np.ones(k, dtype=bool), row_of < elements))
        first, second = nz + k, nz + np.arange(k)
        entries = [
            (h_row, h_column), (h_column[upper], h_row[upper]), (first + j_row, j_column), (j_column, first + j_row),
            (first + rows, second), (second, first + rows), (np.arange(nz + k),) * 2, (first + np.arange(ng),) * 2,
        ]  # fmt: skip
        row, column = (np.concatenate([part[i] for part in entries]) for i in (0, 1))
        # Copies of shared unknowns, one for each element from the first to the last that has to do with it.
        copies = nz + k + ng
        links = []
        for unknown in np.flatnonzero(shared):
            if unknown < nz and fixed[unknown]:
                continue
            by = row[column == unknown]
            by = by[by < len(narrow)]
            touched = when[by[narrow[by]]]
            low, high = (int(touched.min()), int(touched.max())) if len(touched) else (0, 0)
            mine = np.append(unknown, np.arange(copies, copies + high - low))
            copies += high - low
            when[unknown] = low
            when = np.append(when, np.arange(low + 1, high + 1))
            for index, other in ((row, column), (column, row)):
                here = (index == unknown) & (other < len(shared))
                here[here] = ~shared[other[here]]
                index[here] = mine[np.clip(when[other[here]] - low, 0, high - low)]
            links.append((mine[:-1], mine[1:], np.arange(low + 1, high + 1)))
        before, after, at = (np.concatenate([np.zeros(0, dtype=int), *(link[i] for link in links)]) for i in range(3))
        bond = copies + np.arange(len(before))
        row = np.concatenate([row, bond, bond, before, after])
        column = np.concatenate([column, before, after, bond, bond])
        when = np.append(when, at)
        self.keep = np.append(np.flatnonzero(~fixed), nz + np.arange(k))
        self.sizes, self.fixed = (nz, k, ng), fixed
        alive = np.ones(len(when), dtype=bool)
        alive[:nz] = ~fixed
        order = np.argsort(when[alive], kind="stable")
        self.order = np.flatnonzero(alive)[order]
        rank = np.full(len(when), -1)
        rank[self.order] = np.arange(len(self.order))
        row, column = rank[row], rank[column]
        self.chosen = (row >= 0) & (column >= 0)
        self.total = len(when)
        keys, self.places = np.unique(column[self.chosen] * len(order) + row[self.chosen], return_inverse=True)
        starts = np.searchsorted(keys, len(order) * np.arange(len(order) + 1))
        self.row, self.column = keys % len(order), keys // len(order)
        self.pattern = ca.Sparsity(len(order), len(order), starts.tolist(), self.row.tolist())
        self.upper, self.links = upper, len(before)
        self.solver = ca.Linsol("kkt", "qr", self.pattern)

    def at(self, hessian: ca.DM, jacobian: ca.DM, stiffness: Array) -> Linearised:
        """Return the conditions with their values.

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
        values = np.bincount(self.places, np.concatenate(parts)[self.chosen], self.pattern.nnz())
        values *= scale[self.row] * scale[self.column]
        shift = np.zeros(sum(self.sizes))
        shift[-ng:] = DEPENDENT
        known = self.order < len(shift)
        shifts = np.zeros((len(self.order), 1))
        shifts[known, 0] = shift[self.order[known]]
        return Linearised(self, ca.DM(self.pattern, ca.DM(values)), scale, shifts)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The linearised conditions at one place, scaled."""

    conditions: Conditions
    matrix: ca.DM
    scale: Array
    shift: Array  # what the diagonal lacks

    def solve(self, right: Array, refinements: int = 0) -> tuple[Array, Array, float]:
        """Solve for right-hand sides (nz + k + ng, c); fixed unknowns do not move.

        Returns:
            Z and y, (nz + k + ng, c).
            (c,) residuals, shares of the right-hand sides; they stay where rows that depend on each other contradict
            each other. NaN without refinements.
            By how much random unknowns are missed when looked for again: small if the unknowns are determined.
        """
        order, count = self.conditions.order, sum(self.conditions.sizes)
        known = order < count
        b = np.zeros((len(order), right.shape[1] + 1))
        b[known, :-1] = right[order[known]]
        b *= self.scale[:, None]
        random = np.random.default_rng(0).normal(size=len(order))
        b[:, -1] = self._product(random[:, None])[:, 0]
        size = np.max(np.abs(b), axis=0, initial=1e-300)
        # A call factorises and solves; refinements are for the shift and for rounding.
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
