"""Assembly: small derivatives of local functions become the sparse ones of a programme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.sparse import LinearMap, Scatter, Triplets, linear_map, scatter

Array = np.ndarray
Entry = tuple[Array, Array]  # places of unknowns (or rows) and coefficients, for each copy; zero: not there

Part = tuple[Array, Array | int, Array, Array]  # rows, columns, coefficients, numbers in the source


@dataclass(frozen=True, eq=False)
class Local:
    """A function of few unknowns that stands at many places of the programme.

    Args:
        outputs: (no,) expressions; each is added to rows of g, or to the cost.
        unknowns: (nw,) symbols, each a linear combination of unknowns of the programme.
        inputs: parameters, after the unknowns.
        copies: at how many places the function stands.
        columns: for each unknown, its linear combination on all copies.
        rows: for each output, the rows it adds to on all copies, with coefficients.
        cost: (no, copies) weights of the outputs in the cost.
    """

    outputs: ca.SX
    unknowns: ca.SX
    inputs: tuple[ca.SX, ...]
    copies: int
    columns: Sequence[Sequence[Entry]]
    rows: Sequence[Sequence[Entry]]
    cost: Array

    def function(self, expressions: list[ca.SX], *more: ca.SX) -> ca.Function:
        """Return expressions in the unknowns, inputs and `more` as a function, mapped over all copies."""
        inputs = [self.unknowns, *self.inputs, *more]
        return ca.Function("local", inputs, ca.cse([ca.densify(e) for e in expressions])).map(self.copies)

    def part(self, rows: bool = False, cost: bool = False) -> Local:
        """Return the function of the outputs that add to rows, to the cost, or to either, in the unknowns they use."""
        wanted = [
            a
            for a, entries in enumerate(self.rows)
            if (rows and len(entries) > 0) or (cost and self.cost[a].any() and not self.outputs[a].is_zero())
        ]
        kept = self.cost[wanted] if cost else np.zeros((len(wanted), self.copies))
        outputs = self.outputs[wanted]
        used = sorted(set(ca.jacobian_sparsity(outputs, self.unknowns).get_triplet()[1])) if wanted else []
        return replace(
            self,
            outputs=outputs,
            unknowns=ca.vertcat(*(self.unknowns[c] for c in used)) if used else ca.SX(0, 1),
            columns=[self.columns[c] for c in used],
            rows=[self.rows[a] for a in wanted],
            cost=kept,
        )

    def gather(self, z: ca.MX) -> ca.MX:
        """Return the unknowns of all copies (nw * copies,) from those of the programme (nz,)."""
        size, width, copies = z.numel(), self.unknowns.numel(), np.arange(self.copies)
        parts = [
            (copies * width + c, places, coefficient, copies)
            for c, entries in enumerate(self.columns)
            for places, coefficient in entries
        ]
        t = Triplets.gather(parts)
        return linear_map(t.rows, t.columns, t.coefficients, (width * self.copies, size))(z)

    def select(self, rows: int, transposed: bool = False) -> LinearMap:
        """Return the map from the outputs of all copies (no * copies,) to the rows they add to, or its transpose."""
        outputs, copies = self.outputs.numel(), np.arange(self.copies)
        parts = [
            (places, copies * outputs + a, coefficient, copies)
            for a, entries in enumerate(self.rows)
            for places, coefficient in entries
        ]
        t, size = Triplets.gather(parts), outputs * self.copies
        if transposed:
            return linear_map(t.columns, t.rows, t.coefficients, (size, rows))
        return linear_map(t.rows, t.columns, t.coefficients, (rows, size))

    def first(self, pattern: ca.Sparsity, before: int) -> tuple[list[Part], list[Part]]:
        """Return the entries of the constraint Jacobian and of the cost gradient; sources start at `before`."""
        copies, jacobian, gradient = np.arange(self.copies), list[Part](), list[Part]()
        for e, (a, c) in enumerate(zip(*pattern.get_triplet(), strict=True)):
            source = before + copies * pattern.nnz() + e
            for places, coefficient in self.columns[c]:
                jacobian += [(rows, places, coefficient * factor, source) for rows, factor in self.rows[a]]
                if self.cost[a].any():
                    gradient.append((places, 0, coefficient * self.cost[a], source))
        return jacobian, gradient

    def second(self, pattern: ca.Sparsity, before: int) -> list[Part]:
        """Return the entries of the Hessian of the Lagrangian for the upper triangle of the local one."""
        copies, parts = np.arange(self.copies), list[Part]()
        for e, (b, c) in enumerate(zip(*pattern.get_triplet(), strict=True)):
            source = before + copies * pattern.nnz() + e
            pairs = [(i, j, f * g, source) for i, f in self.columns[b] for j, g in self.columns[c]]
            parts += pairs if b == c else pairs + [(j, i, f, source) for i, j, f, source in pairs]
        return parts


Placed = tuple[Local, tuple[ca.MX, ...]]  # a local function with its unknowns and inputs, one column for each copy


def assemble(
    size: int,
    linear: tuple[Array, Array, Array],
    rows: int,
    time: tuple[Array, float, ca.MX],
    blocks: Sequence[tuple[Local, Sequence[ca.MX]]],
    z: ca.MX,
    s: ca.MX,
) -> tuple[dict[str, ca.MX], dict[str, ca.Function]]:
    """Return cost, rows and their derivative functions of a programme made of local functions.

    Args:
        size: number of unknowns.
        linear: rows, columns and values of the constant part of the rows.
        rows: number of rows of g.
        time: places of the durations among the unknowns, their price there, and the cost of a duration that is none.
        blocks: local functions, each with its inputs (one column for each copy).
        z: (size,) unknowns.
        s: parameters of the programme.
    """
    base = linear_map(*linear, (rows, size))(z)
    # What adds to the rows and what adds to the cost are functions of their own: IPOPT asks for them one by one.
    whole: list[Placed] = []
    limited: list[Placed] = []
    priced: list[Placed] = []
    for local, inputs in blocks:
        for group, part in (
            (whole, local.part(rows=True, cost=True)),
            (limited, local.part(rows=True)),
            (priced, local.part(cost=True)),
        ):
            if part.rows:
                unknowns = ca.reshape(part.gather(z), part.unknowns.numel(), part.copies)
                group.append((part, (unknowns, *inputs)))
    selects = [local.select(rows) for local, _ in limited]
    weights = [ca.DM(local.cost.ravel(order="F")) for local, _ in priced]

    def cost_of(values: list[ca.MX]) -> ca.MX:
        start = time[2] + (time[1] * ca.sum1(z[time[0].tolist()]) if len(time[0]) else 0.0)
        return sum((ca.dot(weight, ca.vec(v)) for weight, v in zip(weights, values, strict=True)), start)

    def rows_of(values: list[ca.MX]) -> ca.MX:
        return base + sum((select(ca.vec(v)) for select, v in zip(selects, values, strict=True)), ca.MX.zeros(rows, 1))

    # First derivatives: every local function returns the nonzeros of its own Jacobian.
    g_value, jacobian, g_sources, g_count = _slopes(limited)
    f_value, gradient, f_sources, f_count = _slopes(priced, cost=True)
    f = cost_of([local.function([local.outputs])(*argument) for local, argument in priced])
    g = rows_of([local.function([local.outputs])(*argument) for local, argument in limited])
    fixed = Triplets(linear[0], linear[1], linear[2], linear[0])
    slope = scatter(Triplets.gather(jacobian), fixed, g_count, (rows, size))(g_sources)
    priced_time = Triplets(time[0], np.zeros_like(time[0]), np.full(len(time[0]), time[1]), time[0])
    steepest = ca.densify(scatter(Triplets.gather(gradient), priced_time, f_count, (size, 1))(f_sources))

    # Second derivatives: multipliers of the rows and of the cost become multipliers of the local outputs.
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)
    sources, count = [], 0
    parts: list[Part] = []
    for local, argument in whole:
        lam = ca.SX.sym("lam", local.outputs.numel())
        upper = ca.triu(ca.hessian(ca.dot(lam, local.outputs), local.unknowns)[0])
        if upper.nnz() == 0:
            continue
        multiplier = local.select(rows, transposed=True)(lam_g)
        if local.cost.any():
            multiplier = multiplier + ca.DM(local.cost.ravel(order="F").tolist()) * lam_f
        shaped = ca.reshape(multiplier, local.outputs.numel(), local.copies)
        sources.append(ca.vec(local.function([_nonzeros(upper)], lam)(*argument, shaped)))
        parts += local.second(upper.sparsity(), count)
        count += upper.nnz() * local.copies
    curvature = _upper(Triplets.gather(parts), count, size)(ca.vertcat(*sources, ca.MX(0, 1)))
    cost, constraints = cost_of(f_value), rows_of(g_value)
    derivatives = {
        "jac_g": ca.Function("nlp_jac_g", [z, s], [constraints, slope], ["x", "p"], ["g", "jac_g_x"]),
        "grad_f": ca.Function("nlp_grad_f", [z, s], [cost, steepest], ["x", "p"], ["f", "grad_f_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [z, s, lam_f, lam_g], [curvature], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
    return {"x": z, "p": s, "f": f, "g": g}, derivatives


def _slopes(blocks: Sequence[Placed], cost: bool = False) -> tuple[list[ca.MX], list[Part], ca.MX, int]:
    """Return values, entries of the large derivative, its sources, and their number."""
    values, sources, count = [], [], 0
    entries: list[Part] = []
    for local, argument in blocks:
        slopes = ca.jacobian(local.outputs, local.unknowns)
        value, nonzeros = local.function([local.outputs, _nonzeros(slopes)])(*argument)
        values.append(value)
        sources.append(ca.vec(nonzeros))
        entries += local.first(slopes.sparsity(), count)[int(cost)]
        count += slopes.nnz() * local.copies
    return values, entries, ca.vertcat(*sources, ca.MX(0, 1)), count


def _upper(entries: Triplets, sources: int, size: int) -> Scatter:
    kept = entries.rows <= entries.columns
    upper = Triplets(entries.rows[kept], entries.columns[kept], entries.coefficients[kept], entries.sources[kept])
    return scatter(upper, Triplets.gather([]), sources, (size, size))


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(matrix.nz[:]) if matrix.nnz() else ca.SX(0, 1)
