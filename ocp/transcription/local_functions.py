"""Functions of few unknowns that are repeated over the grid, with their derivatives as expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.transcription.compiled_blocks import LARGE, Points, point_functions
from ocp.transcription.implicit import Inner

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


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(matrix.nz[:]) if matrix.nnz() else ca.SX(0, 1)


def _sparse(matrix: Array) -> ca.DM:
    row, column = np.nonzero(matrix)
    return ca.DM.triplet(row.tolist(), column.tolist(), ca.DM(matrix[row, column].tolist()), *matrix.shape)
