"""Polishing: switching times become unknowns, so that no switch lies inside an element."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp import checks
from ocp.arcs.arc_nlp import ArcNlp, prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem, arc_problem
from ocp.arcs.arcs import durations, elements_of, key_of, tabulate
from ocp.arcs.detection import contacts, read
from ocp.arcs.optimality_check import Certificate, certify, complaint
from ocp.arcs.revision import revise, swapped, without_shortest_hold, without_vanished
from ocp.arcs.switching import switching_functions
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.attached_problem import with_problem
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.violations import between_points
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt
from ocp.solving.solver import solve
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.scheme import Control, Scheme

SETTINGS = Ipopt(tol=1e-10, max_iter=60, progress=False, extra={"mu_init": 1e-6, "acceptable_iter": 0})
DOUBLINGS = 3  # of the elements, until the residual is small enough
RESIDUAL = 5e-7  # accepted local error of the dynamics on an element, share of the range of a state
REVISIONS = 16  # most structures tried for one detection
FAILURES = 2  # most structures whose NLP is not solved, for one detection
PUSHED = 1e-4  # largest change of a scaled unknown when the barrier of inactive limits is removed
READINGS = 3  # most detections; the second and third after refining the grid where the structure is in doubt
# No further structure is tried after that much work, 5 times that of the given solve and so much more. Work is counted
# in iterations at one collocation point, not in seconds, so that a busy machine finds the same.
PATIENCE = 5.0, 25000
WEIGHT = 1e-2  # penalty on singular controls, share of the cost per second; halved with each step
PROXIMAL, LEFT = 8, 1e-11  # most proximal steps; they end when the penalty is this share of the cost


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The result of one detection and the revisions that followed."""

    motion: ArcMotion | None
    certificate: Certificate | None
    reason: str
    iterations: int
    work: float


def polish(
    solution: Solution, problem: Problem | None = None, scheme: Scheme | None = None, solver: Ipopt | None = None
) -> Solution:
    """Solve again with the durations of the arcs as unknowns, controls at their limits pinned.

    The arcs (each control at its lower or upper limit, interior, or holding a state limit) are read from controls,
    switching functions and state limits. On an arc where a limit c <= c_max of order r holds, c^(r) = 0 determines its
    control, with c = c_max, c' = ... = 0 at the entry; a touch has c = c_max, c' = 0 at one instant. Then arcs that
    vanish are dropped, contacts with a multiplier of the wrong sign released, contacts added where a limit is exceeded,
    and arcs inserted where a switching function has the wrong sign, until nothing is wrong. Where the structure is in
    doubt, the grid is refined there and read again.
    Where little or nothing is left to choose, the last steps are those of Newton's iteration on the equations alone, as
    the barrier of limits that the motion only comes near moves its switches by 1e-8 of the duration.

    Interior arcs of controls that enter the Hamiltonian linearly are singular: a penalty on the distance from the last
    iterate keeps them from chattering and is iterated away (proximal point); the message gives its final value.

    Args:
        solution: solved, of a Problem.
        problem: needed only for a solution loaded without it.
        scheme: with collocated control, default legendre(6, control=Control.COLLOCATED).
        solver: settings of IPOPT.

    Returns:
        The polished solution with its `structure`; or the given one with structure None and the reason in its message:
        the polished one counts only if it is solved, confirms or improves the cost, and meets the sign conditions.
        `timings` are those of polishing alone: derivatives and solver of its last solve, set-up for all before it.

    Raises:
        TypeError: no Solution, or a scheme whose control is not collocated.
        ValueError: a solution loaded without its problem.

    Source: Kaya, Noakes, Computational method for time-optimal switching control, J. Optim. Theory Appl. 117, 2003;
        Hartl, Sethi, Vickson, SIAM Review 37, 1995; Rockafellar, Monotone operators and the proximal point algorithm,
        SIAM J. Control Optim. 14, 1976.
    """
    begun = time.perf_counter()
    solution, problem = with_problem("polish", solution, problem)
    checks.instance("polish: solver", solver, Ipopt | None, "settings of the solver, Ipopt(...), or None")
    scheme = legendre(6, Control.COLLOCATED) if scheme is None else scheme
    if not isinstance(scheme, Scheme) or scheme.control is not Control.COLLOCATED:
        shown = checks.shown(scheme)
        raise TypeError(f"polish: scheme is {shown}, expected one with control=Control.COLLOCATED")
    if scheme.slope_at_start:
        raise TypeError(f"polish: scheme is {scheme!r}, expected radau or legendre")
    settings = SETTINGS if solver is None else solver
    if not solution.ok:
        return _unpolished(solution, "it is not a solved one")
    if solution.duration <= 0.0:
        return _unpolished(solution, "it has no duration")
    task = arc_problem(problem, scheme, solution.values)
    limits = task.limits
    together = [limit for limit in limits if limit.order == 0 and _couples(problem, limit)]
    for hold in contacts(problem, solution, limits)[0] if together else []:
        if limits[hold.contact.limit] in together:
            name = limits[hold.contact.limit].label.name
            return _unpolished(solution, f"{name} limits several controls together; arcs are those of single controls")
    allowed = solution.cost + _doubt(problem, solution)
    coarse, reason, iterations = solution, "", 0
    left = PATIENCE[0] * _work(solution) + PATIENCE[1]
    for reading in range(READINGS):
        tried = _settle(task, coarse, settings, left)
        iterations, left = iterations + tried.iterations, left - tried.work
        reason = reason or tried.reason
        if tried.motion is not None and tried.certificate is not None:
            if tried.motion.result.cost - tried.motion.penalty <= allowed:
                spent = iterations, time.perf_counter() - begun
                result = _polished(task, solution, tried, spent)
                loose = between_points(result)
                if not loose:
                    return result
                reason = loose[0]
            else:
                cost = tried.motion.result.cost
                reason = f"the structure read leads to a cost of {cost:.9g}, more than {solution.cost:.9g}"
        if reading + 1 == READINGS or left <= 0.0:
            break
        finer = solve(problem, coarse.scheme, _finer(problem, coarse, limits), Ipopt(progress=False), coarse,
                      solution.values)  # fmt: skip
        iterations, left = iterations + finer.iterations, left - _work(finer)
        if not finer.ok:
            break
        coarse = finer
    return _unpolished(solution, reason)


