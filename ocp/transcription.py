"""Direct collocation: a problem on a grid becomes a sparse programme with its derivatives.

Everything nonlinear happens at single points: one function of (x, u) at a collocation point, and one of both ends.
Each is differentiated once (SX, cse) and mapped; the rest is constant, sparse and linear, and scatters the small
derivatives into the large ones. So the symbolic work does not depend on the grid.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.assembly import Assembly, Local
from ocp.collocation import Scheme
from ocp.grid import Grid
from ocp.layout import lay_out
from ocp.problem import Fixed, Problem, Where, simple
from ocp.programme import Programme
from ocp.scaling import Scaling

Array = np.ndarray


def transcribe(problem: Problem, scheme: Scheme, grid: Grid, scaling: Scaling) -> Programme:
    """Return the programme of a problem on a grid.

    Args:
        problem: what to solve.
        scheme: from radau, legendre.
        grid: of [0, 1].
        scaling: magnitudes of the unknowns.
    """
    system, d, n = problem.system, scheme.degree, len(grid)
    nx, nu = system.x.numel(), system.u.numel()
    free = free_parameters(problem)
    fixed_horizon = isinstance(problem.horizon, Fixed)
    layout = lay_out(scheme, grid, nx, nu, not fixed_horizon, len(free))
    path_parts, ends_parts = _parts(problem)

    # Symbols of one point, in scaled unknowns.
    xs, us = ca.SX.sym("x", nx), ca.SX.sym("u", nu)
    duration_s, free_s = ca.SX.sym("T", layout.horizon.size), ca.SX.sym("free", len(free))
    p, fixed_duration, width = (
        ca.SX.sym("p", system.p.numel()),
        ca.SX.sym("T_fixed", int(fixed_horizon)),
        ca.SX.sym("h"),
    )
    shared = ca.vertcat(duration_s, free_s)
    duration = fixed_duration if fixed_horizon else duration_s * scaling.horizon
    parameters = ca.SX(p)
    for place, number in enumerate(free):
        parameters[int(number)] = free_s[place] * scaling.free[place]

    def physical(expression: ca.SX, x: ca.SX, u: ca.SX) -> ca.SX:
        inline = ca.Function("e", [system.x, system.u, system.p], [expression])
        return inline(x * scaling.x, u * scaling.u, parameters)

    path = ca.vertcat(*(problem.subject_to[i].expression[c] for i, c in path_parts))
    rate = width * duration * physical(system.rate, xs, us) / scaling.x
    running = width * duration * physical(problem.minimise.running, xs, us)
    point = Local(
        ca.densify(ca.vertcat(rate, physical(path, xs, us), running)),
        ca.vertcat(xs, us, shared), [p, fixed_duration, width], n * d,
    )  # fmt: skip

    first = ca.SX.sym("first", nx + nu)
    last = ca.SX.sym("last", nx + nu)
    sides = {Where.START: first, Where.END: last}

    def at_end(i: int, c: int, where: Where) -> ca.SX:
        expression = problem.subject_to[i].expression[c]
        if where is Where.PERIODIC:
            return at_end(i, c, Where.END) - at_end(i, c, Where.START)
        return physical(expression, sides[where][:nx], sides[where][nx:])

    at_ends = [at_end(i, c, where) for i, c, where in ends_parts]
    final = physical(problem.minimise.final, last[:nx], last[nx:]) + problem.minimise.time * duration
    ends = Local(ca.densify(ca.vertcat(*at_ends, final)), ca.vertcat(first, last, shared), [p, fixed_duration], 1)

    rows_d = np.arange(n * len(scheme.rate) * nx).reshape(n, len(scheme.rate), nx)
    rows_p = rows_d.size + np.arange(n * d * len(path_parts)).reshape(n, d, len(path_parts))
    rows_e = rows_d.size + rows_p.size + np.arange(len(ends_parts))
    assembly = Assembly(scheme, layout, point, ends, rows_d, rows_p, rows_e)
    nlp, derivatives = assembly.build(system.p.numel(), fixed_horizon)
    return Programme(
        problem, scheme, grid, scaling, layout, free, nlp, derivatives,
        rows_d, rows_p, rows_e, path_parts, ends_parts,
    )  # fmt: skip


def free_parameters(problem: Problem) -> Array:
    """Return the numbers of the parameters that an along(...) makes unknowns."""
    found = {
        place
        for constraint in problem.subject_to
        if constraint.where is Where.ALONG
        for place, _ in simple(constraint, problem.system.p)
    }
    return np.array(sorted(found), dtype=int)


def _parts(problem: Problem) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int, Where], ...]]:
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
            if not ca.depends_on(constraint.expression[c], system.u):
                # A limit on the state also holds at both ends, where a scheme may have no collocation point.
                ends += [(i, c, Where.START), (i, c, Where.END)]
    return tuple(path), tuple(ends)
