"""State limits that press on a motion although its switching structure does not have them."""

from __future__ import annotations

import numpy as np

from ocp.arcs.arc_nlp import ArcNlp
from ocp.arcs.arc_problems import ArcMotion
from ocp.arcs.optimality_check import Crossing
from ocp.checks import Array
from ocp.solution.structure import Contact
from ocp.transcription.element_points import path_points

PRESSING = 1e-6  # multiplier of a limit, share of the cost per range of the limit, that counts


def pressing(nlp: ArcNlp, motion: ArcMotion) -> tuple[Crossing, ...]:
    """Return limits with a multiplier in the NLP where the structure has no contact, the largest multiplier first.

    Such a limit is touched there, or active along an arc, and the conditions of optimality hold only once the
    structure says so.

    Args:
        nlp: of the structure, with its inactive limits.
        motion: its solution.
    """
    task, problem = nlp.task, nlp.task.problem
    result, inner, scaling = motion.result, nlp.nlp, nlp.nlp.scaling
    seconds, starts = motion.duration * motion.grid.widths, motion.duration * motion.grid.ends[:-1]
    parts = {part: index for index, part in enumerate(inner.path_parts)}
    cost, results = max(abs(result.cost), 1e-300), list[Crossing]()
    for number, limit in enumerate(task.limits):
        if limit.state >= 0:
            rows = inner.layout.state[:, 1:, limit.state]
            values = result.limits[rows] / scaling.x[limit.state]
            values[-1, -1] = 0.0  # the end of the motion has bounds of its own
            tau = task.scheme.nodes[1:]
        else:
            values = result.multipliers[inner.path[parts[limit.constraint, limit.component]]]
            expression = problem.subject_to[limit.constraint].expression[limit.component]
            tau = np.array(path_points(task.scheme, expression, problem.system.u))
        # Beside an arc on the limit the motion is close to it anyway.
        for side in (-1, 1):
            known = np.array(
                [any((c.limit, c.side) == (number, side) for c in (*a.held, *a.touched)) for a in motion.arcs]
            )
            near = known[motion.arc]
            near = near | np.append(near[1:], False) | np.append(False, near[:-1])
            values[near & (np.max(side * values, axis=1) > 0.0)] = 0.0
        t = starts[:, None] + seconds[:, None] * tau
        results += _runs(values * limit.range / cost, t, number)
    return tuple(sorted(results, key=lambda crossing: -crossing.share))


def _runs(values: Array, t: Array, number: int) -> list[Crossing]:
    """Return runs of neighbouring points with multipliers of one sign."""
    results = []
    flat, times = values.ravel(), t.ravel()
    for side in (-1, 1):
        active = (side * flat > PRESSING).astype(int)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], active, [0]])))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            worst = a + int(np.argmax(side * flat[a:b]))
            share = float(np.sum(side * flat[a:b]))
            middle = float(times[a:b] @ (side * flat[a:b]) / share)
            moment = middle if b - a <= 3 else float(times[worst])
            results.append(Crossing(Contact(number, side), float(times[a]), float(times[b - 1]), moment, share))
    return results
