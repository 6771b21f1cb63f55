"""Singularities of a system in a problem: at the ends of its motions, between them, and along a solution."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Problem
from ocp.problem.singularities import meeting, met_at, quantities
from ocp.solution.solution import Solution

PLACES = np.linspace(0.0, 1.0, 11)  # of each element at which a motion is looked at


def singular_ends(phases: tuple[Problem, ...], values: list[list[float]]) -> Iterator[str]:
    """Yield ends that lie at a singularity of the system, or that one separates: no motion leads from one to another.

    Args:
        phases: the problems.
        values: of the parameters of each; a quantity with a parameter that is an unknown is not judged.
    """
    for phase, numbers in zip(phases, values, strict=True):
        system = phase.system
        if not system.singular:
            continue
        unknown = any(c.where is Where.ALONG and simple(c, system.p) for c in phase.subject_to)
        first, last, _ = ends(phase, ca.DM(numbers))
        start, end = _fixed(phase, Where.START), _fixed(phase, Where.END)
        sizes = quantities(system, np.stack([first, last]), numbers)
        for place, (low, high) in zip(system.singular, sizes, strict=True):
            if unknown and ca.depends_on(place.quantity, system.p):
                continue
            used = {symbol.element_hash() for symbol in ca.symvar(place.quantity)}
            used -= {symbol.element_hash() for symbol in ca.vertsplit(system.p)}
            for where, known, size, x in (("start", start, low, first), ("end", end, high, last)):
                if used <= known and not abs(size) > place.least:
                    yield f"the {where} is singular: {place.words}{met_at(system, place, x)}"
            if used <= start and used <= end and low * high < 0.0:
                yield f"start and end lie on two sides of a singularity: {place.words}"


def touched(solutions: list[Solution]) -> Iterator[str]:
    """Yield the singularities that motions meet, at their nodes or between; their equations have no meaning there.

    Args:
        solutions: of any status.
    """
    for solution in solutions:
        system = solution.problem.system if solution.problem is not None else None
        if system is None or not system.singular or not np.all(np.isfinite(solution.states)):
            continue
        values = [solution.values[name] for name in system.nominal]
        if not solution.duration > 0.0:
            continue
        t, x, _, _ = solution.samples(PLACES)
        found = meeting(system, x, values)
        if found:
            yield f"the motion meets a singularity at t = {t[found.row]:.4g} s: {found.words}"


def _fixed(phase: Problem, where: Where) -> set[int]:
    """Return the states that have one value at an end."""
    low, high = phase.limits(where, phase.system.x)
    pairs = zip(ca.vertsplit(phase.system.x), low, high, strict=True)
    return {symbol.element_hash() for symbol, a, b in pairs if a == b}
