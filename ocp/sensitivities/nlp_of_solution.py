"""Reconstruction of the NLP of a solution, with its unknowns, multipliers and bounds."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.arcs.arc_nlp import ArcNlp, transcribe_arcs
from ocp.arcs.arc_problems import arc_problem
from ocp.checks import Array
from ocp.problem.problem import Fixed, Problem
from ocp.sensitivities.kkt_root import Bounds, Optimum
from ocp.sensitivities.kkt_system import evaluate
from ocp.solution.solution import Solution
from ocp.solving.guess_conversion import from_solution
from ocp.solving.warm_start import multipliers
from ocp.transcription.direct_collocation import free_parameters, transcribe
from ocp.transcription.grid import uniform
from ocp.transcription.nlp import Nlp, bounds
from ocp.transcription.scaling import Scaling, from_limits
from ocp.transcription.schemes.scheme import Scheme


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A solution as unknowns of its NLP.

    Args:
        nlp: of the problem, or of its arcs if the solution is polished.
        problem: that was solved.
        bounds: of the unknowns and constraint rows.
        z: (nz,) unknowns.
        s: parameters of the NLP.
        y: (ng,) multipliers of the rows as far as known, or None.
        limits: (nz,) multipliers of the bounds, > 0 at upper ones; zero where they are not known.
        head: (np + 1 or np,) parameters, and the duration if it is given.
        arc: (N,) index of the arc of every element.
        shares: (N,) width of every element, share of its arc.
        posed: the arc NLP if the solution is polished, else None.
        duration: [s].
    """

    nlp: Nlp
    problem: Problem
    bounds: Bounds
    z: Array
    s: Array
    y: Array | None
    limits: Array
    head: Array
    arc: Array
    shares: Array
    posed: ArcNlp | None
    duration: float

    def slope(self, at: Optimum) -> Array:
        """Return grad f + A' y (nz,) at a root of the conditions of optimality."""
        here = evaluate(self.nlp, at.z, at.s, at.y)
        return np.asarray(here.gradient + np.array(ca.mtimes(here.jacobian.T, at.y)).ravel())

    def moved(self, problem: Problem) -> tuple[Array, Bounds]:
        """Return head and bounds for a problem that differs from this one in numbers only."""
        head = np.array(self.head)
        if self.posed is None:
            if isinstance(problem.horizon, Fixed):
                head[-1] = problem.horizon.duration
            return head, bounds(replace(self.nlp, problem=problem))
        return head, self.posed.adapted(problem, self.posed.task.numbers).sides()

    def touches(self) -> Iterator[tuple[str, int, int]]:
        """Yield for every touch point of a polished solution its name, its constraint row, and the side (-1, 1)."""
        ties = zip(self.posed.conditions, self.nlp.conditions, strict=False) if self.posed else ()
        for tie, rows in ties:
            assert self.posed is not None
            if tie.contact in self.posed.arcs[tie.arc].touched and not tie.along:
                name = self.posed.task.limits[tie.contact.limit].label.name
                side = "upper" if tie.contact.side > 0 else "lower"
                yield f"the touch of {name} with its {side} limit", int(rows[0, 0, 0]), tie.contact.side

    def where(self, number: int) -> str:
        """Return the name and time of a bound, by its index among the 2 (nz + k) lower, then upper ones."""
        low, _, rows_low, rows_high = self.bounds
        rows = np.flatnonzero((rows_low < rows_high) & (np.isfinite(rows_low) | np.isfinite(rows_high)))
        side = "upper" if number >= len(low) + len(rows) else "lower"
        index = number % (len(low) + len(rows))
        layout, system = self.nlp.layout, self.problem.system
        ends = self.nlp.grid.ends[:-1] * float(self.duration)
        for name, indices in (("x", layout.state), ("u", layout.control)):
            result = np.argwhere(indices == index)
            if len(result):
                labels = system.label(name, indices.shape[2])
                return f"{labels[result[0][2]].name} at its {side} limit near t = {ends[result[0][0]]:.4g} s"
        for (i, c), own in zip(self.nlp.path_parts, self.nlp.path, strict=True):
            result = np.argwhere(own == (rows[index - len(low)] if index >= len(low) else -1))
            if len(result):
                label = self.problem.labels(self.problem.subject_to[i])[c]
                return f"{label.name} at its {side} limit near t = {ends[result[0][0]]:.4g} s"
        return f"a {side} limit of the duration, a free parameter or an end"


