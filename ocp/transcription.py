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
from ocp.grid import Grid
from ocp.layout import Layout, lay_out
from ocp.problem import Fixed, Problem
from ocp.programme import Programme
from ocp.scaling import Scaling
from ocp.sparse import Triplets

Array = np.ndarray


def transcribe(problem: Problem, scheme: Scheme, grid: Grid, scaling: Scaling) -> Programme:
    """Return the programme of a problem on a grid.

    Args:
        problem: what to solve.
        scheme: from radau, legendre, lobatto.
        grid: of [0, 1].
        scaling: magnitudes of the unknowns.
    """
    system, d, n = problem.system, scheme.degree, len(grid)
    nx, nu = system.x.numel(), system.u.numel()
    free = free_parameters(problem)
    fixed = int(isinstance(problem.horizon, Fixed))
    layout = lay_out(scheme, grid, nx, nu, not fixed, len(free))
    path_parts, ends_parts = _parts(problem, scheme)
    tau = [_path_places(scheme, problem.subject_to[i].expression[c], system.u) for i, c in path_parts]
    rows_d = np.arange(n * len(scheme.rate) * nx).reshape(n, len(scheme.rate), nx)
    counts = np.cumsum([rows_d.size, *(n * len(places) for places in tau)])
    rows_p = tuple(first + np.arange(n * len(t)).reshape(n, len(t)) for first, t in zip(counts, tau, strict=False))
    rows_e = counts[-1] + np.arange(len(ends_parts))

    # Symbols of one place, in scaled unknowns.
    xs, us = ca.SX.sym("x", nx), ca.SX.sym("u", nu)
    shared = ca.SX.sym("shared", layout.horizon.size + len(free))
    p, given, width = ca.SX.sym("p", system.p.numel()), ca.SX.sym("T", fixed), ca.SX.sym("h")
    duration = given if fixed else shared[0] * scaling.horizon
    parameters = ca.SX(p)
    for place, number in enumerate(free):
        parameters[int(number)] = shared[1 - fixed + place] * scaling.free[place]

    def physical(expression: ca.SX, x: ca.SX, u: ca.SX) -> ca.SX:
        inline = ca.Function("e", [system.x, system.u, system.p], [expression])
        return ca.densify(inline(x * scaling.x, u * scaling.u, parameters))

    rate = width * duration * physical(system.rate, xs, us) / scaling.x
    running = width * duration * physical(problem.minimise.running, xs, us)
    path = physical(ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in path_parts)), xs, us)
    unknowns = ca.vertcat(xs, us, shared)

    z = ca.MX.sym("z", layout.size)
    s = ca.MX.sym("s", system.p.numel() + fixed + n)
    p_mx, given_mx, widths = s[: system.p.numel()], s[system.p.numel() : system.p.numel() + fixed], s[-n:]
    each = widths.T  # one column for each element
    places = _Places(scheme, layout)
    dynamics = [[(rows, -factor) for rows, factor in _rows_of_rate(scheme, rows_d[:, :, a])] for a in range(nx)]
    point = Local(
        ca.vertcat(rate, running, path), unknowns, (p, given, width), n * d, places.columns(list(scheme.points)),
        [*dynamics, [], *(_rows_of_path(rows, t, scheme.points) for rows, t in zip(rows_p, tau, strict=True))],
        np.vstack([np.zeros((nx, n * d)), np.repeat(scheme.weights, n), np.zeros((len(path_parts), n * d))]),
    )  # fmt: skip
    blocks = [(point, _inputs(p_mx, given_mx, each, d))]
    edges = [t for t in (0.0, 1.0) if t not in scheme.points and any(t in places_ for places_ in tau)]
    if edges:
        there = [c for c, places_ in enumerate(tau) if any(t in places_ for t in edges)]
        edge = Local(
            path[there], unknowns, (p, given), n * len(edges), places.columns(edges),
            [_rows_of_path(rows_p[c], tau[c], np.array(edges)) for c in there],
            np.zeros((len(there), n * len(edges))),
        )  # fmt: skip
        blocks.append((edge, _inputs(p_mx, given_mx, each, len(edges))[:2]))

    first, last = ca.SX.sym("first", nx + nu), ca.SX.sym("last", nx + nu)
    sides = {where: ca.vertsplit(end, [0, nx, nx + nu]) for where, end in ((Where.START, first), (Where.END, last))}

    def at_end(i: int, c: int, where: Where) -> ca.SX:
        if where is Where.PERIODIC:
            return at_end(i, c, Where.END) - at_end(i, c, Where.START)
        return physical(problem.subject_to[i].expression[c], *sides[where])

    final = physical(problem.minimise.final, *sides[Where.END])
    at_first = [[(q[:1], f[:1]) for q, f in column] for column in places.columns([0.0])[: nx + nu]]
    at_last = [[(q[-1:], f[-1:]) for q, f in column] for column in places.columns([1.0])]
    ends = Local(
        ca.vertcat(*(at_end(i, c, where) for i, c, where in ends_parts), final),
        ca.vertcat(first, last, shared), (p, given), 1,
        [*at_first, *at_last],
        [*([(rows_e[b : b + 1], np.ones(1))] for b in range(len(ends_parts))), []],
        np.append(np.zeros(len(ends_parts)), 1.0)[:, None],
    )  # fmt: skip
    blocks.append((ends, [p_mx, given_mx]))
    linear = _linear(scheme, layout, rows_d)
    price = problem.minimise.time
    time = layout.horizon, price * scaling.horizon, ca.sum1(given_mx) * price if fixed else ca.MX(0)
    nlp, derivatives = assemble(layout.size, linear, int(counts[-1]) + len(ends_parts), time, blocks, z, s)
    return Programme(
        problem, scheme, grid, scaling, layout, free, nlp, derivatives,
        rows_d, rows_p, rows_e, path_parts, ends_parts,
    )  # fmt: skip


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
        shared = [[(np.full(n * len(tau), q), np.ones(1))] for q in (*layout.horizon, *layout.free)]
        return [*states, *controls, *shared]


def _rows_of_rate(scheme: Scheme, rows: Array) -> list[Entry]:
    """Return the defect rows (N, r) of one state that its rate adds to, for copies point by point."""
    d = scheme.degree
    return [(np.tile(rows[:, i], d), np.repeat(scheme.rate[i], len(rows))) for i in range(rows.shape[1])]


def _rows_of_path(rows: Array, tau: list[float], places: Array) -> list[Entry]:
    """Return the rows (N, m) of a path constraint that holds at tau, for copies at given places."""
    number = [tau.index(t) if t in tau else -1 for t in places.tolist()]
    held = np.repeat([float(k >= 0) for k in number], len(rows))
    return [(np.concatenate([rows[:, max(k, 0)] for k in number]), held)]


def _inputs(p: ca.MX, duration: ca.MX, widths: ca.MX, places: int) -> list[ca.MX]:
    """Return parameters, fixed duration and widths for copies at a number of places of all elements."""
    count = widths.shape[1] * places
    return [ca.repmat(p, 1, count), ca.repmat(duration, 1, count), ca.repmat(widths, 1, places)]


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
