"""Equations of the state limits that are active along arcs or touched between them."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ocp.arcs.arc_problems import ArcProblem
from ocp.arcs.limit_arcs import chain_of
from ocp.arcs.state_limit_multipliers import LimitCondition
from ocp.checks import Array
from ocp.problem.boundary_states import ends
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Contact
from ocp.transcription.arc_layout import Condition
from ocp.transcription.conditions import condition_function
from ocp.transcription.direct_collocation import free_parameters
from ocp.transcription.local_functions import Repeated


def conditions_of(task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, seconds: float) -> tuple[LimitCondition, ...]:
    """Return the equations of the state limits that are active along an arc or touched at its start.

    Args:
        task: the problem.
        arcs: the structure.
        arc: (N,) index of the arc of each element.
        seconds: duration of the motion; sets the scales of derivatives.
    """
    _, _, (start_known, _) = ends(task.problem, task.numbers)
    conditions: list[LimitCondition] = []

    def condition(k: int, contact: Contact, orders: range, along: bool) -> LimitCondition:
        limit, own = task.limits[contact.limit], np.flatnonzero(arc == k)
        expression, made, gradients = _functions_of(task.problem, limit, contact.control, orders)
        scale = limit.range / seconds ** np.array(orders)
        elements, tau = (own, tuple(task.scheme.points)) if along else (own[:1], (0.0,))
        equation = Condition(expression, scale, elements, tau, made=made)
        return LimitCondition(equation, k, contact, along, orders[0], gradients)

    for k, a in enumerate(arcs):
        exact = [c for c in arcs[k - 1].held if c.control >= 0] if k else []
        before = {(c.limit, c.side): len(task.chain(c)) - 1 for c in exact}
        for contact in (c for c in a.held if c.control >= 0):
            order = len(task.chain(contact)) - 1
            # A limit of first order is held as well by c = limit at the points as by c' = 0, with shorter derivatives.
            conditions.append(condition(k, contact, range(1) if order == 1 else range(order, order + 1), True))
            # What the arc before holds already needs no condition, but derivatives of a higher order do.
            fulfilled = before.get((contact.limit, contact.side), 0)
            if order > fulfilled and not (k == 0 and start_known):
                conditions.append(condition(k, contact, range(fulfilled, order), False))
        # A limit on controls themselves that is held for no time leaves nothing to hold.
        for contact in (c for c in a.touched if task.limits[c.limit].order):
            conditions.append(condition(k, contact, range(min(task.limits[contact.limit].order, 2)), False))
    return tuple(conditions)


@functools.lru_cache(maxsize=128)
def _functions_of(
    problem: Problem, limit: StateLimit, control: int, orders: range
) -> tuple[ca.SX, Repeated, ca.Function]:
    """Return derivatives c^(k) of a state limit, k in `orders`, as functions, and the gradients of c, ..., c^(r-1).

    Every arc on the limit, of every structure that is tried, has the same ones.
    """
    system, chain = problem.system, chain_of(problem, limit, control) if control >= 0 else limit.chain
    chain = chain or limit.chain
    gradients = [ca.densify(ca.jacobian(c, system.x)) for c in chain[:-1]]
    function = ca.Function("gradients", [system.x, system.u, system.p], gradients)
    expression = ca.vertcat(*(chain[order] for order in orders))
    return expression, condition_function(problem, expression, free_parameters(problem)), function
