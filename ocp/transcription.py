"""Direct collocation: a problem on a grid becomes a sparse programme with its derivatives.

Everything nonlinear happens at single points: one function of (x, u) at a collocation point, and one of both ends.
Each is differentiated once (SX, cse) and mapped; the rest is constant, sparse and linear, and scatters the small
derivatives into the large ones. So the symbolic work does not depend on the grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.assembly import Entry, Local, assemble
from ocp.collocation import Control, Scheme
from ocp.constraint import Where, simple
from ocp.division import Condition, Division, Near
from ocp.grid import Grid
from ocp.layout import Layout, lay_out
from ocp.problem import Fixed, Problem
from ocp.programme import Programme
from ocp.scaling import Scaling
from ocp.sparse import Triplets
from ocp.system import System

Array = np.ndarray


Block = tuple[Local, list[ca.MX]]  # a local function and its inputs, one column for each copy


def transcribe(
    problem: Problem, scheme: Scheme, grid: Grid, scaling: Scaling, division: Division | None = None
) -> Programme:
    """Return the programme of a problem on a grid.

    Args:
        problem: what to solve.
        scheme: from radau, legendre, lobatto.
        grid: of [0, 1].
        scaling: magnitudes of the unknowns.
        division: into arcs with durations of their own (the horizon must be Free); None for one arc.
    """
    system, n = problem.system, len(grid)
    division = Division(np.zeros(n, dtype=int)) if division is None else division
    nx, nu = system.x.numel(), system.u.numel()
    free = free_parameters(problem)
    fixed = int(isinstance(problem.horizon, Fixed))
    layout = lay_out(scheme, grid, nx, nu, 0 if fixed else division.arcs, len(free))
    path_parts, ends_parts = _parts(problem, scheme)
    tau = tuple(_path_places(scheme, problem.subject_to[i].expression[c], system.u) for i, c in path_parts)
    rows_d = np.arange(n * len(scheme.rate) * nx).reshape(n, len(scheme.rate), nx)
    counts = np.cumsum([rows_d.size, *(n * len(places) for places in tau)])
    rows_p = tuple(first + np.arange(n * len(t)).reshape(n, len(t)) for first, t in zip(counts, tau, strict=False))
    rows_e = counts[-1] + np.arange(len(ends_parts))
    last = int(counts[-1]) + len(ends_parts)
    rows_c = []
    for condition in division.conditions:
        shape = condition.expression.numel(), len(condition.elements) * len(condition.tau)
        rows_c.append(last + np.arange(shape[0] * shape[1]).reshape(shape))
        last += shape[0] * shape[1]
    rows_t = np.full(0 if division.total is None else len(layout.horizon), last)
    last += int(division.total is not None)

    s = ca.MX.sym("s", system.p.numel() + fixed + n)
    p, duration, widths = s[: system.p.numel()], s[system.p.numel() : system.p.numel() + fixed], s[-n:]
    inputs = _Inputs(p, duration, widths.T)
    symbols = _symbols(problem, layout, free, scaling)
    places = _Places(scheme, layout, division.arc)
    path = symbols.physical(ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in path_parts)))
    blocks = [
        _at_points(problem, places, symbols, inputs, path, (rows_d, rows_p), tau),
        *_at_edges(places, symbols, inputs, path, rows_p, tau),
        _at_ends(problem, places, symbols, inputs, ends_parts, rows_e),
        *(_at_chosen(places, symbols, inputs, c, r) for c, r in zip(division.conditions, rows_c, strict=True)),
        *(_near(places, symbols, inputs, near) for near in division.near),
    ]
    price = problem.minimise.time
    time = layout.horizon, price * scaling.horizon, ca.sum1(duration) * price if fixed else ca.MX(0)
    i, j, value = _linear(scheme, layout, rows_d)
    linear = (
        np.append(i, rows_t), np.append(j, layout.horizon[: len(rows_t)]),
        np.append(value, np.full(len(rows_t), scaling.horizon)),
    )  # fmt: skip
    z = ca.MX.sym("z", layout.size)
    nlp, derivatives = assemble(layout.size, linear, last, time, blocks, z, s)
    return Programme(
        problem, scheme, grid, scaling, layout, free, nlp, derivatives,
        rows_d, rows_p, rows_e, path_parts, ends_parts, tuple(rows_c), np.unique(rows_t),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Symbols:
    """Symbols of one place in scaled unknowns, and the way back to physical expressions."""

    system: System
    scaling: Scaling
    x: ca.SX  # (nx,) scaled state
    u: ca.SX  # (nu,) scaled control
    shared: ca.SX  # duration (if it is an unknown) and free parameters, scaled
    p: ca.SX  # (np,) parameters
    given: ca.SX  # fixed duration, or empty
    width: ca.SX  # of the element
    duration: ca.SX  # [s]
    parameters: ca.SX  # (np,) with the free ones replaced by unknowns

    @property
    def unknowns(self) -> ca.SX:
        """(nx + nu + shared,) unknowns of a function of one place."""
        return ca.vertcat(self.x, self.u, self.shared)

    def physical(self, expression: ca.SX, x: ca.SX | None = None, u: ca.SX | None = None) -> ca.SX:
        """Return an expression of the system in scaled unknowns, at this place or at (x, u)."""
        system, scaling = self.system, self.scaling
        inline = ca.Function("e", [system.x, system.u, system.p], [expression])
        x, u = self.x if x is None else x, self.u if u is None else u
        return ca.densify(inline(x * scaling.x, u * scaling.u, self.parameters))


def _symbols(problem: Problem, layout: Layout, free: Array, scaling: Scaling) -> _Symbols:
    system, fixed = problem.system, int(isinstance(problem.horizon, Fixed))
    shared = ca.SX.sym("shared", 1 - fixed + len(free))
    p, given = ca.SX.sym("p", system.p.numel()), ca.SX.sym("T", fixed)
    parameters = ca.SX(p)
    for place, number in enumerate(free):
        parameters[int(number)] = shared[1 - fixed + place] * scaling.free[place]
    x, u = ca.SX.sym("x", system.x.numel()), ca.SX.sym("u", system.u.numel())
    duration = given if fixed else shared[0] * scaling.horizon
    return _Symbols(system, scaling, x, u, shared, p, given, ca.SX.sym("h"), duration, parameters)


@dataclass(frozen=True, eq=False)
class _Inputs:
    """Parameters, fixed duration and widths of the elements, as inputs of local functions."""

    p: ca.MX
    duration: ca.MX
    widths: ca.MX  # (1, N)

    def copies(self, places: int) -> list[ca.MX]:
        """Return them for copies at a number of places of all elements, place by place."""
        count = self.widths.shape[1] * places
        return [ca.repmat(self.p, 1, count), ca.repmat(self.duration, 1, count), ca.repmat(self.widths, 1, places)]


def _at_points(
    problem: Problem, places: _Places, symbols: _Symbols, inputs: _Inputs, path: ca.SX,
    rows: tuple[Array, tuple[Array, ...]], tau: tuple[list[float], ...],
) -> Block:  # fmt: skip
    """Return the function of the collocation points: rates, running cost and path constraints."""
    scheme, (n, _, nx) = places.scheme, rows[0].shape
    step = symbols.width * symbols.duration
    rate = step * symbols.physical(symbols.system.rate) / symbols.scaling.x
    running = step * symbols.physical(problem.minimise.running)
    dynamics = [[(r, -factor) for r, factor in _rows_of_rate(scheme, rows[0][:, :, a])] for a in range(nx)]
    limits = [_rows_of_path(r, t, scheme.points) for r, t in zip(rows[1], tau, strict=True)]
    copies = n * scheme.degree
    cost = np.vstack([np.zeros((nx, copies)), np.repeat(scheme.weights, n), np.zeros((len(limits), copies))])
    local = Local(
        ca.vertcat(rate, running, path), symbols.unknowns, (symbols.p, symbols.given, symbols.width), copies,
        places.columns(list(scheme.points)), [*dynamics, [], *limits], cost,
    )  # fmt: skip
    return local, inputs.copies(scheme.degree)


def _at_edges(
    places: _Places, symbols: _Symbols, inputs: _Inputs, path: ca.SX,
    rows: tuple[Array, ...], tau: tuple[list[float], ...],
) -> list[Block]:  # fmt: skip
    """Return the function of path constraints at ends of elements that are no collocation points, if there are any."""
    edges = [t for t in (0.0, 1.0) if t not in places.scheme.points and any(t in held for held in tau)]
    if not edges:
        return []
    there = [c for c, held in enumerate(tau) if any(t in held for t in edges)]
    copies = len(places.layout.state) * len(edges)
    local = Local(
        path[there], symbols.unknowns, (symbols.p, symbols.given), copies, places.columns(edges),
        [_rows_of_path(rows[c], tau[c], np.array(edges)) for c in there], np.zeros((len(there), copies)),
    )  # fmt: skip
    return [(local, inputs.copies(len(edges))[:2])]


def _at_ends(
    problem: Problem, places: _Places, symbols: _Symbols, inputs: _Inputs,
    parts: tuple[tuple[int, int, Where], ...], rows: Array,
) -> Block:  # fmt: skip
    """Return the function of both ends of the motion: conditions there, and the final cost."""
    nx, nu = symbols.x.numel(), symbols.u.numel()
    first, last = ca.SX.sym("first", nx + nu), ca.SX.sym("last", nx + nu)
    sides = {where: ca.vertsplit(end, [0, nx, nx + nu]) for where, end in ((Where.START, first), (Where.END, last))}

    def condition(i: int, c: int, where: Where) -> ca.SX:
        if where is Where.PERIODIC:
            return condition(i, c, Where.END) - condition(i, c, Where.START)
        return symbols.physical(problem.subject_to[i].expression[c], *sides[where])

    final = symbols.physical(problem.minimise.final, *sides[Where.END])
    at_first = [[(q[:1], f[:1]) for q, f in column] for column in places.columns([0.0])[: nx + nu]]
    at_last = [[(q[-1:], f[-1:]) for q, f in column] for column in places.columns([1.0])]
    local = Local(
        ca.vertcat(*(condition(i, c, where) for i, c, where in parts), final),
        ca.vertcat(first, last, symbols.shared), (symbols.p, symbols.given), 1, [*at_first, *at_last],
        [*([(rows[b : b + 1], np.ones(1))] for b in range(len(parts))), []],
        np.append(np.zeros(len(parts)), 1.0)[:, None],
    )  # fmt: skip
    return local, [inputs.p, inputs.duration]


def _at_chosen(places: _Places, symbols: _Symbols, inputs: _Inputs, condition: Condition, rows: Array) -> Block:
    """Return the function of a condition that holds at places of chosen elements."""
    columns, count = places.chosen(condition.tau, condition.elements)
    outputs = (symbols.physical(condition.expression) - condition.value) / condition.size
    local = Local(
        outputs, symbols.unknowns, (symbols.p, symbols.given), count, columns,
        [[(row, np.ones(1))] for row in rows], np.zeros((outputs.numel(), count)),
    )  # fmt: skip
    return local, [ca.repmat(inputs.p, 1, count), ca.repmat(inputs.duration, 1, count)]


def _near(places: _Places, symbols: _Symbols, inputs: _Inputs, near: Near) -> Block:
    """Return the function of a price for leaving a reference."""
    columns, count = places.chosen(near.tau, near.elements)
    reference = ca.SX.sym("reference", len(near.controls))
    u = (symbols.u * symbols.scaling.u)[near.controls.tolist()]
    price = near.weight / 2.0 * symbols.width * symbols.duration * ca.sumsqr((u - reference) / near.size)
    weights = np.repeat(near.shares, len(near.elements))[None, :]
    local = Local(price, symbols.unknowns, (symbols.width, reference), count, columns, [[]], weights)
    widths = inputs.widths[near.elements.tolist()]
    return local, [ca.repmat(widths, 1, len(near.tau)), ca.MX(ca.DM(near.reference.T.tolist()))]


def _path_places(scheme: Scheme, expression: ca.SX, u: ca.SX) -> list[float]:
    """Return where a path constraint holds on an element: at its collocation points and at its ends.

    A limit on the state alone is the same on both sides of an end, so the left one is left out; a constant control
    jumps there, so both sides count; a collocated one is not extrapolated to an end without a point.
    """
    points = scheme.points.tolist()
    jumps = ca.depends_on(expression, u) and scheme.control is not Control.LINEAR
    if jumps:
        return sorted({*points, 0.0, 1.0} if scheme.control is Control.CONSTANT else {*points})
    return sorted({*points, 1.0} - {0.0})


@dataclass(frozen=True, eq=False)
class _Places:
    """What the unknowns of a local function are made of at given places of all elements."""

    scheme: Scheme
    layout: Layout
    arc: Array  # (N,) number of the arc of each element

    def columns(self, tau: list[float]) -> list[list[Entry]]:
        """Return the columns of [x; u; shared] for copies at tau_1 on all elements, then tau_2, and so on."""
        layout, scheme = self.layout, self.scheme
        nx, nu, n = layout.state.shape[2], layout.control.shape[2], len(layout.state)
        nodes = [int(np.argmin(np.abs(scheme.nodes - t))) for t in tau]
        shape = scheme.control_at(np.array(tau))
        states = [[(layout.state[:, nodes, i].T.ravel(), np.ones(1))] for i in range(nx)]
        controls = [
            [(np.tile(layout.control[:, m, i], len(tau)), np.repeat(shape[:, m], n)) for m in range(shape.shape[1])]
            for i in range(nu)
        ]
        durations = [[(np.tile(layout.horizon[self.arc], len(tau)), np.ones(1))]] if len(layout.horizon) else []
        shared = [[(np.full(n * len(tau), q), np.ones(1))] for q in layout.free]
        return [*states, *controls, *durations, *shared]

    def chosen(self, tau: tuple[float, ...], elements: Array) -> tuple[list[list[Entry]], int]:
        """Return the columns for copies at tau_1 on chosen elements, then tau_2, and so on, and their number."""
        n = len(self.layout.state)
        kept = (np.arange(len(tau))[:, None] * n + elements).ravel()
        every = n * len(tau)
        columns = [
            [(np.broadcast_to(q, every)[kept], np.broadcast_to(f, every)[kept]) for q, f in column]
            for column in self.columns(list(tau))
        ]
        return columns, len(kept)


def _rows_of_rate(scheme: Scheme, rows: Array) -> list[Entry]:
    """Return the defect rows (N, r) of one state that its rate adds to, for copies point by point."""
    d = scheme.degree
    return [(np.tile(rows[:, i], d), np.repeat(scheme.rate[i], len(rows))) for i in range(rows.shape[1])]


def _rows_of_path(rows: Array, tau: list[float], places: Array) -> list[Entry]:
    """Return the rows (N, m) of a path constraint that holds at tau, for copies at given places."""
    number = [tau.index(t) if t in tau else -1 for t in places.tolist()]
    held = np.repeat([float(k >= 0) for k in number], len(rows))
    return [(np.concatenate([rows[:, max(k, 0)] for k in number]), held)]


def _linear(scheme: Scheme, layout: Layout, defects: Array) -> tuple[Array, Array, Array]:
    """Return rows, columns and values of the part of the defects that is linear in the states."""
    parts = [
        (defects[:, i, :], layout.state[:, m, :], float(scheme.state[i, m]), defects[:, i, :])
        for i, m in np.argwhere(scheme.state != 0.0)
    ]
    t = Triplets.gather(parts)
    return t.rows, t.columns, t.coefficients


def free_parameters(problem: Problem) -> Array:
    """Return the numbers of the parameters that an along(...) makes unknowns."""
    found = {
        place
        for constraint in problem.subject_to
        if constraint.where is Where.ALONG
        for place, _ in simple(constraint, problem.system.p)
    }
    return np.array(sorted(found), dtype=int)


def _parts(problem: Problem, scheme: Scheme) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int, Where], ...]]:
    """Return the components of constraints that need rows: those that are no bounds of single unknowns."""
    system = problem.system
    path: list[tuple[int, int]] = []
    ends: list[tuple[int, int, Where]] = []
    for i, constraint in enumerate(problem.subject_to):
        bounds = ca.vertcat(system.x, system.u, system.p) if constraint.where is Where.ALONG else system.x
        done = set() if constraint.where is Where.PERIODIC else {c for _, c in simple(constraint, bounds)}
        for c in range(constraint.expression.numel()):
            if c in done:
                continue
            if constraint.where is not Where.ALONG:
                ends.append((i, c, constraint.where))
                continue
            path.append((i, c))
            free = ca.depends_on(constraint.expression[c], system.u) and scheme.control is Control.COLLOCATED
            if not free and 0.0 not in _path_places(scheme, constraint.expression[c], system.u):
                # The left ends of elements are left out, and with them the start of the motion.
                ends.append((i, c, Where.START))
    return tuple(path), tuple(ends)