def reconstruct(solution: Solution, problem: Problem) -> Reconstruction:
    """Return the NLP of a solution, with the solution as its unknowns.

    Args:
        solution: solved.
        problem: that it solves.
    """
    numbers = problem.system.values(solution.values)
    if solution.structure is not None:
        return _of_arcs(solution, problem, numbers)
    scaling = from_limits(problem, from_solution(solution), numbers, free_parameters(problem))
    made = _transcribed(
        problem, solution.scheme, len(solution.grid), tuple(scaling.x.tolist()), tuple(scaling.u.tolist()),
        scaling.horizon, tuple(scaling.free.tolist()),
    )  # fmt: skip
    nlp = replace(made, grid=solution.grid)
    head = np.array([*numbers, *([solution.duration] if isinstance(problem.horizon, Fixed) else [])])
    z = _unknowns(solution, nlp)
    z[nlp.layout.horizon] = solution.duration / nlp.scaling.horizon
    limits, y, held = np.zeros(len(z)), None, solution.multipliers
    if held is not None:
        y = multipliers(nlp, solution)[1]
        limits[nlp.layout.state] = held.x * nlp.scaling.x
        limits[nlp.layout.control] = held.u * nlp.scaling.u
    widths = solution.grid.widths
    return Reconstruction(
        nlp, problem, bounds(nlp), z, np.append(head, widths), y, limits, head,
        np.zeros(len(widths), dtype=int), widths, None, solution.duration,
    )  # fmt: skip


def _of_arcs(solution: Solution, problem: Problem, numbers: list[float]) -> Reconstruction:
    structure = solution.structure
    assert structure is not None
    durations = np.array([arc.duration for arc in structure.arcs])
    middles = (solution.grid.ends[:-1] + solution.grid.widths / 2.0) * solution.duration
    arc = np.minimum(np.searchsorted(np.cumsum(durations), middles), len(durations) - 1)
    elements = tuple(np.bincount(arc, minlength=len(durations)).tolist())
    task = arc_problem(problem, solution.scheme, solution.values)
    shares = solution.grid.widths / np.bincount(arc, solution.grid.widths)[arc]
    posed = transcribe_arcs(task, structure.arcs, elements, from_solution(solution), shares=shares)
    return Reconstruction(
        posed.nlp, problem, posed.sides(), posed.restart(solution), np.append(numbers, shares), None,
        np.zeros(posed.nlp.layout.size), np.array(numbers), posed.arc_layout.arc, shares, posed, solution.duration,
    )  # fmt: skip


@functools.lru_cache(maxsize=8)
def _transcribed(
    problem: Problem, scheme: Scheme, elements: int, x: tuple[float, ...], u: tuple[float, ...], horizon: float,
    free: tuple[float, ...],
) -> Nlp:  # fmt: skip
    """Return the NLP of a problem; cached for its other solutions, since the grid is a parameter of it."""
    return transcribe(problem, scheme, uniform(elements), Scaling(np.array(x), np.array(u), horizon, np.array(free)))


def _unknowns(solution: Solution, nlp: Nlp) -> Array:
    layout, scaling = nlp.layout, nlp.scaling
    z = np.zeros(layout.size)
    z[layout.state], z[layout.control] = solution.states / scaling.x, solution.controls / scaling.u
    names = list(nlp.problem.system.nominal)
    z[layout.free] = [solution.values[names[number]] for number in nlp.free]
    z[layout.free] /= scaling.free
    return z
