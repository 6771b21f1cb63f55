"""Conditions at chosen points of an NLP as local functions of the physical state and control there.

Scales stand beside these functions, not in them, so that their derivatives serve every NLP of the same problem.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.problem import Problem
from ocp.transcription.arc_layout import Condition
from ocp.transcription.element_points import block_diagonal, control_matrix, unknowns_of
from ocp.transcription.layout import Layout
from ocp.transcription.local_functions import Local, Repeated, repeated
from ocp.transcription.scaling import Scaling
from ocp.transcription.schemes.scheme import Scheme


def condition_function(problem: Problem, expression: ca.SX, free: Array) -> Repeated:
    """Return an expression of one point with its derivatives.

    Args:
        problem: with the system.
        expression: (m,) in x, u, p.
        free: indices of the parameters that are unknowns.
    """
    system = problem.system
    x, u, p = (ca.SX.sym(name, part.numel()) for name, part in zip("xup", (system.x, system.u, system.p), strict=True))
    unknown, parameters = ca.SX.sym("free", len(free)), ca.SX(p)
    for index, number in enumerate(free.tolist()):
        parameters[number] = unknown[index]
    function = ca.Function("c", [system.x, system.u, system.p], [ca.densify(expression)])
    return repeated(function(x, u, parameters), ca.vertcat(x, u, unknown), (p,))


def at_points(
    problem: Problem, scheme: Scheme, layout: Layout, unknowns: tuple[Scaling, Array], condition: Condition, arc: Array
) -> Local:  # fmt: skip
    """Return the function of a condition at points of chosen elements.

    Args:
        problem: with the system.
        scheme: of the elements.
        layout: of the unknowns.
        unknowns: their scaling, and the indices of the parameters that are unknowns.
        condition: what holds where.
        arc: (N,) arc of every element.
    """
    scaling, free = unknowns
    m, nu = layout.state.shape[1], layout.control.shape[2]
    function = condition_function(problem, condition.expression, free) if condition.made is None else condition.made
    count, durations = function.values.numel(), int(layout.horizon.size > 0)
    parameters = np.hstack([np.zeros((len(free), durations)), np.diag(scaling.free[: len(free)])])
    points, terms = 1 if condition.weights else len(condition.tau), []
    for j, t in enumerate(condition.tau):
        outer = np.zeros((count * points + 1, count))
        row, weight = (0, condition.weights[j]) if condition.weights else (j, 1.0)
        outer[row * count : (row + 1) * count] = np.diag(weight / np.broadcast_to(condition.scale, count))
        node = np.eye(m)[[int(np.argmin(np.abs(scheme.nodes - t)))]]
        control = np.diag(scaling.u) @ control_matrix(scheme, t, nu)
        terms.append((outer, block_diagonal(np.kron(node, np.diag(scaling.x)), control, parameters)))
    chosen = unknowns_of(layout, condition.elements, arc)
    linear = np.zeros((count * points + 1, len(chosen)))
    return Local(function.values, function.arguments, function.inputs, linear, terms, chosen, made=function.derivatives)
