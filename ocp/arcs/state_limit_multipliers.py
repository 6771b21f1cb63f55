"""Multipliers of state limits: converted from the index-reduced problem to direct adjoining."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.numerics.polynomials import lagrange_matrix, slope_matrix
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Contact
from ocp.solving.nlp_solver import NlpResult
from ocp.transcription.arc_layout import Condition
from ocp.transcription.grid import Grid
from ocp.transcription.nlp import Nlp

PRESSED = 1e-7  # multiplier of a limit, share of the cost per range of the limit, that counts


@dataclass(frozen=True, eq=False)
class LimitMultiplier:
    """The multiplier eta of a state limit that is active along an arc."""

    arc: int
    contact: Contact
    values: Array  # (e, d) at the points of the elements of the arc [cost/s per unit of the limit]


@dataclass(frozen=True)
class Jump:
    """The jump of the costate along the gradient of a state limit, before minus after."""

    arc: int  # index of the arc at whose start it happens
    contact: Contact
    height: float  # [cost per unit of the limit]


@dataclass(frozen=True, eq=False)
class LimitCondition:
    """The equations of an active state limit: c^(r) = 0 along an arc, or c = limit, c' = ... = 0 at its start."""

    condition: Condition
    arc: int
    contact: Contact
    along: bool  # along the arc, else at its start only
    order: int  # of the first derivative in the equations
    gradients: ca.Function  # (x, u, p) -> grad c, grad c', ..., grad c^(r - 1) of the limit

    def value(self, limits: tuple[StateLimit, ...]) -> Array:
        """Return the value (m,) that the expression of the condition must have."""
        limit, value = limits[self.contact.limit], np.zeros(self.condition.expression.numel())
        if self.order == 0:
            value[0] = limit.at(self.contact.side)
        return value


def adjoin_directly(
    limits: tuple[StateLimit, ...], conditions: tuple[LimitCondition, ...], nlp: Nlp, results: NlpResult,
    motion: tuple[Array, Array, Array], grid: Grid, numbers: Array,
) -> tuple[tuple[LimitMultiplier, ...], tuple[Jump, ...]]:  # fmt: skip
    """Turn the costates of the index-reduced problem into those with the state limits adjoined directly, in place.

    lambda = lambda_r + sum_k (-1)^k mu^(k) grad c^(r - 1 - k),  eta = (-1)^r mu^(r)

    with the multiplier mu of c^(r) = 0; eta >= 0 and jumps >= 0 at an upper limit of an optimal motion.
    """
    scheme = nlp.scheme
    states, controls, costates = motion
    seconds = grid.widths * sum(results.z[nlp.layout.horizon]) * nlp.scaling.horizon
    at_points = list(scheme.at)
    limit_multipliers: list[LimitMultiplier] = []
    jumps: list[Jump] = []
    entering: dict[tuple[int, Contact], float] = {}
    leaving: dict[tuple[int, Contact], float] = {}
    edges = lagrange_matrix(scheme.points, np.array([0.0, 1.0]))
    slopes = slope_matrix(scheme.points, scheme.points).T
    for own, rows in zip(conditions, nlp.conditions, strict=False):
        order, elements = own.order, own.condition.elements
        if not own.along:
            continue
        h = seconds[elements][:, None]
        raw = results.multipliers[rows[:, :, 0]]
        rates = [raw / own.condition.scale[0] / (scheme.weights * h)]
        for _ in range(order):
            rates.append(rates[-1] @ slopes / h)
        if order:
            x, u = (
                states[elements][:, at_points].reshape(-1, states.shape[2]),
                controls[elements].reshape(-1, controls.shape[2]),
            )
            result = mapped(own.gradients, len(x)).call([x.T, u.T, np.tile(numbers[:, None], len(x))])
            for k in range(order):
                gradient = np.array(result[order - 1 - k]).reshape(states.shape[2], len(x), order="F").T
                costates[elements] += (-1) ** k * rates[k][:, :, None] * gradient.reshape(costates[elements].shape)
            # mu^(r - 1) at both ends of the arc is part of the jumps there.
            last = (-1) ** (order - 1) * rates[order - 1]
            entering[own.arc, own.contact] = float(edges[0] @ last[0])
            leaving[own.arc, own.contact] = float(edges[1] @ last[-1])
        limit_multipliers.append(LimitMultiplier(own.arc, own.contact, (-1) ** order * rates[-1]))
    for own, rows in zip(conditions, nlp.conditions, strict=False):
        if not own.along and own.order == 0:
            push = float(results.multipliers[rows[0, 0, 0]] / own.condition.scale[0])
            jumps.append(Jump(own.arc, own.contact, push - entering.get((own.arc, own.contact), 0.0)))
    stays = {(arc, contact.limit, contact.side, contact.control) for arc, contact in entering}
    for (k, contact), height in leaving.items():
        # Where the limit stays active on the next arc, the jump is the difference of both sides; where another control
        # holds it there, mu belongs to another derivative.
        others = {(a, n, s) for a, n, s, control in stays if control != contact.control}
        if (k + 1, contact.limit, contact.side) in others:
            continue
        jumps.append(Jump(k + 1, contact, height - entering.get((k + 1, contact), 0.0)))
    return tuple(limit_multipliers), tuple(jumps)


def pressed_elements(limits: tuple[StateLimit, ...], nlp: Nlp, results: NlpResult) -> Array:
    """Return (N,) whether state limits have multipliers inside an element, as inequalities at its points.

    Args:
        limits: state limits of the problem.
        nlp: with its layout.
        results: of the solver.
    """
    layout, scaling, cost = nlp.layout, nlp.scaling, max(abs(results.cost), 1e-300)
    parts = {part: index for index, part in enumerate(nlp.path_parts)}
    pressed = np.zeros(len(layout.state), dtype=bool)
    for limit in limits:
        if limit.state >= 0:
            values = results.limits[layout.state[:, 1:-1, limit.state]] / scaling.x[limit.state]
        elif limit.order:
            values = results.multipliers[nlp.path[parts[limit.constraint, limit.component]]]
        else:
            continue
        pressed |= np.any(np.abs(values) * limit.range / cost > PRESSED, axis=1)
    return pressed
