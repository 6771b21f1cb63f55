"""Sparse derivatives of an NLP, assembled from the small derivatives of functions that are repeated over the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.compilation import Compilation, Compile
from ocp.transcription.compiled_blocks import LARGE, Points, point_functions
from ocp.transcription.implicit import Inner
from ocp.transcription.scaled_nlp import derivative_functions

Entries = tuple[Array, Array, ca.MX]  # row indices, column indices and values (k,) of a sparse matrix
# Copies of a function from which on its common subexpressions are shared: that makes it 2 to 5 % shorter, a quarter and
# more with inner unknowns, and takes as long as the evaluations of 100 to 800 copies in a solve save.
MANY = 200


@dataclass(frozen=True, eq=False)
class Local:
    """A function of few unknowns w, repeated over the grid: rows and cost = linear w + sum_j outer_j v(inner_j w).

    Only v is differentiated, once for all terms of the sum.

    Args:
        values: (nv,) expressions v.
        arguments: (ny,) symbols of v.
        inputs: symbols of parameters, after the arguments.
        linear: (m + 1, nw) matrix; the first m results are rows of g, the last one is added to the cost.
        terms: matrices outer_j (m + 1, nv) and inner_j (ny, nw).
        unknowns: (nw, copies) indices of w among the unknowns of the NLP, for each copy.
        inner: the values in terms of inner unknowns that solve an equation, for shorter derivatives.
        made: the functions of v and its derivatives, if they are there already.
    """

    values: ca.SX
    arguments: ca.SX
    inputs: tuple[ca.SX, ...]
    linear: Array
    terms: Sequence[tuple[Array, Array]]
    unknowns: Array
    inner: Inner | None = None
    made: tuple[ca.Function, ca.Function] | None = None

    @property
    def rows(self) -> int:
        """Number of rows of one copy."""
        return len(self.linear) - 1

    @property
    def copies(self) -> int:
        """Number of copies on the grid."""
        return int(self.unknowns.shape[1])

    def divided(self, rows: Array, cost: float) -> Local:
        """Return the function with its rows (m,) and its cost divided by scales."""
        by = np.append(rows, cost)[:, None]
        return replace(self, linear=self.linear / by, terms=[(outer / by, inner) for outer, inner in self.terms])

    def derived(self) -> Derived:
        """Return results, Jacobian and Hessian as expressions in w."""
        w, lam = ca.SX.sym("w", len(self.unknowns)), ca.SX.sym("lam", len(self.linear))
        if self.values.is_zero():
            constant = _sparse(self.linear)
            zero = ca.SX(len(self.unknowns), len(self.unknowns))
            return Derived(w, lam, ca.densify(constant @ w), ca.SX(constant), zero)
        shared = self.copies >= MANY or (self.inner is not None and self.copies > 1)
        first, second = self.made or derivatives_of(self.values, self.arguments, self.inputs, self.inner, shared)
        # All terms at once: one column of arguments, values and multipliers for each.
        ny, nv, terms = self.arguments.numel(), self.values.numel(), len(self.terms)
        linear, outer = _sparse(self.linear), _sparse(np.hstack([one for one, _ in self.terms]))
        inner = _sparse(np.vstack([other for _, other in self.terms]))
        at = ca.reshape(inner @ w, ny, terms)
        value, slope = first(at, *self.inputs)
        curved = second(at, *self.inputs, ca.reshape(outer.T @ lam, nv, terms))
        results = ca.horzcat(linear, outer) @ ca.vertcat(w, ca.vec(value))
        slopes = linear + outer @ ca.diagcat(*ca.horzsplit(slope, ny)) @ inner
        upper = inner.T @ ca.diagcat(*ca.horzsplit(curved, ny)) @ inner
        return Derived(w, lam, ca.densify(results), slopes, ca.triu(upper))

    def points(self, whole: Derived, number: int) -> Points | None:
        """Return the functions of one point, for compilation; None if those of the whole compile faster.

        Args:
            whole: results and derivatives as expressions in w.
            number: of the block, for names.
        """
        if self.values.is_zero() or len(self.terms) < 2 or self.copies < 2:
            return None
        derivatives = self.made or derivatives_of(self.values, self.arguments, self.inputs, self.inner, True)
        if derivatives[1].n_instructions() < LARGE:
            return None
        used = np.sum([np.abs(outer) for outer, _ in self.terms], axis=0)
        made = point_functions(derivatives, (self.arguments, *self.inputs), used, number)
        wanted = {"slopes": whole.slopes[:-1, :], "gradient": whole.slopes[-1, :], "curvature": whole.upper}
        patterns = {name: part.sparsity() for name, part in wanted.items()}
        return Points(*made, self.terms, self.linear, patterns)

    @property
    def linear_cost(self) -> bool:
        """Whether it is a linear cost and has no rows; such a cost needs no functions."""
        return not self.rows and self.values.is_zero() and bool(self.linear.any())

    def linear_gradient(self) -> Entries:
        """Return the gradient of a linear cost."""
        column = self.unknowns.T.ravel()
        return column, np.zeros_like(column), ca.MX(ca.DM(np.tile(self.linear[-1], self.copies).tolist()))

    def triplets(self, pattern: ca.Sparsity) -> tuple[Array, Array]:
        """Return row and column indices in the NLP of the entries of a local matrix, for all copies."""
        row, column = (np.array(part, dtype=np.int64) for part in pattern.get_triplet())
        return (row + pattern.size1() * np.arange(self.copies)[:, None]).ravel(), self.unknowns[column].T.ravel()


@dataclass(frozen=True, eq=False)
class Repeated:
    """A function v(y, inputs) whose derivatives are made once for many NLPs: arguments of `Local`."""

    values: ca.SX
    arguments: ca.SX
    inputs: tuple[ca.SX, ...]
    derivatives: tuple[ca.Function, ca.Function]


def repeated(values: ca.SX, arguments: ca.SX, inputs: tuple[ca.SX, ...]) -> Repeated:
    """Return a function with its derivatives.

    Args:
        values: (nv,) expressions v.
        arguments: (ny,) symbols y.
        inputs: symbols of parameters.
    """
    return Repeated(values, arguments, inputs, derivatives_of(values, arguments, inputs))


def derivatives_of(
    values: ca.SX, arguments: ca.SX, inputs: tuple[ca.SX, ...], inner: Inner | None = None, shared: bool = True
) -> tuple[ca.Function, ca.Function]:
    """Return (y, inputs) -> v, dv/dy and (y, inputs, weights) -> Hessian of weights . v.

    Args:
        values, arguments, inputs, inner: as for `Local`.
        shared: whether common subexpressions are searched and evaluated once.
    """
    weights = ca.SX.sym("weights", values.numel())
    if inner is None:
        jacobian = ca.jacobian(values, arguments)
        curvature = ca.hessian(ca.dot(weights, values), arguments)[0]
    else:
        values, jacobian, curvature = inner.derivatives(arguments, weights)
    given = [arguments, *inputs]
    first, second = [values, jacobian], [curvature]
    if shared:
        first, second = ca.cse(first), ca.cse(second)
    return ca.Function("v", given, first), ca.Function("h", [*given, weights], second)


@dataclass(frozen=True, eq=False)
class Derived:
    """Expressions of a local function and its derivatives."""

    w: ca.SX  # (nw,) unknowns
    lam: ca.SX  # (m + 1,) multipliers of the results
    results: ca.SX  # (m + 1,)
    slopes: ca.SX  # (m + 1, nw) sparse
    upper: ca.SX  # (nw, nw) upper triangle of the Hessian of lam . results, sparse

    def functions(self, inputs: tuple[ca.SX, ...], number: int) -> dict[str, ca.Function]:
        """Return the functions of w and the inputs that an NLP calls; parts that are empty are left out.

        IPOPT evaluates cost, rows and their Jacobians separately, so each is a function of its own.
        """
        given, rows, cost = [self.w, *inputs], self.results[:-1], self.results[-1]
        slope, steepest = _nonzeros(self.slopes[:-1, :]), _nonzeros(self.slopes[-1, :])
        parts: dict[str, tuple[list[ca.SX], list[ca.SX]]] = {}
        if rows.numel():
            parts |= {"rows": (given, [rows]), "slopes": (given, [rows, slope])}
        if not cost.is_zero():
            parts |= {"cost": (given, [cost]), "gradient": (given, [cost, steepest])}
        if self.upper.nnz():
            parts["curvature"] = ([*given, self.lam], [_nonzeros(self.upper)])
        return {part: ca.Function(f"{part}_{number}", *both) for part, both in parts.items()}


def assemble(
    blocks: Sequence[tuple[Local, Sequence[ca.MX]]], z: ca.MX, s: ca.MX, translate: Compile | None = None
) -> tuple[dict[str, ca.MX], dict[str, ca.Function], Compilation | None]:
    """Return an NLP made of local functions: cost, rows, and the functions of their derivatives.

    Args:
        blocks: local functions in the order of their rows, each with its inputs (one column for each copy).
        z: (nz,) unknowns.
        s: parameters of the NLP.
        translate: compiles the functions that have more than one copy; its result is returned as well.
    """
    linear = [local for local, _ in blocks if local.linear_cost]
    blocks = [(local, inputs) for local, inputs in blocks if local.rows or not local.values.is_zero()]
    starts = np.cumsum([0, *(local.rows * local.copies for local, _ in blocks)]).tolist()
    size, count = z.numel(), starts[-1]
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", count)
    g, g_again = list[ca.MX](), list[ca.MX]()
    gradient, jacobian, hessian = [local.linear_gradient() for local in linear], list[Entries](), list[Entries]()
    f = f_again = sum((ca.dot(slope, z[index.tolist()]) for index, _, slope in gradient), ca.MX(0))
    derived = [local.derived() for local, _ in blocks]
    functions = [
        here.functions(local.inputs, k) for k, ((local, _), here) in enumerate(zip(blocks, derived, strict=True))
    ]
    compilation, points = None, dict[int, Points]()
    if translate is not None:
        given = [local.points(here, k) for k, ((local, _), here) in enumerate(zip(blocks, derived, strict=True))]
        points = {k: one for k, one in enumerate(given) if one is not None}
        sources = [points[k].functions if k in points else parts for k, parts in enumerate(functions)]
        repeated = [(k, part) for k, (local, _) in enumerate(blocks) if local.copies > 1 for part in sources[k]]
        compilation = translate([sources[k][part] for k, part in repeated])
        for (k, part), function in zip(repeated, compilation.functions, strict=True):
            sources[k][part] = function
    for k, (local, inputs) in enumerate(blocks):
        here, mapped = derived[k], dict[str, Any]()
        if k in points:
            mapped |= points[k].mapped(list(functions[k]))
        else:
            mapped |= {part: function.map(local.copies) for part, function in functions[k].items()}
        at = [ca.reshape(z[local.unknowns.T.ravel().tolist()], *local.unknowns.shape), *inputs]
        if "rows" in mapped:
            value, nonzeros = mapped["slopes"](*at)
            g.append(ca.vec(mapped["rows"](*at)))
            g_again.append(ca.vec(value))
            row, column = local.triplets(here.slopes[:-1, :].sparsity())
            jacobian.append((starts[k] + row, column, ca.vec(nonzeros)))
        if "cost" in mapped:
            value, nonzeros = mapped["gradient"](*at)
            f += _total(mapped["cost"](*at))
            f_again += _total(value)
            row, column = local.triplets(here.slopes[-1, :].sparsity())
            gradient.append((column, np.zeros_like(row), ca.vec(nonzeros)))
        if "curvature" in mapped:
            own = ca.reshape(lam_g[starts[k] : starts[k + 1]], local.rows, local.copies)
            lam = ca.vertcat(own, ca.repmat(lam_f, 1, local.copies))
            nonzeros = mapped["curvature"](*at, lam)
            one, other = (local.unknowns[list(part)].T.ravel() for part in here.upper.sparsity().get_triplet())
            hessian.append((np.minimum(one, other), np.maximum(one, other), ca.vec(nonzeros)))
    g_slopes = _column(g_again), sparse_matrix(jacobian, (count, size))
    f_slopes = f_again, ca.densify(sparse_matrix(gradient, (size, 1)))
    curvature = sparse_matrix(hessian, (size, size))
    derivatives = derivative_functions((z, s, lam_f, lam_g), f_slopes, g_slopes, curvature)
    return {"x": z, "p": s, "f": f, "g": _column(g)}, derivatives, compilation


def _column(parts: Sequence[ca.MX]) -> ca.MX:
    return parts[0] if len(parts) == 1 else ca.vertcat(ca.MX(0, 1), *parts)


def _total(row: ca.MX) -> ca.MX:
    return ca.sum2(row) if row.numel() > 1 else row


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(matrix.nz[:]) if matrix.nnz() else ca.SX(0, 1)


def _sparse(matrix: Array) -> ca.DM:
    row, column = np.nonzero(matrix)
    return ca.DM.triplet(row.tolist(), column.tolist(), ca.DM(matrix[row, column].tolist()), *matrix.shape)


def sparse_matrix(parts: Sequence[Entries], shape: tuple[int, int]) -> ca.MX:
    """Return the sparse matrix with the given entries; entries with the same indices are added.

    Args:
        parts: rows, columns and values, in any order.
        shape: of the matrix.
    """
    empty = np.zeros(0, dtype=np.int64)
    rows, columns = (np.concatenate([empty, *(part[i] for part in parts)]) for i in (0, 1))
    values = _column([part[2] for part in parts])
    keys = columns * shape[0] + rows
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.diff(keys, prepend=-1) != 0
    filled = keys[first]
    starts = np.searchsorted(filled, shape[0] * np.arange(shape[1] + 1))
    pattern = ca.Sparsity(*shape, starts.tolist(), (filled % shape[0]).tolist())
    nonzeros = values[order[first].tolist()]
    if not first.all():
        more, at = order[~first], np.cumsum(first)[~first] - 1
        add = ca.Sparsity.triplet(len(filled), len(more), at.tolist(), list(range(len(more))))
        nonzeros += ca.DM(add, 1.0) @ values[more.tolist()]
    return ca.MX(pattern, nonzeros)
