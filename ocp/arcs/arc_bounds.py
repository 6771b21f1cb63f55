"""Bounds of the NLP of arcs: free controls at the ends of elements, state limits drawn in, sums of durations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp.arcs.arc_problems import ArcProblem
from ocp.arcs.optimality_check import Crossing
from ocp.checks import Array
from ocp.problem.problem import Free, Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Kind
from ocp.transcription.arc_layout import Condition
from ocp.transcription.nlp import Nlp

Sides = tuple[Array, Array, Array, Array]  # lower and upper bounds of unknowns, then of rows


def open_ends_of(
    task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, scales: Array
) -> tuple[tuple[int, Condition], ...]:
    """Return singular controls at the ends of elements on which they are free: polynomials bend most there.

    Args:
        task: the problem.
        arcs: the structure.
        arc: (N,) index of the arc of each element.
        scales: (nu,) of the controls.
    """
    tau = tuple(t for t in (0.0, 1.0) if t not in task.scheme.control_nodes)
    results = []
    for i in sorted(task.singular) if tau else ():
        free = np.array([a.kinds[i] is Kind.INTERIOR for a in arcs])
        if free.any():
            elements = np.flatnonzero(free[arc])
            results.append((i, Condition(task.problem.system.u[i], scales[i : i + 1], elements, tau)))
    return tuple(results)


def draw_in(limit: StateLimit, crossing: Crossing, nlp: Nlp, ends: Array, sides: Sides) -> None:
    """Tighten a state limit on the elements of an interval by a share of its range, in place.

    Args:
        limit: of the problem.
        crossing: the interval and the share.
        nlp: whose bounds are meant.
        ends: (N + 1,) ends of its elements [s].
        sides: its bounds.
    """
    low, high, rows_low, rows_high = sides
    near = 1e-9 * ends[-1]
    own = np.flatnonzero((ends[1:] >= crossing.start - near) & (ends[:-1] <= crossing.end + near))
    upper, layout = crossing.contact.side > 0, nlp.layout
    if limit.state >= 0:
        chosen, size = layout.state[own, 1:, limit.state], nlp.scaling.x[limit.state]
        chosen = np.setdiff1d(chosen, np.append(layout.state[0, 0], layout.state[-1, -1]))
        side = high if upper else low
    else:
        part = nlp.path_parts.index((limit.constraint, limit.component))
        chosen, size = nlp.path[part][own].ravel(), 1.0
        side = rows_high if upper else rows_low
    side[chosen] -= crossing.contact.side * crossing.share * limit.range / size


def with_free_horizon(problem: Problem) -> Problem:
    """Return the problem with a free horizon; a fixed duration becomes a constraint on the sum of arc durations."""
    return (
        problem if isinstance(problem.horizon, Free) else replace(problem, horizon=Free(guess=problem.horizon.duration))
    )


def totals(problem: Problem) -> tuple[float, float]:
    """Return lower and upper limit of the sum of all arc durations [s]."""
    horizon = problem.horizon
    if isinstance(horizon, Free):
        return (horizon.lower if horizon.lower > 0.0 else -np.inf), horizon.upper
    return horizon.duration, horizon.duration
