"""Multipliers of state limits: from the index-reduced problem to the one with its limits adjoined directly."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.numerics.polynomials import lagrange_matrix, slope_matrix
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Contact
from ocp.solving.ipopt import Answer
from ocp.transcription.arc_division import Condition
from ocp.transcription.grid import Grid
from ocp.transcription.nlp import Nlp


@dataclass(frozen=True, eq=False)
class Pressure:
    """The multiplier eta of a state limit along an arc."""

    arc: int
    contact: Contact
    values: Array  # (e, d) at the points of the elements of the arc [cost/s per unit of the limit]


@dataclass(frozen=True)
class Jump:
    """The jump of the costate along the gradient of a state limit, before minus after."""

    arc: int  # at whose start it happens
    contact: Contact
    size: float  # [cost per unit of the limit]


@dataclass(frozen=True, eq=False)
class Tie:
    """A condition of an arc: that a limit is held along it, or met at its start."""

    condition: Condition
    arc: int
    contact: Contact
    along: bool
    gradients: ca.Function  # (x, u, p) -> grad c, grad c', ..., grad c^(r - 1) of the limit

    def value(self, limits: tuple[StateLimit, ...]) -> Array:
        """Return what the expression of the condition (m,) must be."""
        limit, value = limits[self.contact.limit], np.zeros(self.condition.expression.numel())
        if not (self.along and limit.order):
            value[0] = limit.at(self.contact.side)
        return value


def adjoin_directly(
    limits: tuple[StateLimit, ...], ties: tuple[Tie, ...], nlp: Nlp, answer: Answer,
    motion: tuple[Array, Array, Array], grid: Grid, numbers: Array,
) -> tuple[tuple[Pressure, ...], tuple[Jump, ...]]:  # fmt: skip
    """Turn the costates of the index-reduced problem into those with the state limits adjoined directly, in place.

    lambda = lambda_r + sum_k (-1)^k mu^(k) grad c^(r - 1 - k),  eta = (-1)^r mu^(r)

    with the multiplier mu of c^(r) = 0; eta >= 0 and jumps >= 0 at an upper limit of an optimal motion.
    """
    scheme = nlp.scheme
    states, controls, costates = motion
    seconds = grid.widths * sum(answer.z[nlp.layout.horizon]) * nlp.scaling.horizon
    at_points = list(scheme.at)
    pressures: list[Pressure] = []
    jumps: list[Jump] = []
    entering: dict[tuple[int, Contact], float] = {}
    leaving: dict[tuple[int, Contact], float] = {}
    edges = lagrange_matrix(scheme.points, np.array([0.0, 1.0]))
    slopes = slope_matrix(scheme.points, scheme.points).T
    for tie, rows in zip(ties, nlp.conditions, strict=True):
        limit, own = limits[tie.contact.limit], tie.condition.elements
        if not tie.along:
            continue
        h = seconds[own][:, None]
        raw = answer.multipliers[rows[:, :, 0]]
        rates = [raw / tie.condition.size[0] / (scheme.weights * h)]
        for _ in range(limit.order):
            rates.append(rates[-1] @ slopes / h)
        if limit.order:
            x, u = states[own][:, at_points].reshape(-1, states.shape[2]), controls[own].reshape(-1, controls.shape[2])
            result = mapped(tie.gradients, len(x)).call([x.T, u.T, np.tile(numbers[:, None], len(x))])
            for k in range(limit.order):
                gradient = np.array(result[limit.order - 1 - k]).reshape(states.shape[2], len(x), order="F").T
                costates[own] += (-1) ** k * rates[k][:, :, None] * gradient.reshape(costates[own].shape)
            # What the last derivative but one is at both ends of the arc is part of the jumps there.
            last = (-1) ** (limit.order - 1) * rates[limit.order - 1]
            entering[tie.arc, tie.contact] = float(edges[0] @ last[0])
            leaving[tie.arc, tie.contact] = float(edges[1] @ last[-1])
        pressures.append(Pressure(tie.arc, tie.contact, (-1) ** limit.order * rates[-1]))
    for tie, rows in zip(ties, nlp.conditions, strict=True):
        if not tie.along:
            push = float(answer.multipliers[rows[0, 0, 0]] / tie.condition.size[0])
            jumps.append(Jump(tie.arc, tie.contact, push - entering.get((tie.arc, tie.contact), 0.0)))
    for (k, contact), size in leaving.items():
        # A limit that the next arc goes on holding has one jump there, the difference of both sides.
        jumps.append(Jump(k + 1, contact, size - entering.get((k + 1, contact), 0.0)))
    return tuple(pressures), tuple(jumps)