def _work(solution: Solution) -> float:
    return float(solution.iterations * len(solution.grid) * solution.scheme.degree)


def _couples(problem: Problem, limit: StateLimit) -> bool:
    """Return whether a limit depends on more than one control."""
    return sum(ca.which_depends(limit.chain[-1], problem.system.u, 1, False)) > 1


def _settle(task: ArcProblem, coarse: Solution, settings: Ipopt, patience: float) -> _Attempt:
    """Detect a structure, solve its NLP and revise it until all conditions of optimality hold."""
    arcs, guess = read(task.problem, coarse, task.limits), from_solution(coarse)
    seen: set[tuple[object, ...]] = set()
    solves = iterations = work = level = steps = failures = 0
    settled: _Attempt | None = None
    while solves < REVISIONS + DOUBLINGS + PROXIMAL and (solves == 0 or work < patience):
        elements = elements_of(arcs, level)
        loose = task.loose(arcs)
        weight = WEIGHT * 0.5**steps * abs(coarse.cost) / coarse.duration if loose else 0.0
        begin = replace(settings, extra={**settings.extra, "mu_init": 1e-2}) if loose and steps == 0 else settings
        nlp = prepare_arcs(task, arcs, elements, guess, begin, weight)
        motion = nlp.solve(nlp.start(guess, durations(arcs)))
        solves, iterations = solves + 1, iterations + motion.result.iterations
        work += motion.result.iterations * sum(elements) * task.scheme.degree
        seen.add(key_of(arcs))
        if motion.result.status is not Status.SOLVED:
            if settled is not None:
                return replace(settled, iterations=iterations, work=work)  # only its residual could have been smaller
            failures += 1
            others = swapped(motion.arcs), without_shortest_hold(arcs), without_vanished(motion.arcs)
            other = next((o for o in others if key_of(o) not in seen), None)
            if other is not None and failures <= FAILURES:
                arcs = tuple(replace(a, duration=max(a.duration, 1e-6 * coarse.duration)) for a in other)
                continue
            reason = f"the NLP of the arcs read is not solved ({motion.result.verbatim})"
            return _Attempt(None, None, reason, iterations, work)
        certificate = certify(task, motion)
        solution, sound = motion.solution(task, coarse), certificate.sound
        revised = revise(motion, certificate, task.limits)
        if (not sound or len(revised) < len(motion.arcs)) and key_of(revised) not in seen:
            arcs, guess, steps = revised, from_solution(solution), 0
            continue
        regularised = motion.penalty > LEFT * abs(motion.result.cost) and steps < PROXIMAL
        if not sound and regularised and not (certificate.signs or certificate.crossings or certificate.jumps):
            # Only singular arcs are wrong, because of the penalty on them.
            arcs, guess, steps = motion.arcs, from_solution(solution), steps + 1
            continue
        if not sound and level >= 1:
            return _Attempt(None, None, complaint(task, certificate), iterations, work)
        settled = _Attempt(motion, certificate, "", iterations, work) if sound else None
        if not sound or (float(np.max(solution.error)) > RESIDUAL and level < DOUBLINGS):
            arcs, guess, level = motion.arcs, from_solution(solution), level + 1
            continue
        if regularised:
            arcs, guess, steps = motion.arcs, from_solution(solution), steps + 1
            continue
        return _Attempt(*_finished(nlp, motion, certificate), "", iterations, work)
    return _Attempt(None, None, "the structure does not settle", iterations, work)


