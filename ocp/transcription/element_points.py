"""Which constraints are rows of the NLP and at which points of an element; matrices that select unknowns there."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where, row_components
from ocp.problem.equations_along import path_equalities
from ocp.problem.problem import Problem
from ocp.transcription.layout import Layout
from ocp.transcription.schemes.scheme import Control, Scheme


def block_diagonal(*blocks: Array) -> Array:
    """Return the matrix with the given blocks on its diagonal."""
    rows, columns = (np.cumsum([0, *(block.shape[i] for block in blocks)]) for i in (0, 1))
    whole = np.zeros((rows[-1], columns[-1]))
    for block, row, column in zip(blocks, rows, columns, strict=False):
        whole[row : row + block.shape[0], column : column + block.shape[1]] = block
    return whole


def control_matrix(scheme: Scheme, tau: float, nu: int) -> Array:
    """Return the matrix that takes the control unknowns of an element to the control at tau."""
    return each(scheme.control_at(np.array([tau])), nu)


def unknowns_of(layout: Layout, elements: Array, arc: Array) -> Array:
    """Return the indices (nw, e) of states, controls, duration and free parameters of elements.

    Args:
        layout: of the unknowns.
        elements: (e,) indices.
        arc: (N,) arc of every element.
    """
    e = len(elements)
    durations = layout.horizon[arc[elements]][None, :] if len(layout.horizon) else np.zeros((0, e), dtype=int)
    states, controls = layout.state[elements].reshape(e, -1).T, layout.control[elements].reshape(e, -1).T
    return np.vstack([states, controls, durations, np.tile(layout.free[:, None], e)])


def each(matrix: Array, size: int) -> Array:
    """Return the matrix that combines columns (size,) as the given one combines numbers, its Kronecker product with I.

    Args:
        matrix: (r, c).
        size: of the columns.

    Returns:
        (r size, c size).
    """
    rows, columns = matrix.shape
    return (matrix[:, None, :, None] * np.eye(size)[:, None, :]).reshape(rows * size, columns * size)


def path_points(scheme: Scheme, expression: ca.SX, u: ca.SX) -> list[float]:
    """Return the points of an element at which a path constraint is a row: the collocation points and the ends.

    A constraint on the state alone has the same value on both sides of an end, so the left end is left out; a constant
    control jumps there, so both ends count; a collocated one is not extrapolated to an end that is no point.
    """
    points = scheme.points.tolist()
    jumps = ca.depends_on(expression, u) and scheme.control is not Control.LINEAR
    if jumps:
        return sorted({*points} if scheme.control is Control.COLLOCATED else {*points, 0.0, 1.0})
    return sorted({*points, 1.0} - {0.0})


def path_rows(problem: Problem, scheme: Scheme) -> tuple[tuple[int, int, int], ...]:
    """Return (constraint, component, rows of an element) of the constraints along the motion that need rows.

    Args:
        problem: with its constraints.
        scheme: whose points decide how many rows an element has.
    """
    expressions = ((i, c, problem.subject_to[i].expression[c]) for i, c in row_parts(problem, scheme)[0])
    return tuple((i, c, len(path_points(scheme, part, problem.system.u))) for i, c, part in expressions)


def row_parts(
    problem: Problem, scheme: Scheme
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int, Where], ...]]:
    """Return the components of constraints that need rows: those that are not bounds of single unknowns."""
    system = problem.system
    equalities = {(one.constraint, one.component) for one in path_equalities(problem)}
    path: list[tuple[int, int]] = []
    ends: list[tuple[int, int, Where]] = []
    for i, constraint in enumerate(problem.subject_to):
        for c in row_components(constraint, system):
            if (i, c) in equalities:
                continue
            if constraint.where is not Where.ALONG:
                ends.append((i, c, constraint.where))
                continue
            path.append((i, c))
            free = ca.depends_on(constraint.expression[c], system.u) and scheme.control is Control.COLLOCATED
            if not free and 0.0 not in path_points(scheme, constraint.expression[c], system.u):
                # The left ends of elements are left out, and with them the start of the motion.
                ends.append((i, c, Where.START))
    return tuple(path), tuple(ends)
