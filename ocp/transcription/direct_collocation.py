"""Direct collocation: a problem on a grid becomes a sparse NLP with its derivatives.

One local function describes an element (defects, path constraints, running cost), one both ends of the motion. Each is
differentiated once, mapped over the grid and scattered into the large sparse matrices: the symbolic work does not
depend on the number of elements.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.compilation import Compile
from ocp.problem.constraints import Where, single_symbols
from ocp.problem.problem import Fixed, Problem
from ocp.transcription.arc_layout import ArcLayout, Penalty
from ocp.transcription.conditions import at_points
from ocp.transcription.derivatives import assemble
from ocp.transcription.element_points import block_diagonal, control_matrix, each, path_points, row_parts, unknowns_of
from ocp.transcription.equality_rows import equality_conditions
from ocp.transcription.grid import Grid
from ocp.transcription.implicit import inner_of
from ocp.transcription.layout import Layout, lay_out
from ocp.transcription.local_functions import Local
from ocp.transcription.nlp import Nlp
from ocp.transcription.scaled_nlp import ScaledNlp
from ocp.transcription.scaling import Scaling
from ocp.transcription.schemes.scheme import Scheme

Block = tuple[Local, list[ca.MX], Array]  # a local function, its inputs, and the scales of the rows of one copy


def transcribe(
    problem: Problem, scheme: Scheme, grid: Grid, scaling: Scaling, arc_layout: ArcLayout | None = None,
    translate: Compile | None = None,
) -> Nlp:  # fmt: skip
    """Return the NLP of a problem on a grid.

    Args:
        problem: what to solve.
        scheme: from radau, legendre, lobatto.
        grid: of [0, 1].
        scaling: of unknowns, cost and rows.
        arc_layout: arcs with durations of their own (the horizon must be Free); None for one arc.
        translate: makes compiled functions of those of an element; None for none.
    """
    system, n = problem.system, len(grid)
    nx, nu, np_ = system.x.numel(), system.u.numel(), system.p.numel()
    arc_layout = ArcLayout(np.zeros(n, dtype=int)) if arc_layout is None else arc_layout
    free = free_parameters(problem)
    fixed = int(isinstance(problem.horizon, Fixed))
    layout = lay_out(scheme, grid, nx, nu, 0 if fixed else arc_layout.arcs, len(free))
    path_parts, ends_parts = row_parts(problem, scheme)
    tau = tuple(path_points(scheme, problem.subject_to[i].expression[c], system.u) for i, c in path_parts)
    symbols = _symbols(problem, layout, free, scaling)
    element = _element(problem, scheme, layout, symbols, path_parts, tau, arc_layout.arc)
    ends = _ends(problem, scheme, layout, symbols, ends_parts)

    s = ca.MX.sym("s", np_ + fixed + n)
    p, duration, widths = s[:np_], s[np_ : np_ + fixed], s[-n:]
    of_path = [np.full(len(t), scaling.of_constraint(*part)) for part, t in zip(path_parts, tau, strict=True)]
    of_ends = np.array([scaling.of_constraint(i, c) for i, c, _ in ends_parts])
    conditions = arc_layout.conditions + equality_conditions(problem, scheme, n, scaling)
    held = [at_points(problem, scheme, layout, (scaling, free), one, arc_layout.arc) for one in conditions]
    blocks: list[Block] = [
        (element, [ca.repmat(p, 1, n), ca.repmat(duration, 1, n), widths.T],
         np.concatenate([np.ones(len(scheme.rate) * nx), *of_path])),
        (ends, [p, duration], of_ends),
        *((local, [ca.repmat(p, 1, local.copies)], np.ones(local.rows)) for local in held),
        *_of_arcs(arc_layout, layout, symbols, widths),
    ]  # fmt: skip
    scaled = [(local.divided(own, scaling.cost), inputs) for local, inputs, own in blocks]
    expressions, derivatives, compilation = assemble(scaled, ca.MX.sym("z", layout.size), s, translate)
    of_rows = np.concatenate([np.tile(own, local.copies) for local, _, own in blocks])
    rows = np.arange(n * element.rows).reshape(n, -1)
    defects, *path = np.split(rows, np.cumsum([len(scheme.rate) * nx, *(len(t) for t in tau)])[:-1], axis=1)
    counts = rows.size + np.cumsum([0, len(ends_parts), *(c.rows for c in conditions)])
    chosen = tuple(
        first + np.arange(c.rows).reshape(len(c.elements), 1 if c.weights else len(c.tau), -1)
        for first, c in zip(counts[1:], conditions, strict=False)
    )
    return Nlp(
        problem, scheme, grid, scaling, layout, free, ScaledNlp(expressions, derivatives, scaling.cost, of_rows),
        defects.reshape(n, -1, nx), tuple(path), rows.size + np.arange(len(ends_parts)), path_parts, ends_parts,
        chosen[: len(arc_layout.conditions)], counts[-1] + np.arange(int(arc_layout.total)), compilation,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Symbols:
    """Symbols that all points share: unknowns of the whole motion, and parameters."""

    shared: ca.SX  # duration (if it is an unknown) and free parameters, scaled
    p: ca.SX  # (np,) parameters
    given: ca.SX  # fixed duration, or empty
    duration: ca.SX  # [s]
    parameters: ca.SX  # (np,) with the free ones replaced by unknowns
    scaling: Scaling

    def physical(self, x: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return physical state, control and parameters from the scaled state and control of one point."""
        return x * self.scaling.x, u * self.scaling.u, self.parameters


