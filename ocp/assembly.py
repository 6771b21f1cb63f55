"""Assembly: small derivatives of local functions become the sparse ones of a programme."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.collocation import Scheme
from ocp.layout import Layout
from ocp.scatter import Scatter, Triplets, matrix_of, scatter

Array = np.ndarray
Entry = tuple[Array, float]  # rows (or columns) on all elements, and a coefficient


@dataclass(frozen=True, eq=False)
class Local:
    """A function of few local unknowns that stands at many places of the programme."""

    outputs: ca.SX  # (no,)
    unknowns: ca.SX  # (nw,)
    inputs: list[ca.SX]  # parameters, after the unknowns
    copies: int

    def function(self, expressions: list[ca.SX]) -> ca.Function:
        """Return expressions in the local unknowns and inputs as a function, mapped over all copies."""
        dense = [ca.densify(e) if e.is_column() else e for e in expressions]
        return ca.Function("local", [self.unknowns, *self.inputs], ca.cse(dense)).map(self.copies)


@dataclass(frozen=True, eq=False)
class Assembly:
    """Maps between the unknowns and rows of the programme and those of the local functions."""

    scheme: Scheme
    layout: Layout
    point: Local
    ends: Local
    defects: Array
    path: Array
    boundary: Array

    def build(self, np_: int, fixed_horizon: bool) -> tuple[dict[str, ca.MX], dict[str, ca.Function]]:
        """Return the programme's expressions and its derivative functions."""
        layout, point, ends = self.layout, self.point, self.ends
        size, rows = layout.size, self.defects.size + self.path.size + self.boundary.size
        z = ca.MX.sym("z", size)
        n, d = len(layout.state), self.scheme.degree
        s = ca.MX.sym("s", np_ + int(fixed_horizon) + n)
        p, fixed, widths = s[:np_], s[np_ : np_ + int(fixed_horizon)], s[np_ + int(fixed_horizon) :]
        point_in = [
            ca.reshape(self._gather(self._point_columns(), point) @ z, point.unknowns.numel(), point.copies),
            ca.repmat(p, 1, point.copies),
            ca.repmat(fixed, 1, point.copies),
            ca.reshape(ca.repmat(widths.T, d, 1), 1, n * d),
        ]
        ends_in = [self._gather(self._end_columns(), ends) @ z, p, fixed]

        outputs = point.outputs.numel()
        selects = self._select()  # (rows, outputs * copies): what each output adds to each row
        ends_selects = matrix_of(
            self.boundary, np.arange(self.boundary.size), np.ones(self.boundary.size), (rows, self.boundary.size + 1)
        )
        weights = np.zeros((point.copies, outputs))
        weights[:, -1] = np.tile(self.scheme.weights, n)
        weights_dm = ca.DM(weights.ravel())
        final_dm = ca.DM(np.append(np.zeros(self.boundary.size), 1.0))
        linear = matrix_of(*self._linear(), (rows, size))

        def cost_and_rows(values: ca.MX, ends_values: ca.MX) -> tuple[ca.MX, ca.MX]:
            flat = ca.vec(values)
            g = linear @ z + selects @ flat + ends_selects @ ends_values
            return ca.dot(weights_dm, flat) + ca.dot(final_dm, ends_values), g

        f, g = cost_and_rows(point.function([point.outputs])(*point_in), ends.function([ends.outputs])(*ends_in))

        # First derivatives: rows and cost of each local function have a list of nonzeros of its own.
        slopes, ends_slopes = ca.jacobian(point.outputs, point.unknowns), ca.jacobian(ends.outputs, ends.unknowns)
        both = point.function([point.outputs, _nonzeros(slopes)])(*point_in)
        ends_both = ends.function([ends.outputs, _nonzeros(ends_slopes)])(*ends_in)
        cost, constraints = cost_and_rows(both[0], ends_both[0])
        source = ca.vertcat(ca.vec(both[1]), ends_both[1])
        jacobian, gradient = self._first(slopes.sparsity(), ends_slopes.sparsity(), rows)
        gradient_dense = ca.densify(gradient(source))
        first = {
            "jac_g": ca.Function("nlp_jac_g", [z, s], [constraints, jacobian(source)], ["x", "p"], ["g", "jac_g_x"]),
            "grad_f": ca.Function("nlp_grad_f", [z, s], [cost, gradient_dense], ["x", "p"], ["f", "grad_f_x"]),
        }

        # Second derivatives: multipliers of the rows become multipliers of the local outputs.
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)
        local = ca.reshape(selects.T @ lam_g + weights_dm * lam_f, outputs, point.copies)
        ends_local = ends_selects.T @ lam_g + final_dm * lam_f
        curvature, pattern = self._hessian(point, local, point_in)
        ends_curvature, ends_pattern = self._hessian(ends, ends_local, ends_in)
        hessian = self._second(pattern, ends_pattern)(ca.vertcat(ca.vec(curvature), ends_curvature))
        second = ca.Function(
            "nlp_hess_l", [z, s, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        )
        return {"x": z, "p": s, "f": f, "g": g}, {**first, "hess_lag": second}

    def _hessian(self, local: Local, multipliers: ca.MX, inputs: list[ca.MX]) -> tuple[ca.MX, ca.Sparsity]:
        weights = ca.SX.sym("lam", local.outputs.numel())
        upper = ca.triu(ca.hessian(ca.dot(weights, local.outputs), local.unknowns)[0])
        weighted = Local(local.outputs, local.unknowns, [*local.inputs, weights], local.copies)
        return weighted.function([_nonzeros(upper)])(*inputs, multipliers), upper.sparsity()

    def _columns_of_end(self, element: int, tau: float) -> list[list[Entry]]:
        layout, node = self.layout, 0 if tau == 0.0 else -1
        shape = self.scheme.control_at(np.array([tau]))[0]
        states = [[(layout.state[element, node, i : i + 1], 1.0)] for i in range(layout.state.shape[2])]
        controls = [
            [(layout.control[element, m, i : i + 1], c) for m, c in enumerate(shape) if c != 0.0]
            for i in range(layout.control.shape[2])
        ]
        return states + controls

    def _shared_columns(self) -> list[list[Entry]]:
        return [[(np.array([place]), 1.0)] for place in (*self.layout.horizon, *self.layout.free)]

    def _end_columns(self) -> list[list[list[Entry]]]:
        first, last = self._columns_of_end(0, 0.0), self._columns_of_end(-1, 1.0)
        return [[*first, *last, *self._shared_columns()]]

    def _point_columns(self) -> list[list[list[Entry]]]:
        """Return for each point j and each local unknown the unknowns of all elements it is made of."""
        layout, shape = self.layout, self.scheme.control_at(self.scheme.points)
        nx, nu, n = layout.state.shape[2], layout.control.shape[2], len(layout.state)
        columns = []
        for j, node in enumerate(self.scheme.at):
            states = [[(layout.state[:, node, i], 1.0)] for i in range(nx)]
            controls = [[(layout.control[:, m, i], c) for m, c in enumerate(shape[j]) if c != 0.0] for i in range(nu)]
            shared = [[(np.repeat(place, n), c) for place, c in column] for column in self._shared_columns()]
            columns.append([*states, *controls, *shared])
        return columns

    def _point_rows(self) -> list[list[list[Entry]]]:
        """Return for each point j and each local output (but the cost) the rows it adds to."""
        rate, nx = self.scheme.rate, self.defects.shape[2]
        rows = []
        for j in range(self.scheme.degree):
            dynamics = [
                [(self.defects[:, i, a], -rate[i, j]) for i in range(len(rate)) if rate[i, j] != 0.0] for a in range(nx)
            ]
            rows.append([*dynamics, *([(self.path[:, j, c], 1.0)] for c in range(self.path.shape[2]))])
        return rows

    def _copy(self, j: int) -> Array:
        """Return the copies of the point function that stand at point j of the elements."""
        return np.arange(len(self.layout.state)) * self.scheme.degree + j

    def _gather(self, columns: list[list[list[Entry]]], local: Local) -> ca.DM:
        width = local.unknowns.numel()
        parts = []
        for j, unknowns in enumerate(columns):
            copies = self._copy(j) if local is self.point else np.zeros(1, dtype=int)
            for c, entries in enumerate(unknowns):
                parts += [(copies * width + c, place, coefficient, copies) for place, coefficient in entries]
        t = Triplets.gather(parts)
        return matrix_of(t.rows, t.columns, t.coefficients, (width * local.copies, self.layout.size))

    def _select(self) -> ca.DM:
        outputs = self.point.outputs.numel()
        parts = []
        for j, by_output in enumerate(self._point_rows()):
            for a, entries in enumerate(by_output):
                parts += [(rows, self._copy(j) * outputs + a, coefficient, rows) for rows, coefficient in entries]
        t = Triplets.gather(parts)
        rows = self.defects.size + self.path.size + self.boundary.size
        return matrix_of(t.rows, t.columns, t.coefficients, (rows, outputs * self.point.copies))

    def _linear(self) -> tuple[Array, Array, Array]:
        state, layout = self.scheme.state, self.layout
        parts = [
            (self.defects[:, i, :], layout.state[:, m, :], state[i, m], self.defects[:, i, :])
            for i in range(state.shape[0])
            for m in range(state.shape[1])
            if state[i, m] != 0.0
        ]
        t = Triplets.gather(parts)
        return t.rows, t.columns, t.coefficients

    def _first(self, slopes: ca.Sparsity, ends_slopes: ca.Sparsity, rows: int) -> tuple[Scatter, Scatter]:
        """Return the scatters of the constraint Jacobian and of the cost gradient."""
        nnz, outputs = slopes.nnz(), self.point.outputs.numel()
        sources = nnz * self.point.copies + ends_slopes.nnz()
        jacobian, gradient = [], []
        columns, point_rows = self._point_columns(), self._point_rows()
        for e, (a, c) in enumerate(zip(*slopes.get_triplet(), strict=True)):
            for j in range(self.scheme.degree):
                source = self._copy(j) * nnz + e
                for place, coefficient in columns[j][c]:
                    if a == outputs - 1:
                        gradient.append((place, 0, coefficient * self.scheme.weights[j], source))
                        continue
                    for row, factor in point_rows[j][a]:
                        jacobian.append((row, place, coefficient * factor, source))
        for e, (a, c) in enumerate(zip(*ends_slopes.get_triplet(), strict=True)):
            for place, coefficient in self._end_columns()[0][c]:
                source = np.array([nnz * self.point.copies + e])
                if a == self.boundary.size:
                    gradient.append((place, 0, coefficient, source))
                else:
                    jacobian.append((self.boundary[a : a + 1], place, coefficient, source))
        fixed_rows, fixed_columns, coefficients = self._linear()
        fixed = Triplets(fixed_rows, fixed_columns, coefficients, fixed_rows)
        shape = (rows, self.layout.size)
        return (
            scatter(Triplets.gather(jacobian), fixed, sources, shape),
            scatter(Triplets.gather(gradient), Triplets.gather([]), sources, (self.layout.size, 1)),
        )

    def _second(self, pattern: ca.Sparsity, ends_pattern: ca.Sparsity) -> Scatter:
        """Return the scatter of the upper triangle of the Hessian of the Lagrangian."""
        nnz, parts = pattern.nnz(), []
        sources = nnz * self.point.copies + ends_pattern.nnz()
        for j, columns in enumerate(self._point_columns()):
            for e, (b, c) in enumerate(zip(*pattern.get_triplet(), strict=True)):
                parts += _products(columns[b], columns[c], b == c, self._copy(j) * nnz + e)
        for e, (b, c) in enumerate(zip(*ends_pattern.get_triplet(), strict=True)):
            columns = self._end_columns()[0]
            parts += _products(columns[b], columns[c], b == c, np.array([nnz * self.point.copies + e]))
        t = Triplets.gather(parts)
        upper = t.rows <= t.columns
        kept = Triplets(t.rows[upper], t.columns[upper], t.coefficients[upper], t.sources[upper])
        return scatter(kept, Triplets.gather([]), sources, (self.layout.size, self.layout.size))


def _products(
    one: list[Entry], other: list[Entry], same: bool, source: Array
) -> list[tuple[Array, Array, float, Array]]:
    """Return the entries of a symmetric product of two linear combinations of unknowns."""
    parts = [(a, b, ca_ * cb, source) for a, ca_ in one for b, cb in other]
    return parts if same else parts + [(b, a, coefficient, source) for a, b, coefficient, source in parts]


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(matrix.nz[:]) if matrix.nnz() else ca.SX(0, 1)
