"""Rest at both ends of a motion: whether the controls can hold it."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Free, Problem
from ocp.problem.sequence import Sequence
from ocp.solving.first_guesses import Guess
from ocp.solving.starts import phases_of
from ocp.system import slopes

Array = np.ndarray
ROUNDING = 1e-9  # share of what a value is made of


def warnings_before(problem: Problem | Sequence, values: list[list[float]]) -> list[str]:
    """Return what speaks against a motion without excluding it: a control too weak to hold an end at rest."""
    found = []
    for phase, numbers in zip(phases_of(problem), values, strict=True):
        system, p = phase.system, ca.DM(list(numbers))
        low, high = phase.limits(Where.ALONG, system.u)
        function = slopes(system)
        first, last, fixed = ends(phase, p)
        for words, x, whole in (("start", first, fixed[0]), ("end", last, fixed[1])):
            f, _, b = (np.array(part) for part in function(x, np.zeros(len(low)), p))
            if not whole or not len(low) or not (np.all(np.isfinite(f)) and np.all(np.isfinite(b))):
                continue
            u = np.linalg.lstsq(b, -f.ravel(), rcond=None)[0]
            if not _rests(f.ravel(), b * u, [label.unit for label in system.label("x", system.x.numel())]):
                continue
            noise = ROUNDING * np.maximum(np.abs(u), 1e-3 * float(np.max(np.abs(u))))
            for label, need, least, a, c in zip(system.label("u", len(u)), u, noise, low, high, strict=True):
                if need < a - least or need > c + least:
                    limit = a if need < a else c
                    found.append(
                        f"{label.name} cannot hold the {words}: {need:.4g} {label.unit} are needed at rest, the limit "
                        f"is {limit:.4g}; raise the limit above {abs(need):.4g} {label.unit} or move the {words}"
                    )
    return found


def _rests(f: Array, parts: Array, units: list[str]) -> bool:
    """Return whether rates f (nx,) are balanced by the parts (nx, nu) of the controls; those of one unit together."""
    left, size = np.abs(f + parts.sum(axis=1)), np.abs(f) + np.abs(parts).sum(axis=1)
    alike = np.array([max(s for s, other in zip(size, units, strict=True) if other == unit) for unit in units])
    return bool(np.all(left <= 1e-6 * alike + 1e-14 * np.max(size, initial=0.0)))


def standstill(problem: Problem, values: list[float], guess: Guess) -> tuple[Guess, float] | None:
    """Return the motion of no duration and its cost, where it is the optimum: least time, and the goal is the start.

    Args:
        problem: a Problem.
        values: of the parameters.
        guess: whose first controls it takes.
    """
    system, minimise = problem.system, problem.minimise
    first, last, fixed = ends(problem, ca.DM(values))
    timed = isinstance(problem.horizon, Free) and problem.horizon.lower == 0.0 and minimise.time > 0.0
    limited = [c for c in problem.subject_to if c.where is Where.ALONG and simple(c, system.p)]
    apart = [c for c in problem.subject_to if c.where is Where.PERIODIC]
    if not timed or not all(fixed) or limited or apart or np.any(first != last) or not minimise.running.is_zero():
        return None
    final = ca.Function("final", [system.x, system.p], [minimise.final])(first, values)
    low, high = problem.limits(Where.ALONG, system.u)
    u = np.clip(guess.u[:1], low, high)
    return Guess(np.array([0.0, 1.0]), np.array([first, first]), np.vstack([u, u]), 0.0, np.zeros(0)), float(final)
