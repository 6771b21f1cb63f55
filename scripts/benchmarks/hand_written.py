"""Plain CasADi programs that a careful user would write by hand: the yardsticks of the benchmark.

They share no code with the project. All pose the same NLP: Radau IIA with three points, one constant control on
each element, scaled unknowns; first the unknowns (x at 0 and the two inner points, u) of each element, then the last
state and the duration. Only how derivatives come about differs:

    element   one SX function of one element, differentiated once, mapped, its nonzeros gathered into J and H
    map       the same function mapped, derivatives by CasADi
    sx        everything in one SX graph, derivatives by CasADi
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.problems import Case, Numbers, RunResult
from ocp.checks import Array

DEGREE = 3
Parts = tuple[dict[str, Any], dict[str, ca.Function]]  # the NLP, and derivative functions if there are any

NLPSOL = {
    "print_time": False, "error_on_fail": False, "record_time": True, "no_nlp_grad": True,
    "calc_lam_p": False, "calc_lam_x": False, "calc_f": False, "calc_g": False,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Element:
    """Symbols and expressions of one element, and of the ends of the motion, in scaled unknowns."""

    w: ca.SX  # x at the four nodes, u, T if free
    defects: ca.SX
    cost: ca.SX
    indices: Array  # (nw, N) of the unknowns in z
    x_first: ca.SX
    x_last: ca.SX
    ends: ca.SX  # conditions at the ends that are no bounds, each = 0
    ends_indices: Array
    size: int
    time: float  # cost of one unit of T


def solve(derive: Callable[[Element, int], Parts], case: Case, given: Numbers, solve_too: bool) -> RunResult:
    """Set a case up with one of the variants and solve it from given numbers."""
    cpu, begun = time.process_time(), time.perf_counter()
    n = len(given.u)
    element = describe(case, given, n)
    nlp, functions = derive(element, n)
    solver = ca.nlpsol("solver", "ipopt", nlp, {"ipopt": given.ipopt, **NLPSOL, **functions})
    z0, low, high = point_and_bounds(case, given, element)
    started = time.perf_counter()
    if not solve_too:
        return RunResult(started - begun, cpu=time.process_time() - cpu, setup_only=True)
    result = solver(x0=z0, lbx=low, ubx=high, lbg=0.0, ubg=0.0)
    spent = time.perf_counter() - started
    stats = solver.stats()
    inside = sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_"))
    note = "" if stats["return_status"] == "Solve_Succeeded" else str(stats["return_status"])
    return RunResult(
        started - begun, inside, max(spent - inside, 0.0), time.process_time() - cpu,
        stats["iter_count"], given.cost_scale * float(result["f"]), note=note,
    )  # fmt: skip


def describe(case: Case, given: Numbers, n: int) -> Element:
    """Return one element of a case: defects sum_m C_mj X_m - h f(X_j, u) and the quadrature of the cost."""
    nx, nu, free = case.system.x.numel(), case.system.u.numel(), int(case.free)
    rate_cost = ca.Function("f", [case.system.x, case.system.u], [case.system.rate, case.running])
    slopes, _, weights = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
    nodes, u, duration = ca.SX.sym("X", nx, DEGREE + 1), ca.SX.sym("u", nu), ca.SX.sym("T", free)
    h = (duration * given.duration_scale if free else case.duration) / n
    defects, cost = [], ca.SX(0)
    for j in range(DEGREE):
        rate, running = rate_cost(nodes[:, j + 1] * given.x_scale, u * given.u_scale)
        defects.append(nodes @ slopes[:, j] - h * rate / given.x_scale)
        cost += h * weights[j] * running / given.cost_scale
    block = DEGREE * nx + nu
    start = block * np.arange(n)
    own, last = np.arange(DEGREE * nx)[:, None], np.arange(nx)[:, None]
    control = DEGREE * nx + np.arange(nu)[:, None]
    size = n * block + nx + free
    shared = np.full((free, n), size - 1)
    indices = np.vstack([start + own, start + block + last, start + control, shared])

    first, final = ca.SX.sym("first", nx), ca.SX.sym("final", nx)
    rows, offset = [], 0
    for pins, end in ((case.start, first), (case.end, final)):
        for expression, values in pins:
            sizes = given.ends_scale[offset : offset + expression.numel()]
            offset += expression.numel()
            if not expression.is_valid_input():
                result = ca.Function("end", [case.system.x], [expression])(end * given.x_scale)
                rows.append((result - ca.DM(list(values))) / ca.DM(sizes))
    ends_indices = np.concatenate([np.arange(nx), n * block + np.arange(nx)])
    time = given.duration_scale / given.cost_scale if free else 0.0
    return Element(
        ca.vertcat(ca.vec(nodes), u, duration), ca.vertcat(*defects), cost, indices,
        first, final, ca.densify(ca.vertcat(*rows)), ends_indices, size, time,
    )  # fmt: skip


def point_and_bounds(case: Case, given: Numbers, element: Element) -> tuple[Array, Array, Array]:
    """Return the starting point and the bounds of the scaled unknowns."""
    nx, n, size = case.system.x.numel(), len(given.u), element.size
    z0, low, high = np.zeros(size), np.full(size, -np.inf), np.full(size, np.inf)
    state, control = element.indices[: (DEGREE + 1) * nx].T.reshape(n, -1, nx), element.indices[(DEGREE + 1) * nx :].T
    control = control[:, : given.u.shape[1]]
    z0[state], z0[control] = given.x / given.x_scale, given.u / given.u_scale
    low[state], high[state] = case.x[0] / given.x_scale, case.x[1] / given.x_scale
    low[control], high[control] = case.u[0] / given.u_scale, case.u[1] / given.u_scale
    position = {symbol.element_hash(): i for i, symbol in enumerate(ca.vertsplit(case.system.x))}
    for pins, indices in ((case.start, state[0, 0]), (case.end, state[-1, -1])):
        for expression, values in pins:
            if expression.is_valid_input():
                which = [position[symbol.element_hash()] for symbol in ca.vertsplit(expression)]
                low[indices[which]] = high[indices[which]] = np.asarray(values) / given.x_scale[which]
    if case.free:
        z0[-1], low[-1] = given.duration / given.duration_scale, 0.0
    return np.clip(z0, low, high), low, high


def by_elements(element: Element, n: int) -> Parts:
    """Return the NLP with its derivatives gathered from those of one element and of the ends."""
    size, rows_in, ends = element.size, element.defects.numel(), ca.vertcat(element.x_first, element.x_last)
    rows = rows_in * n + element.ends.numel()
    z, lam_f, lam_g = ca.MX.sym("z", size), ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)
    w, ends_w = _pick(z, element.indices), z[element.ends_indices.tolist()]

    def inside(*outputs: ca.SX, inputs: tuple[ca.SX, ...] = ()) -> ca.Function:
        return ca.Function("element", [element.w, *inputs], ca.cse([ca.densify(o) for o in outputs])).map(n)

    def at_ends(*outputs: ca.SX, inputs: tuple[ca.SX, ...] = ()) -> ca.Function:
        return ca.Function("ends", [ends, *inputs], ca.cse([ca.densify(o) for o in outputs]))

    jacobian, ends_jacobian = ca.jacobian(element.defects, element.w), ca.jacobian(element.ends, ends)
    values, slopes = inside(element.defects, _nonzeros(jacobian))(w)
    ends_values, ends_slopes = at_ends(element.ends, _nonzeros(ends_jacobian))(ends_w)
    g = ca.vertcat(ca.vec(values), ends_values)
    r, c = (np.array(part, dtype=int) for part in jacobian.sparsity().get_triplet())
    er, ec = (np.array(part, dtype=int) for part in ends_jacobian.sparsity().get_triplet())
    r = np.concatenate([(r[:, None] + rows_in * np.arange(n)).T.ravel(), rows_in * n + er])
    c = np.concatenate([element.indices[c].T.ravel(), element.ends_indices[ec]])
    jac_g = ca.Function(
        "nlp_jac_g", [z, ca.MX(0, 1)], [g, _gather(r, c, ca.vertcat(ca.vec(slopes), ends_slopes), (rows, size))],
        ["x", "p"], ["g", "jac_g_x"],
    )  # fmt: skip

    lam, lam_cost = ca.SX.sym("lam", rows_in), ca.SX.sym("lam_cost")
    lagrangian = ca.dot(lam, element.defects) + lam_cost * element.cost
    upper = ca.triu(ca.hessian(lagrangian, element.w)[0])
    second = inside(_nonzeros(upper), inputs=(lam, lam_cost))
    curvature = second(w, ca.reshape(lam_g[: rows_in * n], rows_in, n), ca.repmat(lam_f, 1, n))
    a, b = (element.indices[list(part)].T.ravel() for part in upper.sparsity().get_triplet())
    hessian = _gather(np.minimum(a, b), np.maximum(a, b), ca.vec(curvature), (size, size))
    if element.ends.numel():
        lam_end = ca.SX.sym("lam", element.ends.numel())
        upper = ca.triu(ca.hessian(ca.dot(lam_end, element.ends), ends)[0])
        curvature = at_ends(_nonzeros(upper), inputs=(lam_end,))(ends_w, lam_g[rows_in * n :])
        a, b = (element.ends_indices[list(part)] for part in upper.sparsity().get_triplet())
        hessian += _gather(a, b, curvature, (size, size))
    hess_lag = ca.Function(
        "nlp_hess_l", [z, ca.MX(0, 1), lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
    )

    f, gradient = element.time * z[-1], ca.MX(element.time * ca.DM(ca.Sparsity.unit(size, size - 1), 1.0))
    if not element.cost.is_zero():
        slope = ca.jacobian(element.cost, element.w)
        costs, slopes = inside(element.cost, _nonzeros(slope))(w)
        touched = element.indices[slope.sparsity().get_col()].T.ravel()
        f += ca.sum2(costs)
        gradient += _gather(touched, np.zeros_like(touched), ca.vec(slopes), (size, 1))
    grad_f = ca.Function("nlp_grad_f", [z, ca.MX(0, 1)], [f, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"])
    g = ca.vertcat(ca.vec(inside(element.defects)(w)), at_ends(element.ends)(ends_w))
    return {"x": z, "f": f, "g": g}, {"grad_f": grad_f, "jac_g": jac_g, "hess_lag": hess_lag}


def by_map(element: Element, n: int) -> Parts:
    """Return the NLP with the function of one element mapped; CasADi derives."""
    return _whole(element, n, ca.MX.sym("z", element.size)), {}


def by_graph(element: Element, n: int) -> Parts:
    """Return the NLP as one SX graph; CasADi derives."""
    return _whole(element, n, ca.SX.sym("z", element.size)), {}


def _whole(element: Element, n: int, z: Any) -> dict[str, Any]:
    defects: Any
    cost: Any
    inside = ca.Function("element", [element.w], [element.defects, element.cost])
    at_ends = ca.Function("ends", [ca.vertcat(element.x_first, element.x_last)], [element.ends])
    if isinstance(z, ca.SX):
        parts = [inside(z[element.indices[:, k].tolist()]) for k in range(n)]
        defects, cost = ca.vertcat(*(part[0] for part in parts)), ca.sum1(ca.vertcat(*(part[1] for part in parts)))
    else:
        result, costs = inside.map(n)(_pick(z, element.indices))
        defects, cost = ca.vec(result), ca.sum2(costs)
    g = ca.vertcat(defects, at_ends(z[element.ends_indices.tolist()]))
    return {"x": z, "f": element.time * z[-1] + cost, "g": g}


def _pick(z: ca.MX, indices: Array) -> ca.MX:
    return ca.reshape(z[indices.T.ravel().tolist()], *indices.shape)


def _gather(rows: Array, columns: Array, source: ca.MX, shape: tuple[int, int]) -> ca.MX:
    """Return the sparse matrix with these entries, no two at one index."""
    order = np.lexsort((rows, columns))
    starts = np.searchsorted(columns[order], np.arange(shape[1] + 1))
    pattern = ca.Sparsity(*shape, starts.tolist(), rows[order].tolist())
    return ca.MX(pattern, source[order.tolist()])


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.SX(matrix.nz[:]) if matrix.nnz() else ca.SX(0, 1)
