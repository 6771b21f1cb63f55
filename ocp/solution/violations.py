"""Constraint violations of a motion, also between the nodes, and the singularities that it meets."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.singularities import meeting
from ocp.solution.solution import Solution
from ocp.solution.state_scales import scales_of_states
from ocp.transcription.schemes.scheme import Control

SAMPLES = 24  # points of each element at which limits are checked


class Figure(float):
    """A number with its unit, the scale that it is relative to, and the component and time at which it occurs."""

    unit: str
    scale: str
    what: str
    at: float

    def __new__(cls, value: float, unit: str, scale: str, what: str = "", at: float = float("nan")) -> Figure:
        """Return the number with its description."""
        figure = super().__new__(cls, value)
        figure.unit, figure.scale, figure.what, figure.at = unit, scale, what, at
        return figure

    def __str__(self) -> str:
        where = f" ({self.what}{f' at {self.at:.4g} s' if np.isfinite(self.at) else ''})" if self.what else ""
        return f"{float(self):.2e} {self.unit} of {self.scale}{where}"


def excess(solution: Solution, problem: Problem, scale: Array | None = None) -> list[tuple[float, Figure]]:
    """Return for every limited component its excess relative to its range, and in its unit with name and time.

    One without a range is measured by its largest value, or by what states of their sizes make of it.

    Args:
        solution: with finite states.
        problem: whose limits they are.
        scale: (nx,) sizes of the states; None for those of the motion.
    """
    results = []
    scale = scales_of_states(solution, problem)[0] if scale is None else scale
    # Both ends of every element are among the places, since the control may jump there.
    dense, x, _, u = solution.samples(np.linspace(0.0, 1.0, SAMPLES))
    system = problem.system
    p = solution.parameters
    for constraint in problem.subject_to:
        by_states = ca.mtimes(ca.fabs(ca.jacobian(constraint.expression, system.x)), scale)
        outputs = [constraint.expression, ca.densify(by_states)]
        function = ca.Function("limit", [system.x, system.u, system.p], outputs).map(len(dense))
        motion, made = (np.array(part) for part in function(x.T, u.T, np.tile(p[:, None], len(dense))))
        if constraint.where is Where.PERIODIC:
            rows, values = slice(-1, None), motion[:, -1:] - motion[:, :1]
        else:
            rows = {Where.START: slice(0, 1), Where.END: slice(-1, None), Where.ALONG: slice(None)}[constraint.where]
            values = motion[:, rows]
        beyond = np.maximum(constraint.lower[:, None] - values, values - constraint.upper[:, None])
        for c, label in enumerate(problem.labels(constraint)):
            place = int(np.argmax(beyond[c]))
            amount = max(float(beyond[c, place]), 0.0)
            sides = np.array([constraint.lower[c], constraint.upper[c]])
            reach = np.ptp(sides) if np.all(np.isfinite(sides)) else 0.0
            size = reach or max(float(np.max(np.abs(motion[c]))), float(np.nan_to_num(np.max(made[c])))) or 1.0
            figure = Figure(amount, label.unit, f"{constraint.where.value} limit", label.name, dense[rows][place])
            results.append((amount / size, figure))
    return results


POINTS = np.linspace(0.0, 1.0, 11)  # of each element at which singularities are looked for


def touched(solutions: list[Solution]) -> Iterator[str]:
    """Yield a sentence for every singularity of the equations that a motion meets, at its nodes or between them.

    Args:
        solutions: of any status.
    """
    for solution in solutions:
        system = solution.problem.system if solution.problem is not None else None
        if system is None or not system.singular or not np.all(np.isfinite(solution.states)):
            continue
        if not solution.duration > 0.0:
            continue
        t, x, _, _ = solution.samples(POINTS)
        result = meeting(system, x, solution.parameters.tolist())
        if result:
            yield f"the motion meets a singularity at t = {t[result.row]:.4g} s: {result.words}"


MATTERS = 1e-3  # share of its range by which a control may exceed its limit between points without a message


def between_points(solution: Solution) -> list[str]:
    """Return a sentence if a collocated control leaves its limits between the points by a noticeable share of them."""
    if solution.scheme.control is not Control.COLLOCATED or solution.problem is None or solution.duration <= 0.0:
        return []
    system = solution.problem.system
    t, _, _, u = solution.samples(np.linspace(0.0, 1.0, 11))
    low, high = solution.problem.limits(Where.ALONG, system.u)
    both = np.isfinite(low) & np.isfinite(high) & (high > low)
    share = np.zeros(u.shape)
    share[:, both] = (np.maximum(low - u, u - high))[:, both] / (high - low)[both]
    k, i = np.unravel_index(np.argmax(share), share.shape) if share.size else (0, 0)
    if not share.size or share[k, i] <= MATTERS:
        return []
    label = system.label("u", u.shape[1])[i]
    return [
        f"{label.name} leaves its limits between the collocation points by {100 * share[k, i]:.2g} % of its range, at "
        f"t = {t[k]:.4g} s, and the cost is too low for it; Control.CONSTANT and LINEAR keep limits everywhere"
    ]
