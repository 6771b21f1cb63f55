"""Limits between the nodes: a motion that passes through an obstacle from node to node is solved again on a finer grid.

Constraints are rows of the NLP at the nodes only. A small obstacle may lie between two of them, and the solver has no
reason to avoid it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.violations import passed_between_nodes
from ocp.solving.deadline import overdue
from ocp.solving.guess_conversion import AnySolution
from ocp.solving.nlp_solver import NlpSettings
from ocp.solving.phase_solutions import added, timed
from ocp.solving.prepared_nlp import prepare
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

# Relative excess over a limit between the nodes that calls for another solve, just below what `verify` allows, and the
# one from which on elements are split then. With 1e-3 for both, motions of a Panda with speed limits took 2.3 times as
# long.
ALLOWED, NOTED = 1.8e-3, 1e-3
ROUNDS = 8  # of refinement
MOST = 4  # times the elements of the first grid


def held_between_nodes(
    result: AnySolution, problem: Problem | Sequence, scheme: Scheme | None, solver: NlpSettings | None,
    values: Mapping[str, float] | None,
) -> AnySolution:  # fmt: skip
    """Return a solution that keeps limits between the nodes as well, those that `passed_between_nodes` looks at.

    If such a limit is exceeded by more than 1.8e-3 of its scale, elements with an excess of more than 1e-3 are split
    where it is largest, and the problem is solved again from the motion found, up to eight times. The message says so,
    and if it did not help.

    Args:
        result: of any status; only a solved one is looked at.
        problem: that it solves.
        scheme, solver, values: of the solve.

    Returns:
        A solution with the seconds of all solves, also of those that failed.
    """
    best, first, seconds = result, _grid(result), result.timings
    names: dict[str, None] = {}
    left = _passed(result) if result.ok else {}
    for _ in range(ROUNDS):
        if not left or overdue():
            break
        names.update(dict.fromkeys(left))
        grid = _split(_grid(best), [point for points in left.values() for point in points])
        if len(grid) > MOST * max(len(first), 10):
            break
        prepared = prepare(problem, scheme, grid, solver, best, values)
        again = prepared.proceed(best, values) if isinstance(best, Solution) else prepared(best, values)
        seconds = added(seconds, again.timings)
        if not again.ok and not overdue():
            again = prepared(None, values)
            seconds = added(seconds, again.timings)
        if not again.ok:
            break
        spent = best.iterations + again.iterations
        if isinstance(again, Solution) and isinstance(result, Solution):
            again = replace(again, rung=result.rung)
        best = replace(again, iterations=spent)
        left = _passed(best)
    if not names:
        return result
    limits = ", ".join(names)
    words = f"between its nodes the motion passed through {limits}"
    if left:
        words += ": a finer grid is needed there"
    else:
        words += f"; solved again with {len(_grid(best))} elements instead of {len(first)}, finer there"
    return timed(replace(best, message=f"{best.message}; {words}"), seconds)


def _grid(result: AnySolution) -> Grid:
    return result.phases[0].grid if isinstance(result, SequenceSolution) else result.grid


def _passed(result: AnySolution) -> dict[str, list[tuple[int, float]]]:
    every: dict[str, list[tuple[int, float]]] = {}
    for solution in result.phases if isinstance(result, SequenceSolution) else (result,):
        if solution.problem is not None and solution.duration > 0.0 and np.all(np.isfinite(solution.data)):
            for name, points in passed_between_nodes(solution, solution.problem, ALLOWED, NOTED).items():
                every.setdefault(name, []).extend(points)
    return every


def _split(grid: Grid, points: list[tuple[int, float]]) -> Grid:
    """Return a grid with every element that has points split at them, and its parts halved."""
    nodes = [grid.ends]
    for k in {k for k, _ in points}:
        inside = np.clip(sorted(tau for one, tau in points if one == k), 0.1, 0.9)
        parts = np.unique(np.concatenate([[0.0], inside, [1.0]]))
        halves = (parts[:-1] + parts[1:]) / 2.0
        nodes.append(grid.ends[k] + grid.widths[k] * np.concatenate([inside, halves]))
    return Grid(np.unique(np.round(np.concatenate(nodes), 12)))


def with_nodes(grid: Grid, points: Mapping[str, list[tuple[float, float]]]) -> Grid:
    """Return a grid with additional nodes at and around shares of the horizon at which limits are exceeded.

    Args:
        grid: of any solution.
        points: name of the limit -> (share of the horizon, width of the element there).
    """
    around = [
        share + width * part for every in points.values() for share, width in every for part in (-0.25, 0.0, 0.25)
    ]
    nodes = np.unique(np.round([*grid.ends, *(one for one in around if 0.0 < one < 1.0)], 12))
    apart = np.append(True, np.diff(nodes) > 1e-9)
    apart[-1] = True
    return Grid(nodes[apart])


def exceeded_between_nodes(solution: Solution) -> dict[str, list[tuple[float, float]]]:
    """Return where limits are exceeded between the nodes, those that `passed_between_nodes` looks at.

    Args:
        solution: with its problem.

    Returns:
        name of the limit -> (share of the horizon, width of the element there), as `with_nodes` takes it.
    """
    if solution.problem is None or not solution.duration > 0.0:
        return {}
    ends, widths = solution.grid.ends, solution.grid.widths
    passed = passed_between_nodes(solution, solution.problem, ALLOWED, NOTED)
    return {
        name: [(float(ends[k] + tau * widths[k]), float(widths[k])) for k, tau in points]
        for name, points in passed.items()
    }
