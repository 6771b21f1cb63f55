"""Grids that resolve a motion: elements in which the equations of motion are missed between the points are split.

The NLP satisfies x' = f(x, u) at the collocation points only. Where a rate changes within a small part of an element,
such as dry friction where a velocity reverses, the motion integrated with the controls found leaves the one found.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.solution.integration_drift import accumulated, propagated
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.state_scales import scales_of_states
from ocp.solving.deadline import overdue
from ocp.solving.guess_conversion import AnySolution
from ocp.solving.nlp_solver import NlpSettings, limited
from ocp.solving.phase_solutions import added, lasting, timed
from ocp.solving.prepared_nlp import prepare
from ocp.transcription.grid import Grid

DRIFTS = 1e-6  # drift relative to the scale of the state that `verify` allows
ALLOWED = 5e-7  # that a refined grid may leave
AIM = 0.4  # share of it that the refined elements may leave together
CONCENTRATED = 0.01  # elements with less than this share of the largest error are not split yet
MOST_PARTS = 4  # that an element is split into
ROUNDS = 6  # of refinement
MOST = 5  # times the elements of the first grid
NARROWEST = 1e-7  # share of the horizon


def resolved(
    solution: AnySolution,
    solver: NlpSettings | None = None,
    values: Mapping[str, float] | None = None,
    seconds: float = 10.0,
) -> AnySolution:
    """Return a solution on a grid that resolves its motion; the same one if its grid does, or if that does not help.

    If the motion integrated with its own controls leaves it by more than 1e-6 of the scale of a state, elements in
    which the equations of motion are missed between the points are split into 2 to 4, and the problem is solved again
    from the motion found, up to six times, until 5e-7 are left. The message says so.

    Args:
        solution: with its problem; only a solved one is refined. Phases of a sequence have one grid.
        solver: settings, default Ipopt().
        values: of parameters, by name; None for those of the solution.
        seconds: after which no further solve is begun, and at which one is stopped [s].

    Raises:
        ValueError: a solution without its problem.
        TypeError: an argument of the wrong kind.
    """
    checks.instance("resolved: solution", solution, Solution | SequenceSolution, "a Solution or SequenceSolution")
    checks.number("resolved: seconds", seconds, "a number of seconds > 0", above=0.0, finite=False)
    phases = _phases(solution)
    if any(phase.problem is None for phase in phases):
        raise ValueError("resolved: this solution was loaded without its problem; use load(path, problem=...)")
    begun, best, grid = time.perf_counter(), solution, _finer(solution, DRIFTS) if solution.ok else None
    spent = solution.timings
    first, numbers = len(phases[0].grid), _values(solution) if values is None else values
    for _ in range(ROUNDS):
        left = seconds - (time.perf_counter() - begun)
        if grid is None or len(grid) > MOST * max(first, 10) or left <= 0.0 or overdue():
            break
        prepared = prepare(solution.problem, phases[0].scheme, grid, solver, best, numbers)
        prepared = replace(prepared, settings=limited(prepared.settings, prepared.settings.max_iter, left))
        again = prepared.proceed(best, numbers) if isinstance(best, Solution) else prepared(best, numbers)
        spent = added(spent, again.timings)
        if not again.ok:
            break
        if isinstance(again, Solution):
            again = replace(again, rung=solution.rung)
        best = replace(again, iterations=best.iterations + again.iterations)
        grid = _finer(best, ALLOWED)
    if spent is solution.timings:
        return solution
    spent = lasting(spent, solution.timings.total + time.perf_counter() - begun)
    if best is solution:
        return timed(solution, spent)
    words = f"solved again with {len(_phases(best)[0].grid)} elements instead of {first}, finer where rates jump"
    return timed(replace(best, message=f"{best.message}; {words}"), spent)


def _phases(solution: AnySolution) -> tuple[Solution, ...]:
    return solution.phases if isinstance(solution, SequenceSolution) else (solution,)


def _values(solution: AnySolution) -> dict[str, float]:
    """Return the parameter values of a solution, by name."""
    return {
        name: float(value)
        for phase in _phases(solution)
        if phase.problem is not None
        for name, value in zip(phase.problem.system.nominal, phase.parameters, strict=True)
    }


def _finer(solution: AnySolution, drifts: float) -> Grid | None:
    """Return the grid of the next solve; None if this one resolves the motion, or there is nothing to split."""
    phases = _phases(solution)
    parts = [_missed(phase) for phase in phases if phase.duration > 0.0 and np.all(np.isfinite(phase.data))]
    total = max((drift for _, drift in parts), default=0.0)
    if not drifts < total < np.inf:
        return None
    share, grid = np.max([local for local, _ in parts], axis=0), phases[0].grid
    allowed = AIM * ALLOWED / len(grid)
    marked = (share > max(allowed, CONCENTRATED * float(np.max(share)))) & (grid.widths > NARROWEST)
    nodes = [grid.ends]
    for k in np.flatnonzero(marked):
        count = int(np.clip(np.ceil((share[k] / allowed) ** (1.0 / phases[0].scheme.order)), 2, MOST_PARTS))
        nodes.append(np.linspace(grid.ends[k], grid.ends[k + 1], count + 1))
    return Grid(np.unique(np.round(np.concatenate(nodes), 12))) if len(nodes) > 1 else None


def _missed(solution: Solution) -> tuple[Array, float]:
    """Return the local error (N,) of every element and the largest drift, both relative to the scale of the state."""
    assert solution.problem is not None
    with np.errstate(all="ignore"):
        try:
            local, transition, _ = propagated(solution, solution.problem)
        except np.linalg.LinAlgError:
            return np.zeros(len(solution.grid)), np.inf
        scale = scales_of_states(solution, solution.problem)[0]
        return np.max(np.abs(local) / scale, axis=1), float(np.max(np.abs(accumulated(local, transition)) / scale))
