"""Local functions whose point is compiled once: the copies of an NLP are constant sparse combinations of its results.

A function of an element repeats the function of its points; compiling the element compiles as many copies of it. Here
the functions of one point are compiled, mapped over all points of the grid, and combined by products with constant
matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array

LARGE = 1500  # instructions of a Hessian from which on a point is compiled alone; a smaller one is faster inlined

Terms = Sequence[tuple[Array, Array]]
Patterns = dict[str, ca.Sparsity]


def point_functions(
    derivatives: tuple[ca.Function, ca.Function], given: Sequence[ca.SX], outer: Array, number: int
) -> tuple[dict[str, ca.Function], Patterns]:
    """Return the functions of one point and the patterns of their derivatives; rows that are not used are left out.

    Args:
        derivatives: (y, *inputs) -> v, dv/dy and (y, *inputs, weights) -> Hessian of weights . v.
        given: y and the inputs, symbols.
        outer: (m + 1, nv) not zero where a constraint or, in the last row, the cost uses v.
        number: of the block, for names.

    Returns:
        "rows" and "slopes" of the constraints, "cost" and "gradient", "curvature".
    """
    first, second = derivatives
    weights = ca.SX.sym("weights", outer.shape[1])
    values, jacobian = first(*given)
    functions, patterns = dict[str, ca.Function](), Patterns()
    for value, slope, used in (("rows", "slopes", outer[:-1].any(axis=0)), ("cost", "gradient", outer[-1] != 0.0)):
        chosen = np.flatnonzero(used).tolist()
        if chosen:
            slopes = ca.sparsify(jacobian[chosen, :])
            nonzeros = ca.vec(slopes.nz[:]) if slopes.nnz() else ca.SX(0, 1)
            parts = ca.cse([ca.densify(values[chosen]), nonzeros])
            functions[value] = ca.Function(f"{value}_{number}", list(given), parts[:1])
            functions[slope] = ca.Function(f"{slope}_{number}", list(given), parts)
            patterns[slope] = slopes.sparsity()
    bent = ca.sparsify(second(*given, weights))
    if bent.nnz():
        outputs = ca.cse([ca.vec(bent.nz[:])])
        functions["curvature"] = ca.Function(f"curvature_{number}", [*given, weights], outputs)
        patterns["curvature"] = bent.sparsity()
    return functions, patterns


@dataclass(frozen=True, eq=False)
class Points:
    """Functions of one point of a local function with the matrices that combine them.

    Args:
        functions, patterns: made by `point_functions`; the functions may be compiled.
        terms: matrices outer_j (m + 1, nv) and inner_j (ny, nw): results = linear w + sum_j outer_j v(inner_j w).
        linear: (m + 1, nw); the last row is the cost.
        wanted: patterns of the derivatives of the whole: "slopes" (m, nw), "gradient" (1, nw), "curvature" (nw, nw).
    """

    functions: dict[str, ca.Function]
    patterns: Patterns
    terms: Terms
    linear: Array
    wanted: Patterns

    def mapped(self, names: Sequence[str]) -> dict[str, Callable[..., ca.MX | tuple[ca.MX, ca.MX]]]:
        """Return functions of w (nw, copies), the inputs and, for the curvature, the multipliers, for all copies.

        Args:
            names: of "rows", "slopes", "cost", "gradient", "curvature".
        """
        made: dict[str, Callable[..., ca.MX | tuple[ca.MX, ca.MX]]] = {}
        for name in names:
            if name == "curvature":
                made[name] = self._curvature
            elif name in ("slopes", "gradient"):
                made[name] = lambda w, *inputs, name=name: self._slopes(name, w, inputs)
            else:
                made[name] = lambda w, *inputs, name=name: self._values(name, w, inputs)
        return made

    def _values(self, name: str, w: ca.MX, inputs: Sequence[ca.MX]) -> ca.MX:
        linear, terms = self._of(name)
        function = self.functions.get(name)
        return _sum(linear, terms, w, None if function is None else _called(function, terms, w, inputs)[0])

    def _slopes(self, name: str, w: ca.MX, inputs: Sequence[ca.MX]) -> tuple[ca.MX, ca.MX]:
        linear, terms = self._of(name)
        flat, places = linear.ravel("F"), _flat(self.wanted[name])
        total = ca.DM(flat[places].tolist()) @ ca.MX.ones(1, w.shape[1])
        function = self.functions.get(name)
        if function is None:
            return _sum(linear, terms, w, None), total
        values, nonzeros = _called(function, terms, w, inputs)
        row, column = _rows_and_columns(self.patterns[name])
        maps = [_moved(outer[:, row], inner[column], linear.shape) for outer, inner in terms]
        return _sum(linear, terms, w, values), _gathered(total, places, maps, nonzeros, len(row))

    def _curvature(self, w: ca.MX, *more: ca.MX) -> ca.MX:
        *inputs, lam = more
        weights = ca.horzcat(*(_matrix(outer.T) @ lam for outer, _ in self.terms))
        (nonzeros,) = _called(self.functions["curvature"], self.terms, w, inputs, weights)
        row, column = _rows_and_columns(self.patterns["curvature"])
        nw, places = w.shape[0], _flat(self.wanted["curvature"])
        maps = [_moved(inner[row].T, inner[column], (nw, nw), upper=True) for _, inner in self.terms]
        return _gathered(ca.MX.zeros(len(places), w.shape[1]), places, maps, nonzeros, len(row))

    def _of(self, name: str) -> tuple[Array, Terms]:
        """Return the linear part and the terms of the constraints or of the cost, of the rows v that they use."""
        rows = slice(None, -1) if name in ("rows", "slopes") else slice(-1, None)
        used = np.sum([np.abs(outer[rows]) for outer, _ in self.terms], axis=0).any(axis=0)
        return self.linear[rows], [(outer[rows][:, used], inner) for outer, inner in self.terms]


def _rows_and_columns(pattern: ca.Sparsity) -> tuple[Array, Array]:
    row, column = (np.array(part, dtype=np.int64) for part in pattern.get_triplet())
    return row, column


def _flat(pattern: ca.Sparsity) -> Array:
    """Return the places (k,) of the entries of a pattern, column by column, increasing."""
    row, column = _rows_and_columns(pattern)
    return np.asarray(row + pattern.size1() * column)


def _sum(linear: Array, terms: Terms, w: ca.MX, values: ca.MX | None) -> ca.MX:
    total = _matrix(linear) @ w
    if values is not None:
        for (outer, _), part in zip(terms, ca.horzsplit(values, w.shape[1]), strict=True):
            total += _matrix(outer) @ part
    return ca.densify(total)


def _gathered(
    total: ca.MX, places: Array, maps: Sequence[tuple[Array, Array, Array]], nonzeros: ca.MX, count: int
) -> ca.MX:
    """Return a total (k, copies) plus what the nonzeros of all terms (count, terms copies) add to it."""
    for (at, source, factor), part in zip(maps, ca.horzsplit(nonzeros, total.shape[1]), strict=True):
        place = np.searchsorted(places, at)
        total += ca.DM.triplet(place.tolist(), source.tolist(), ca.DM(factor.tolist()), len(places), count) @ part
    return ca.densify(total)


def _called(function: ca.Function, terms: Terms, w: ca.MX, inputs: Sequence[ca.MX], *more: ca.MX) -> list[ca.MX]:
    """Return the results of a function of a point at all points of all copies, term by term."""
    points = ca.horzcat(*(_matrix(inner) @ w for _, inner in terms))
    repeated = [ca.repmat(one, 1, len(terms)) for one in inputs]
    return list(function.map(points.shape[1]).call([ca.densify(points), *repeated, *map(ca.densify, more)]))


def _moved(left: Array, right: Array, shape: tuple[int, int], upper: bool = False) -> tuple[Array, Array, Array]:
    """Return (flat place in a matrix, nonzero, factor) of sum_e left[:, e] right[e, :] times nonzero e.

    Args:
        left: (rows, ne).
        right: (ne, columns).
        shape: rows and columns.
        upper: only places in the upper triangle.
    """
    i, e = np.nonzero(left)
    counts = [np.flatnonzero(right[k]) for k in range(len(right))]
    sizes = np.array([len(counts[k]) for k in e], dtype=np.int64)
    rows, sources = np.repeat(i, sizes), np.repeat(e, sizes)
    columns = np.concatenate([np.zeros(0, dtype=np.int64), *(counts[k] for k in e)])
    factors = left[rows, sources] * right[sources, columns]
    if upper:
        kept = rows <= columns
        rows, columns, sources, factors = rows[kept], columns[kept], sources[kept], factors[kept]
    return rows + shape[0] * columns, sources, factors


def _matrix(values: Array) -> ca.DM:
    row, column = np.nonzero(values)
    return ca.DM.triplet(row.tolist(), column.tolist(), ca.DM(values[row, column].tolist()), *values.shape)
