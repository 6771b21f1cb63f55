"""Post-optimal sensitivities: derivatives of duration, cost, switching times and signals, without solving again."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.parallel_phases import in_parallel
from ocp.problem.problem import Problem, same_structure
from ocp.problem.sequence import Sequence as Phases
from ocp.sensitivities.kkt_derivatives import WEAK, Derivative, Direction, differentiate
from ocp.sensitivities.kkt_root import Optimum, initial_point, settle
from ocp.sensitivities.motion_derivatives import Variation
from ocp.sensitivities.nlp_of_solution import Reconstruction, reconstruct
from ocp.sensitivities.sensitivity import Sensitivity
from ocp.sensitivities.sequence_sensitivity import SequenceSensitivity
from ocp.solution.attached_problem import with_problem
from ocp.solution.parallel_solution import with_sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution

OPEN = 1e-7  # residual of the conditions of optimality above which a note is added
DISAGREEMENT = 1e-6  # relative, of the two derivatives of the cost, above which a note is added
STILL = 1e-6  # a weakly active bound whose rate is below this share of the largest rate of an unknown does not matter


@overload
def sensitivity(
    solution: Solution,
    names: str | Sequence[str] | None = None,
    toward: Mapping[str, Problem] | None = None,
    problem: Problem | None = None,
) -> Sensitivity: ...


@overload
def sensitivity(
    solution: SequenceSolution,
    names: str | Sequence[str] | None = None,
    toward: Mapping[str, Phases] | None = None,
    problem: Phases | None = None,
) -> SequenceSensitivity: ...


def sensitivity(
    solution: Solution | SequenceSolution, names: str | Sequence[str] | None = None,
    toward: Mapping[str, Any] | None = None, problem: Problem | Phases | None = None,
) -> Sensitivity | SequenceSensitivity:  # fmt: skip
    """Differentiate an optimum with respect to numbers, from the conditions of optimality of its NLP.

    The conditions F(Z, y; s) = 0 hold at the optimum, so that dF/dZ dZ + dF/dy dy = -dF/ds ds; one factorisation
    serves all numbers. The optimum is that of the NLP: for a polished solution the optimum of the problem, to the
    accuracy of the polish; otherwise the optimum on the grid of the solution with its scheme.

    Args:
        solution: solved, of a Problem or a Sequence, polished or not.
        names: of parameters of the system; None for all that are given.
        toward: name -> the problem after the number called `name` has grown by one; it may differ in limits, start
            and end values or a given duration only. The derivative is taken along the difference.
        problem: needed only for a solution loaded without it.

    Returns:
        Sensitivity, of a sequence SequenceSensitivity; NaN and a note where a derivative does not exist, a note where
        it holds on one side only.

    Raises:
        TypeError: no Solution.
        ValueError: not solved, without its problem, a wrong name, or nothing to vary.

    Source: A. V. Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming, 1983.
    """
    if isinstance(solution, SequenceSolution):
        one, parallel = with_sequence("sensitivity", solution, problem)
        for name, other in (toward or {}).items():
            checks.instance(f"sensitivity: toward, {name!r}", other, Phases, "a Sequence of as many phases")
        others = {name: in_parallel(other).problem for name, other in (toward or {}).items()}
        return SequenceSensitivity(solution, parallel, sensitivity(one, names, others))
    begun = time.perf_counter()
    solution, problem = _checked(solution, problem)
    system = problem.system
    chosen = _names(solution, problem, names, toward)
    here = reconstruct(solution, problem)
    head, base = len(here.head), here.bounds
    directions = []
    for name in chosen:
        unit = np.zeros(head)
        unit[list(system.nominal).index(name)] = 1.0
        directions.append(Direction(unit, tuple(np.zeros(len(side)) for side in base)))  # type: ignore[arg-type]
    for other in (toward or {}).values():
        new_head, new = here.moved(same_structure(problem, other))
        directions.append(Direction.between((here.head, base), (new_head, new)))
    everything = (*chosen, *(toward or {}))
    conditions, at = initial_point(here.nlp, base, here.z, here.s, here.y, here.limits)
    at = settle(here.nlp, base, conditions, at)
    result = differentiate(here.nlp, base, conditions, at, tuple(directions), head)
    variations = {
        name: _variation(here, result.z[:, c], direction)
        for c, (name, direction) in enumerate(zip(everything, directions, strict=True))
    }
    valid, notes = _sides(here, result, everything, at)
    if at.error > OPEN:
        notes.append(f"conditions of optimality open by {at.error:.1e}; solve with a smaller tol")
    for c, name in enumerate(everything):
        if result.gap[c] > DISAGREEMENT:
            notes.append(f"{name}: cost by multipliers and by the motion differ by {result.gap[c]:.1e}")
    duration = {name: one.duration for name, one in variations.items()}
    if result.reason and result.unique and _timed(problem):
        duration = dict(zip(everything, (float(cost / problem.minimise.time) for cost in result.cost), strict=True))
    switching = None
    if here.posed is not None:
        last = np.flatnonzero(np.diff(here.arc))
        switching = {name: np.cumsum(one.seconds)[last] for name, one in variations.items()}
    free = {name: {list(system.nominal)[i]: float(one.p[i]) for i in here.nlp.free} for name, one in variations.items()}
    costs = {name: float(c) for name, c in zip(everything, result.cost, strict=True)}
    return Sensitivity(
        solution, everything, duration, costs, free, switching, valid, tuple(notes), variations,
        time.perf_counter() - begun, here, at,
    )  # fmt: skip


def _checked(solution: Solution, problem: object) -> tuple[Solution, Problem]:
    result = with_problem("sensitivity", solution, problem)
    if not solution.ok:
        raise ValueError(f"sensitivity: {solution.message}; only a solved solution has derivatives, solve it first")
    if not solution.duration > 0.0:
        raise ValueError("sensitivity: the motion has no duration; move start or goal, then it has derivatives")
    return result


def _names(
    solution: Solution, problem: Problem, names: str | Sequence[str] | None, toward: Mapping[str, Problem] | None
) -> tuple[str, ...]:
    known = [name for name in problem.system.nominal if name not in solution.free]
    checks.instance("names", names, str | list | tuple | None, "names of parameters, or None for all")
    checks.instance("toward", toward, Mapping | None, "a dict name -> Problem, or None")
    chosen = tuple(known) if names is None else (names,) if isinstance(names, str) else tuple(names)
    listed = ", ".join(known) or "none"
    for number, name in enumerate(chosen):
        checks.text("names, each", name, "the name of a parameter")
        if name in chosen[:number]:
            raise ValueError(f"names: got {name!r} twice, expected different ones")
        if name in solution.free:
            raise ValueError(f"names: {name!r} is an unknown of this problem; given parameters are {listed}")
        if name not in known:
            raise ValueError(f"names: no parameter {name!r}; there are {listed}")
    for name, other in (toward or {}).items():
        checks.text("toward, each name", name)
        checks.instance(f"toward {name!r}", other, Problem, "a Problem")
        if name in chosen:
            raise ValueError(f"toward: {name!r} is a parameter already; choose another name")
    if not chosen and not toward:
        given = "" if names is None else f"names: got {checks.shown(names)}, "
        raise ValueError(f"{given}nothing to vary; there are the parameters {listed}, toward= names other numbers")
    return chosen


def _timed(problem: Problem) -> bool:
    cost = problem.minimise
    return cost.time != 0.0 and cost.running.is_zero() and cost.final.is_zero() and cost.initial.is_zero()


def _variation(here: Reconstruction, change: Array, direction: Direction) -> Variation:
    """Return the change of a motion in physical units."""
    layout, scaling = here.nlp.layout, here.nlp.scaling
    count = len(here.problem.system.nominal)
    p = np.array(direction.head[:count])
    p[here.nlp.free] = change[layout.free] * scaling.free
    durations = change[layout.horizon] * scaling.horizon if len(layout.horizon) else direction.head[count:]
    seconds = durations[here.arc] * here.shares
    return Variation(change[layout.state] * scaling.x, change[layout.control] * scaling.u, seconds, p)


def _sides(
    here: Reconstruction, result: Derivative, names: tuple[str, ...], at: Optimum
) -> tuple[dict[str, tuple[bool, bool]], list[str]]:
    """Return for each name on which sides the derivative holds, and a sentence where it does not hold on both."""
    if result.reason:
        words = f"no derivative of the motion: {result.reason}"
        return dict.fromkeys(names, (result.unique, result.unique)), [words]
    valid, notes = {}, []
    largest = np.max(np.abs(result.z), axis=0, initial=0.0)
    limits = [here.where(int(number)) for number in result.weak]
    every = result.moves
    for limit, row, side in here.touches():
        if abs(at.y[row]) < WEAK * max(1.0, float(np.max(np.abs(at.y)))):
            limits.append(limit)
            every = np.vstack([every, side * result.y[row]])
    for c, name in enumerate(names):
        moves = every[:, c] / (largest[c] or 1.0)
        sides = not np.any(moves > STILL), not np.any(moves < -STILL)
        valid[name] = sides
        if all(sides):
            continue
        which = list(dict.fromkeys(limits[number] for number in np.flatnonzero(np.abs(moves) > STILL)))
        what = ", ".join(which[:3]) + (f" and {len(which) - 3} more" if len(which) > 3 else "")
        holds = {(True, False): "smaller values only", (False, True): "larger values only", (False, False): "no side"}
        notes.append(f"{name}: {what} only just active, without a multiplier; the derivative holds for {holds[sides]}")
    return valid, notes
