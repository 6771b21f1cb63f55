"""Constraint violations of a motion, also between the nodes, and the singularities that it meets."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.constraints import Constraint, Where, single_symbols
from ocp.problem.pointwise import controls_without_bounds
from ocp.problem.problem import Problem
from ocp.problem.singularities import meeting
from ocp.solution.figure import Figure
from ocp.solution.limit_scales import Limited, limit_scale
from ocp.solution.solution import Solution
from ocp.solution.state_scales import scales_of_states
from ocp.system import System
from ocp.transcription.schemes.scheme import Control

__all__ = ["Figure", "between_points", "excess", "touched"]
SAMPLES = 24  # points of each element at which limits are checked before the worst point is searched
SEARCHES = 32  # local maxima of one component that are searched
NARROWINGS = 34  # golden sections of an interval between samples, each by 0.618
GOLDEN = (5.0**0.5 - 1.0) / 2.0


def excess(solution: Solution, problem: Problem, scale: Array | None = None) -> list[tuple[float, Figure]]:
    """Return for every limited component its largest excess over its limits, relative and in its unit.

    What `along(..., between=)` allows between the nodes is no excess.

    The excess is sampled at 24 points of each element; from the largest local maxima of the samples it is maximised by
    golden sections, so that a region that is entered and left between two samples is seen. The relative excess refers
    to the scale of the limit (`ocp.solution.limit_scales`): the distance between both limits, the range of a
    coordinate, the depth of a forbidden region.

    Args:
        solution: with finite states.
        problem: whose limits they are.
        scale: (nx,) scales of the states; None for those of the motion.

    Returns:
        (relative excess, excess with unit, name and time) of each component.
    """
    results = []
    scale = scales_of_states(solution, problem)[0] if scale is None else scale
    for constraint in problem.subject_to:
        limited = Limited(constraint, problem.system, solution.parameters, scale)
        search = _Search(solution, limited)
        for c, label in enumerate(problem.labels(constraint)):
            amount, time, x = search.worst(c)
            amount = max(amount - (constraint.between or 0.0), 0.0)
            figure = Figure(amount, label.unit, f"{constraint.where.value} limit", label.name, time)
            share = amount / limit_scale(limited, c, search.range[c], x, amount) if amount > 0.0 else 0.0
            results.append((share, figure))
    return results


def passed_between_nodes(
    solution: Solution, problem: Problem, allowed: float, noted: float
) -> dict[str, list[tuple[int, float]]]:
    """Return where limits are exceeded between the nodes by more than finer elements would leave.

    These are nonlinear limits of states, such as obstacles; limits on expressions of controls, if some controls have no
    bounds, unless these are collocated and overshoot at a switch on any grid; and bounds of states if controls are
    linear on each element.

    Args:
        solution: with finite states.
        problem: whose limits they are.
        allowed: relative excess; nothing is returned if no limit is exceeded by more.
        noted: smaller relative excess; if one is not allowed, these are returned with it.

    Returns:
        name of the limit -> (element, tau) of every noted local maximum of the excess.
    """
    results: dict[str, list[tuple[int, float]]] = {}
    passed = False
    system = problem.system
    free = len(controls_without_bounds(problem)) > 0
    chosen = [
        (constraint, components)
        for constraint in problem.subject_to
        if constraint.where is Where.ALONG
        and (components := _watched(constraint, system, solution.scheme.control, free))
    ]
    scale = scales_of_states(solution, problem)[0] if chosen else np.zeros(0)
    for constraint, components in chosen:
        limited = Limited(constraint, system, solution.parameters, scale)
        search = _Search(solution, limited)
        for c in components:
            element, tau, amount, x = search.peaks(c, 0.0)
            if not len(element) or np.max(amount) <= 0.0:
                continue
            worst = int(np.argmax(amount))
            most = float(amount[worst])
            if constraint.between is None:
                size = limit_scale(limited, c, search.range[c], x[worst], most, enough=most / noted)
                least, enough = noted * size, allowed * size
            else:
                least = enough = constraint.between
            passed |= most > enough
            points = [(int(k), float(t)) for k, t, one in zip(element, tau, amount, strict=True) if one > least]
            if points:
                results.setdefault(problem.labels(constraint)[c].name, []).extend(points)
    return results if passed else {}


@functools.lru_cache(maxsize=64)
def _watched(constraint: Constraint, system: System, control: Control, free: bool) -> tuple[int, ...]:
    """Return the components that `passed_between_nodes` looks at, for a shape of controls with or without bounds."""
    bounds = {c: kind for kind, _, c in single_symbols(constraint, system)}
    linear = control is Control.SEGMENTS

    def watched(c: int) -> bool:
        if c in bounds:
            return linear and bounds[c] == 0
        part = constraint.expression[c]
        if ca.depends_on(part, system.u):
            return free and control is not Control.COLLOCATED
        return linear or any(ca.which_depends(part, system.x, 2, True))

    return tuple(c for c in range(constraint.expression.numel()) if watched(c))


class _Search:
    """Maximisation of the excess of one constraint along a motion."""

    def __init__(self, solution: Solution, limited: Limited) -> None:
        self.solution, self.limited = solution, limited
        self.tau = np.linspace(0.0, 1.0, SAMPLES)  # both ends, since the control may jump there
        self.times, self.x, _, u = solution.samples(self.tau)
        values, by_states = limited.evaluate(self.x, u)
        # The zero of an expression of states is arbitrary (a temperature, an angle), that of a control is rest.
        spread = np.ptp(values, axis=1) if limited.of_states else np.max(np.abs(values), axis=1)
        self.range = np.maximum(np.nan_to_num(spread), np.nan_to_num(np.max(by_states, axis=1)))
        where = limited.constraint.where
        self.along = where is Where.ALONG
        if where is Where.PERIODIC:
            values = values[:, -1:] - values[:, :1]
        rows = {Where.START: slice(0, 1), Where.ALONG: slice(None)}.get(where, slice(-1, None))
        self.beyond = limited.beyond(values if where is Where.PERIODIC else values[:, rows])
        self.times, self.x = self.times[rows], self.x[rows]

    def worst(self, c: int) -> tuple[float, float, Array]:
        """Return the largest excess of component c (zero if there is none), its time, and the state there."""
        index = int(np.argmax(self.beyond[c]))
        amount, time, x = float(self.beyond[c, index]), float(self.times[index]), self.x[index]
        element, tau, inner, states = self.peaks(c, max(amount, 0.0))
        if len(element) and np.max(inner) > amount:
            grid, best = self.solution.grid, int(np.argmax(inner))
            share = grid.ends[element[best]] + tau[best] * grid.widths[element[best]]
            amount, time, x = float(inner[best]), float(self.solution.duration * share), states[best]
        return max(amount, 0.0), time, x

    def peaks(self, c: int, least: float) -> tuple[Array, Array, Array, Array]:
        """Return element, tau, excess and state (K, nx) of local maxima of component c that may exceed a value."""
        usable = self.along and self.solution.duration > 0.0 and bool(np.all(np.isfinite(self.beyond[c])))
        element, low, high = self._brackets(self.beyond[c] if usable else np.full(SAMPLES, -1.0), least)
        if not len(element):
            return element, low, low, np.zeros((0, self.x.shape[1]))
        tau = self._narrowed(c, element, low, high)
        inner, states = self._at(c, element, tau)
        return element, tau, inner, states

    def _brackets(self, beyond: Array, least: float) -> tuple[Array, Array, Array]:
        """Return (element, lower and upper tau) around local maxima of the samples that may exceed a value."""
        samples = beyond.reshape(-1, SAMPLES)
        padded = np.pad(samples, ((0, 0), (1, 1)), mode="edge")
        before, after = samples - padded[:, :-2], samples - padded[:, 2:]
        # A parabola through three samples rises above the middle one by less than half its larger difference.
        estimate = samples + 0.5 * np.maximum(np.abs(before), np.abs(after))
        element, k = np.nonzero((before >= 0.0) & (after >= 0.0) & (estimate > least))
        chosen = np.argsort(-estimate[element, k], kind="stable")[:SEARCHES]
        element, k = element[chosen], k[chosen]
        return element, self.tau[np.maximum(k - 1, 0)], self.tau[np.minimum(k + 1, SAMPLES - 1)]

    def _narrowed(self, c: int, element: Array, low: Array, high: Array) -> Array:
        """Return the maxima (K,) within intervals of tau by golden sections, all at once."""
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_left, at_right = self._at(c, element, left)[0], self._at(c, element, right)[0]
        for _ in range(NARROWINGS):
            rises = at_right > at_left
            low, high = np.where(rises, left, low), np.where(rises, high, right)
            new = np.where(rises, low + GOLDEN * (high - low), high - GOLDEN * (high - low))
            value = self._at(c, element, new)[0]
            left, right = np.where(rises, right, new), np.where(rises, new, left)
            at_left, at_right = np.where(rises, at_right, value), np.where(rises, value, at_left)
        return np.asarray(np.where(at_right > at_left, right, left))

    def _at(self, c: int, element: Array, tau: Array) -> tuple[Array, Array]:
        x, u = _inside(self.solution, element, tau)
        return np.asarray(self.limited.excess(x, u)[c]), x


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


def _inside(solution: Solution, element: Array, tau: Array) -> tuple[Array, Array]:
    """Return state (K, nx) and control (K, nu) at K points, each given by an element and its share tau of it."""
    x = np.einsum("km,kma->ka", solution.scheme.state_at(tau), solution.data[element])
    u = np.einsum("km,kma->ka", solution.scheme.control_at(tau), solution.controls[element])
    return x, u