def _finished(nlp: ArcNlp, motion: ArcMotion, certificate: Certificate) -> tuple[ArcMotion, Certificate]:
    """Return the motion solved again by Newton's iteration without inactive limits, whose barrier moves it a little."""
    task, bare = nlp.task, nlp.unlimited()
    if bare.equations is None or task.loose(motion.arcs):
        return motion, certificate
    better = bare.solve(motion.result.z)
    before, after = motion.result, better.result
    moved = np.max(np.abs(after.z - before.z))
    if after.status is not Status.SOLVED or moved > PUSHED or without_vanished(better.arcs) != better.arcs:
        return motion, certificate
    again = certify(task, better)
    inside, seconds = before.derivatives + after.derivatives, before.seconds + after.seconds
    answer = replace(
        before, z=after.z, multipliers=after.multipliers, limits=after.limits, cost=after.cost, derivatives=inside,
        seconds=seconds,
    )  # fmt: skip
    return (replace(better, result=answer), again) if again.sound else (motion, certificate)


def _doubt(problem: Problem, solution: Solution) -> float:
    """Return by how much the cost of a solution may be too low, to first order."""
    _, x, _, u = solution.samples(solution.scheme.points)
    costates = solution.costates.reshape(len(x), -1)
    result = switching_functions(problem, x, u, costates, solution.parameters)
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    return float(weights @ result.gains.sum(axis=1)) + 1e-6 * abs(solution.cost)


def _finer(problem: Problem, solution: Solution, limits: tuple[StateLimit, ...]) -> Grid:
    """Return the grid with elements in four where a control is between its limits or a state limit begins or ends."""
    holds, touches = contacts(problem, solution, limits)
    doubtful = {t for t, _ in touches} | {t for hold in holds for t in (hold.start, hold.end)}
    starts = np.cumsum([arc.duration for arc in read(problem, solution, limits)])[:-1]
    ends = solution.grid.ends
    split = np.zeros(len(solution.grid), dtype=bool)
    for t in (*doubtful, *starts.tolist()):
        k = int(solution.grid.locate(np.array([t / solution.duration]))[0])
        split[max(k - 1, 0) : k + 2] = True
    marks = [np.linspace(a, b, 5 if cut else 2)[:-1] for a, b, cut in zip(ends[:-1], ends[1:], split, strict=True)]
    return Grid(np.append(np.concatenate(marks), 1.0))


def _polished(task: ArcProblem, given: Solution, tried: _Attempt, spent: tuple[int, float]) -> Solution:
    motion, certificate = tried.motion, tried.certificate
    assert motion is not None
    assert certificate is not None
    iterations, seconds = spent
    result = motion.solution(task, given)
    summary = f"polished: {len(motion.arcs)} arcs, sign conditions open by {certificate.gap:.1e} of the cost"
    residual = float(np.max(result.error))
    if residual > RESIDUAL:
        summary += f", local error of the dynamics {residual:.1e}"
    if motion.penalty > 0.0:
        summary += f", singular arcs regularised by a penalty of {motion.penalty / abs(result.cost):.1e} of the cost"
    inside = motion.result.derivatives
    timings = Timings(seconds - motion.result.seconds, inside, motion.result.seconds - inside, seconds)
    return replace(
        result, message=f"{Status.SOLVED.value}; {summary}", iterations=iterations, timings=timings, rung="polish",
        structure=tabulate(task.problem, task.limits, motion.arcs),
    )  # fmt: skip


def _unpolished(solution: Solution, reason: str) -> Solution:
    return replace(solution, structure=None, message=f"{solution.message}; not polished: {reason}")