def _symbols(problem: Problem, layout: Layout, free: Array, scaling: Scaling) -> _Symbols:
    fixed = int(isinstance(problem.horizon, Fixed))
    shared = ca.SX.sym("shared", 1 - fixed + len(free))
    p, given = ca.SX.sym("p", problem.system.p.numel()), ca.SX.sym("T", fixed)
    parameters = ca.SX(p)
    for index, number in enumerate(free):
        parameters[int(number)] = shared[1 - fixed + index] * scaling.free[index]
    duration = given if fixed else shared[0] * scaling.horizon
    return _Symbols(shared, p, given, duration, parameters, scaling)


def _element(
    problem: Problem, scheme: Scheme, layout: Layout, symbols: _Symbols,
    parts: tuple[tuple[int, int], ...], tau: tuple[list[float], ...], arc: Array,
) -> Local:  # fmt: skip
    """Return the function of an element: defects, every path constraint at its points, and the running cost."""
    system, (n, m, nx), (c, nu) = problem.system, layout.state.shape, layout.control.shape[1:]
    path = ca.vertcat(*(problem.subject_to[i].expression[k] for i, k in parts))
    inside = ca.Function("f", [system.x, system.u, system.p], [system.rate, problem.minimise.running, path])
    x, u, width = ca.SX.sym("x", nx), ca.SX.sym("u", nu), ca.SX.sym("h")
    physical = symbols.physical(x, u)
    rate, running, limited = inside(*physical)
    step = width * symbols.duration
    expressions = [problem.subject_to[i].expression[k] for i, k in parts]
    arguments = ca.vertcat(x, u, symbols.shared)
    inner = inner_of(problem, expressions, arguments, physical, step, symbols.scaling.x)

    defects, points = len(scheme.rate) * nx, scheme.points.tolist()
    rows = defects + np.cumsum([0, *(len(held) for held in tau)])
    shared = symbols.shared.numel()
    terms = []
    for t in sorted({*points}.union(*tau)):
        outer = np.zeros((rows[-1] + 1, nx + 1 + len(parts)))
        if t in points:
            outer[:defects, :nx] = each(-scheme.rate[:, [points.index(t)]], nx)
            outer[-1, nx] = scheme.weights[points.index(t)]
        for k, held in enumerate(tau):
            if t in held:
                outer[rows[k] + held.index(t), nx + 1 + k] = 1.0
        node = np.eye(m)[[int(np.argmin(np.abs(scheme.nodes - t)))]]
        terms.append((outer, block_diagonal(each(node, nx), control_matrix(scheme, t, nu), np.eye(shared))))
    linear = np.zeros((rows[-1] + 1, m * nx + c * nu + shared))
    linear[:defects, : m * nx] = each(scheme.state, nx)
    return Local(
        ca.vertcat(step * rate / symbols.scaling.x, step * running, limited), arguments,
        (symbols.p, symbols.given, width), linear, terms, unknowns_of(layout, np.arange(n), arc), inner,
    )  # fmt: skip


def _ends(
    problem: Problem, scheme: Scheme, layout: Layout, symbols: _Symbols, parts: tuple[tuple[int, int, Where], ...]
) -> Local:
    """Return the function of both ends of the motion: conditions there, the final cost and the weight of time."""
    system, minimise, nx, nu = problem.system, problem.minimise, layout.state.shape[2], layout.control.shape[2]
    if layout.horizon.size and not parts and minimise.final.is_zero() and minimise.initial.is_zero():
        return _sum_of_durations(layout, np.zeros(0), minimise.time * symbols.scaling.horizon)
    conditions = ca.vertcat(*(problem.subject_to[i].expression[k] for i, k, _ in parts))
    there = ca.Function("ends", [system.x, system.u, system.p], [conditions, minimise.final, minimise.initial])
    first, last = ca.SX.sym("first", nx + nu), ca.SX.sym("last", nx + nu)
    (before, _, initial), (after, final, _) = (
        there(*symbols.physical(*ca.vertsplit(w, [0, nx, nx + nu]))) for w in (first, last)
    )
    values = {Where.START: before, Where.END: after, Where.PERIODIC: after - before}
    rows = [values[where][k] for k, (_, _, where) in enumerate(parts)]
    cost = final + initial + (0.0 if layout.horizon.size else minimise.time * symbols.duration)

    at = [layout.state[0, 0], layout.control[0].ravel(), layout.state[-1, -1], layout.control[-1].ravel()]
    # The first element may be the last one as well.
    indices = np.unique(np.concatenate([*at, layout.horizon, layout.free]))
    number = np.searchsorted(indices, np.concatenate([*at, layout.horizon[:1], layout.free]))
    shared = symbols.shared.numel()
    inner = block_diagonal(
        *(m for t in (0.0, 1.0) for m in (np.eye(nx), control_matrix(scheme, t, nu))), np.eye(shared)
    )
    linear = np.zeros((len(rows) + 1, len(indices)))
    linear[-1, np.isin(indices, layout.horizon)] = minimise.time * symbols.scaling.horizon
    return Local(
        ca.vertcat(*rows, cost), ca.vertcat(first, last, symbols.shared), (symbols.p, symbols.given), linear,
        [(np.eye(len(rows) + 1), inner @ np.eye(len(indices))[number])], indices[:, None],
    )  # fmt: skip


