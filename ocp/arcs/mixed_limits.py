"""Controls at limits that depend on themselves and on states or other controls, in a switching structure."""

from __future__ import annotations

import numpy as np

from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.control_limits import blocking, coupled_limits, pushes_of
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.solution.structure import Arc, Contact, Kind


def is_held(task: ArcProblem, arc: Arc, control: int) -> bool:
    """Return whether a control is at a limit that depends on itself and on states or other controls."""
    return any(one.control == control and task.limits[one.limit].order == 0 for one in arc.held)


def aim_of(
    task: ArcProblem, point: tuple[Array, Array, Array], control: int, wanted: Kind
) -> tuple[Kind, Contact | None]:
    """Return the kind of a control on its way to a bound, and the limit that it meets first."""
    side = 1 if wanted is Kind.UPPER else -1
    met = blocking(task.problem, point, control, side)
    if met is not None:
        numbers = [n for n, limit in enumerate(task.limits) if (limit.constraint, limit.component) == met[:2]]
        return Kind.HOLDING, Contact(numbers[0], met[2], control)
    bound = task.problem.limits(Where.ALONG, task.problem.system.u)[(side + 1) // 2][control]
    return (wanted if np.isfinite(bound) else Kind.INTERIOR), None


def pushes_along(task: ArcProblem, motion: ArcMotion, point: tuple[Array, Array], slopes: Array) -> Array | None:
    """Return what active limits of several controls add to dH/du (K, nu); None without such arcs."""
    x, u = point
    several = {(i, c) for i, c, own in coupled_limits(task.problem) if len(own) > 1}
    per = len(x) // len(motion.grid)
    result: Array | None = None
    for k, arc in enumerate(motion.arcs):
        chosen = [(task.limits[one.limit], one.control) for one in arc.held if one.control >= 0]
        held = [(own.constraint, own.component, control) for own, control in chosen]
        held = [one for one in held if one[:2] in several]
        if held:
            own = np.flatnonzero(np.repeat(motion.arc == k, per))
            result = np.zeros_like(slopes) if result is None else result
            result[own] = pushes_of(task.problem, held, (x[own], u[own], motion.parameters), slopes[own])
    return result
