"""The solution of a sequence as one of the problem in which its phases run in parallel, and the way back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.parallel_phases import ParallelPhases, in_parallel
from ocp.problem.sequence import Sequence
from ocp.problem.state_constraints import state_limits
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Structure
from ocp.solution.structure_table import merged, tabulate
from ocp.transcription.element_points import path_rows, row_parts
from ocp.transcription.packing import Multipliers


def with_sequence(
    function: str, solution: SequenceSolution, sequence: object = None
) -> tuple[Solution, ParallelPhases]:
    """Return the solution of a sequence as one of its phases in parallel, and their problem.

    Args:
        function: name of the calling function, for messages.
        solution: of a Sequence, all phases on one grid.
        sequence: that it solves; None for the one that it carries.

    Raises:
        TypeError: no Sequence.
        ValueError: another number of phases, or phases on several grids.
    """
    checks.instance(f"{function}: problem", sequence, Sequence | None, "a Sequence, or None for that of the solution")
    parallel = in_parallel(sequence if isinstance(sequence, Sequence) else solution.problem)
    phases, parts = solution.phases, parallel.parts
    if len(phases) != len(parts):
        raise ValueError(f"{function}: problem has {len(parts)} phases, expected {len(phases)} as the solution")
    grid, scheme = phases[0].grid, phases[0].scheme
    if any(phase.scheme != scheme or not np.array_equal(phase.grid.ends, grid.ends) for phase in phases):
        raise ValueError(f"{function}: the phases have several grids or schemes; solve the Sequence on one grid")
    values: dict[str, float] = {}
    for phase, part in zip(phases, parts, strict=True):
        values |= {part.names[name]: value for name, value in phase.values.items()}
        values[part.duration] = phase.duration
    for before, _, left, _ in parallel.sequence.junctions:
        reached = phases[before].signal(left, phases[before].duration)
        values |= dict(zip(parts[before].junction, reached.tolist(), strict=True))
    unknown = {part.names[name] for part, phase in zip(parts, phases, strict=True) for name in phase.free}
    unknown |= {name for part in parts for name in (part.duration, *part.junction)}
    names = parallel.problem.system.nominal
    one = replace(
        phases[0],
        status=solution.status, message=solution.message, duration=1.0, cost=solution.cost,
        states=_beside([phase.states for phase in phases]), controls=_beside([phase.controls for phase in phases]),
        slopes=_beside([phase.slopes for phase in phases]), costates=_beside([phase.costates for phase in phases]),
        free={name: values[name] for name in names if name in unknown},
        values={name: values[name] for name in names}, problem=parallel.problem, timings=solution.timings,
        iterations=solution.iterations, multipliers=_multipliers(phases, parallel), accuracy=None,
        structure=solution.parallel,
    )  # fmt: skip
    return one, parallel


def as_sequence(one: Solution, parallel: ParallelPhases) -> SequenceSolution:
    """Return the solution of the phases in parallel as one of the sequence.

    Args:
        one: of `parallel.problem`.
        parallel: the phases.
    """
    owned = _owned(one.multipliers, one, parallel)
    phases = tuple(_phase(one, parallel, k, own) for k, own in enumerate(owned))
    return SequenceSolution(
        phases, one.status, one.message, one.solver_status, one.cost, one.timings, one.iterations,
        parallel.sequence, one.accuracy, one.structure,
    )  # fmt: skip


def _owned(held: Multipliers | None, one: Solution, parallel: ParallelPhases) -> list[Multipliers | None]:
    """Return the multipliers of each phase."""
    problems = parallel.sequence.problems
    if held is None:
        return [None] * len(problems)
    points = [sum(rows for _, _, rows in path_rows(problem, one.scheme)) for problem in problems]
    ends = [len(row_parts(problem, one.scheme)[1]) for problem in problems]
    paths = np.split(held.path, np.cumsum(points)[:-1], axis=1)
    own_ends = np.split(held.ends, np.cumsum(ends))
    return [
        Multipliers(held.x[:, :, part.x], held.u[:, :, part.u], path, own)
        for part, path, own in zip(parallel.parts, paths, own_ends, strict=False)
    ]


def _phase(one: Solution, parallel: ParallelPhases, k: int, multipliers: Multipliers | None) -> Solution:
    part, duration = parallel.parts[k], one.values[parallel.parts[k].duration]
    structure = None if one.structure is None else _structure(one.structure, parallel, k, duration)
    return replace(
        one,
        duration=duration, problem=parallel.sequence.problems[k], multipliers=multipliers, accuracy=None,
        states=one.states[:, :, part.x], controls=one.controls[:, :, part.u], slopes=one.slopes[:, :, part.x],
        costates=one.costates[:, :, part.x], structure=structure,
        free={name: one.values[known] for name, known in part.names.items() if known in one.free},
        values={name: one.values[known] for name, known in part.names.items()},
    )  # fmt: skip


def _beside(arrays: list[Array]) -> Array:
    return np.concatenate(arrays, axis=2)


def _multipliers(phases: tuple[Solution, ...], parallel: ParallelPhases) -> Multipliers | None:
    """Return the multipliers of all phases; those of the junctions, which no phase knows, are zero."""
    every = [phase.multipliers for phase in phases if phase.multipliers is not None]
    if len(every) < len(phases):
        return None
    linked = sum(2 * len(part.junction) for part in parallel.parts)
    return Multipliers(
        _beside([one.x for one in every]), _beside([one.u for one in every]), np.hstack([one.path for one in every]),
        np.concatenate([*(one.ends for one in every), np.zeros(linked)]),
    )  # fmt: skip


def _structure(whole: Structure, parallel: ParallelPhases, k: int, duration: float) -> Structure:
    """Return the structure of phase k from that of the phases in parallel, whose times are shares."""
    problem, part = parallel.sequence.problems[k], parallel.parts[k]
    first = sum(len(state_limits(phase)) for phase in parallel.sequence.problems[:k])
    limits = state_limits(problem)

    def own(contacts: tuple[Contact, ...]) -> tuple[Contact, ...]:
        return tuple(
            replace(contact, limit=contact.limit - first, control=max(contact.control - part.u.start, -1))
            for contact in contacts
            if first <= contact.limit < first + len(limits)
        )

    mine = tuple(Arc(arc.kinds[part.u], arc.duration * duration, own(arc.held), own(arc.touched)) for arc in whole.arcs)
    return tabulate(problem, limits, merged(mine))


def in_phases(
    function: str, solution: SequenceSolution, sequence: object, finish: Callable[[Solution], Solution]
) -> SequenceSolution:
    """Return the solution of a sequence after a step that is written for the solution of one problem.

    Args:
        function: name of the calling function, for messages.
        solution: of a Sequence.
        sequence: the Sequence that it solves; None for the one that it carries.
        finish: Solution -> Solution of the same problem.
    """
    one, parallel = with_sequence(function, solution, sequence)
    return as_sequence(finish(one), parallel)