def _of_arcs(arc_layout: ArcLayout, layout: Layout, symbols: _Symbols, widths: ca.MX) -> Iterator[Block]:
    """Yield the penalties of an arc layout, the rows for the sum and the ties of its durations, and their evenness."""
    for penalty in arc_layout.penalties:
        reference = ca.MX(ca.DM(penalty.reference.reshape(len(penalty.elements), -1).T.tolist()))
        local = _penalty(layout, symbols, penalty, arc_layout.arc)
        yield local, [widths[penalty.elements.tolist()].T, reference], np.zeros(0)
    if arc_layout.total:
        scale = np.full(1, symbols.scaling.horizon)
        yield _sum_of_durations(layout, scale, 0.0), [], scale
    if arc_layout.ties is not None:
        first, ratios = arc_layout.ties
        yield _ties(layout, first), [ca.MX(ca.DM(ratios.tolist())).T], np.ones(1)
    if arc_layout.evenness:
        yield _unevenness(layout, arc_layout.evenness), [], np.zeros(0)


def _penalty(layout: Layout, symbols: _Symbols, penalty: Penalty, arc: Array) -> Local:
    """Return the penalty on the controls of one element as a local function."""
    (m, nx), (c, nu) = layout.state.shape[1:], layout.control.shape[1:]
    width, reference = ca.SX.sym("h"), ca.SX.sym("reference", c * len(penalty.controls))
    u, shared = ca.SX.sym("u", c * nu), symbols.shared
    squares = ca.SX(0)
    for j in range(c):
        own = ca.vertcat(*(u[j * nu + int(i)] * symbols.scaling.u[int(i)] for i in penalty.controls))
        aim = reference[j * len(penalty.controls) : (j + 1) * len(penalty.controls)]
        squares += penalty.quadrature[j] * ca.sumsqr((own - aim) / penalty.scale)
    value = penalty.weight / 2.0 * width * symbols.duration * squares
    rest = c * nu + shared.numel()
    inner = np.hstack([np.zeros((rest, m * nx)), np.eye(rest)])
    indices = unknowns_of(layout, penalty.elements, arc)
    return Local(
        value,
        ca.vertcat(u, shared),
        (width, reference),
        np.zeros((1, len(indices))),
        [(np.ones((1, 1)), inner)],
        indices,
    )


def _sum_of_durations(layout: Layout, rows: Array, cost: float) -> Local:
    """Return the sum of all durations, times numbers (m,) as rows and times a number as part of the cost."""
    linear = np.tile(np.append(rows, cost)[:, None], len(layout.horizon))
    return Local(ca.SX(1, 1), ca.SX.sym("none"), (), linear, [], layout.horizon[:, None])


def _ties(layout: Layout, first: Array) -> Local:
    """Return the equations that give neighbouring arc durations their ratios."""
    pair, ratio = ca.SX.sym("pair", 2), ca.SX.sym("ratio")
    terms = [(np.array([[1.0], [0.0]]), np.eye(2))]
    indices = np.stack([layout.horizon[first], layout.horizon[first + 1]])
    return Local(pair[1] - ratio * pair[0], pair, (ratio,), np.zeros((2, 2)), terms, indices)


def _unevenness(layout: Layout, weight: float) -> Local:
    """Return the penalty on the difference of two neighbouring arc durations, divided by their scale."""
    pair, h = ca.SX.sym("pair", 2), layout.horizon
    value = weight * (pair[1] - pair[0]) ** 2
    return Local(value, pair, (), np.zeros((1, 2)), [(np.ones((1, 1)), np.eye(2))], np.stack([h[:-1], h[1:]]))


def free_parameters(problem: Problem) -> Array:
    """Return the numbers of the parameters that an along(...) makes unknowns."""
    result = {
        index
        for constraint in problem.subject_to
        if constraint.where is Where.ALONG
        for number, index, _ in single_symbols(constraint, problem.system)
        if number == 2
    }
    return np.array(sorted(result), dtype=int)
