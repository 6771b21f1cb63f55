"""Structures with controls that the cost hardly determines: these take the least effort, the others switch exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ocp.arcs.active_limits import pressing
from ocp.arcs.arc_nlp import ArcNlp, prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.arcs import durations, elements_of, key_of, refined
from ocp.arcs.loose_arcs import held_exactly, loosened
from ocp.arcs.optimality_check import Certificate, certify, complaint
from ocp.arcs.revision import revisions, swapped, with_contact, with_hold, with_saturated, without_vanished
from ocp.arcs.settling import EVEN, RESIDUAL, Attempt, Budget, denser, settle
from ocp.checks import Array
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt
from ocp.transcription.guess import Guess

EFFORT = 1e-3  # penalty on the squares of free controls, share of the cost per second
NEAR = 1e-3  # penalty on their distance from those of least effort
SPREADS = (0.4, 1.8), (0.2, 2.5), (0.0, np.inf)  # durations of arcs, shares of the guessed ones, NLP by NLP
GENTLE = 1e-5  # gain, share of the cost, that controls may give away by taking the least effort
ENOUGH = 2e-6  # the same, below which nothing more is tried
EXCESS = 5e-6  # accepted violation of a state limit beside such controls, share of its range
ROUGH = 1e-5  # accepted local error of the dynamics, share of the range of a state
LOOSE = 28.0  # elements of a motion with state limits that are held by inequalities
MOST_EFFORT, MOST_NEARER = 44, 90  # most elements while the structure still changes, and later
WHERE_EXCEEDED = 3.0  # parts that an element is divided into where a state limit is exceeded between its points
FEASIBLE, STATIONARY = 1e-7, 1e-3  # errors of an NLP that is nearly solved
MOST = 20  # NLPs for one reading
FAILURES = 2  # of them that are not solved
NEARER = 3  # steps from least effort towards what the cost asks for, and refinements of the elements
WRONG = "a multiplier of a state limit has the wrong sign"
ITERATIONS, TOL, TOL_MOVED = 80, 1e-8, 3e-7
START = {
    **dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), 1e-5),
    "mumps_permuting_scaling": 0, "mumps_scaling": 0,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Step:
    """A structure to be solved: its arcs, the guess, the density of elements, and how far durations may move."""

    arcs: tuple[Arc, ...]
    guess: Guess
    density: tuple[Array, Array]
    trust: int


def settle_gently(
    task: ArcProblem, coarse: Solution, arcs: tuple[Arc, ...], settings: Ipopt, budget: Budget
) -> Attempt:
    """Solve the NLP of a structure whose free controls take the least effort, and revise it until it is sound.

    The durations of the arcs move by limited shares at first: arcs of a structure that is not quite right would shrink
    to nothing at once otherwise, from where the NLP is hard to solve. Free controls that reach a bound are fixed there,
    state limits that are active along arcs are held by an equation, and become inequalities again where that fails or
    their multiplier has the wrong sign. At last the penalty on effort becomes one on the distance from those controls.

    Args:
        task: the problem.
        coarse: motion with least effort that the structure was read from.
        arcs: the structure.
        settings: of IPOPT.
        budget: of seconds.

    Returns:
        The motion; with a reason beside it if a multiplier of a state limit has the wrong sign.
    """
    seen: set[tuple[object, ...]] = set()
    loosely: frozenset[tuple[int, int]] = frozenset()  # state limits that stay inequalities
    iterations = failures = 0
    best, reason = None, "the structure does not settle"
    now = _Step(arcs, from_solution(coarse), EVEN, 0)
    rate = abs(coarse.cost) / coarse.duration
    for count in range(MOST):
        if budget.left <= 0.0:
            break
        if not task.loose(now.arcs):
            # Nothing is left that effort could determine.
            rest = settle(task, coarse, now.arcs, settings, budget, now.guess)
            return replace(rest if rest.motion or best is None else best, iterations=iterations + rest.iterations)
        budget.show(f"structure {count + 1} with {len(now.arcs)} arcs")
        nlp, motion = _solved(task, now, settings, budget, rate * EFFORT, True)
        iterations += motion.result.iterations
        seen.add(key_of(now.arcs))
        solved = motion.result.status is Status.SOLVED
        failures += int(not solved)
        if not solved and (failures > FAILURES or not _near(motion)):
            reason = f"the NLP of the arcs read is not solved ({motion.result.verbatim})"
            held = frozenset((c.limit, c.side) for arc in now.arcs for c in arc.held if c.control >= 0)
            other = loosened(now.arcs) if held else swapped(motion.arcs)
            if failures > FAILURES or best is not None or key_of(other) in seen:
                break
            loosely |= held
            # Inequalities at the points of elements need more of these.
            now = replace(now, arcs=other, trust=0, density=(EVEN[0], np.full(1, LOOSE)) if held else now.density)
            continue
        solution, kept = motion.solution(task, coarse), without_vanished(motion.arcs)
        now = replace(now, arcs=motion.arcs, guess=from_solution(solution))
        other = held_exactly(task, motion, with_saturated(task.problem, motion, kept), loosely)
        if key_of(other) not in seen:
            now = replace(now, arcs=other, trust=min(now.trust, 1))
            continue
        if _limited(motion, nlp.arcs, nlp.spread):
            now = replace(now, trust=now.trust + 1)
            continue
        if now.trust < len(SPREADS) - 1:
            now = replace(now, trust=len(SPREADS) - 1)
            continue
        now = replace(now, density=denser(motion, solution))
        certificate = certify(task, motion)
        for _ in range(NEARER):
            problem, nearer = _solved(task, now, settings, budget, rate * NEAR, False)
            iterations += nearer.result.iterations
            if nearer.result.status is not Status.SOLVED:
                break
            nlp, motion, solution = problem, nearer, nearer.solution(task, coarse)
            certificate, kept = certify(task, motion), without_vanished(motion.arcs)
            best = _judged(motion, solution, certificate, best) or best
            density = _denser(motion, solution, certificate)
            now = _Step(motion.arcs, from_solution(solution), density, now.trust)
            fine, small = float(np.max(solution.error)) <= RESIDUAL, certificate.gap <= ENOUGH
            if budget.left <= 0.0 or kept != motion.arcs or (fine and (small or certificate.signs)):
                break
        reason = complaint(task, certificate)
        if best is not None and not best.reason and best.certificate is not None and best.certificate.gap <= ENOUGH:
            break
        options = [kept]
        if kept == motion.arcs:
            loosely |= frozenset((c.limit, c.side) for _, c in certificate.released)
            options = [loosened(kept, loosely), *_revised(task, nlp, motion, certificate)]
        revised = next((o for o in options if key_of(o) not in seen), None)
        if revised is None:
            break
        now = replace(now, arcs=revised, trust=1)
    if best is not None:
        return replace(best, iterations=iterations)
    return Attempt(None, None, reason, iterations)


def _solved(
    task: ArcProblem, now: _Step, settings: Ipopt, budget: Budget, weight: float, effort: bool
) -> tuple[ArcNlp, ArcMotion]:
    moved = effort and now.trust < len(SPREADS) - 1
    start = {"mu_init": 1e-4 if effort and now.trust == 0 else 1e-5, **START}
    begin = replace(
        settings, tol=TOL_MOVED if moved else TOL, max_iter=ITERATIONS, extra={**settings.extra, **start}
    )  # fmt: skip
    spread = SPREADS[now.trust if effort else -1]
    elements = refined(now.arcs, now.density)
    most = MOST_EFFORT if effort else MOST_NEARER
    elements = elements_of(now.arcs) if sum(elements) > most else elements
    nlp = prepare_arcs(task, now.arcs, elements, now.guess, budget.limited(begin), weight, True, effort, spread)
    return nlp, nlp.solve(nlp.start(now.guess, durations(now.arcs)))


def _denser(motion: ArcMotion, solution: Solution, certificate: Certificate) -> tuple[Array, Array]:
    """Return the density of elements that errors and state limits exceeded between the points ask for."""
    ends, wanted = denser(motion, solution)
    for crossing in certificate.crossings:
        if crossing.share > EXCESS:
            near = (ends[1:] * motion.duration > crossing.start) & (ends[:-1] * motion.duration < crossing.end)
            wanted = np.where(near, np.maximum(wanted, WHERE_EXCEEDED / motion.grid.widths), wanted)
    return ends, wanted


def _near(motion: ArcMotion) -> bool:
    """Return whether the NLP is nearly solved, so that the next one can begin there."""
    log = motion.result.log
    last = [log[name][-1] if log.get(name) else np.inf for name in ("inf_pr", "inf_du")]
    return bool(last[0] < FEASIBLE and last[1] < STATIONARY)


def _limited(motion: ArcMotion, arcs: tuple[Arc, ...], spread: tuple[float, float]) -> bool:
    """Return whether an arc has the least or the largest duration that it may have."""
    ratio = durations(motion.arcs) / np.maximum(durations(arcs), 1e-300)
    return bool(np.any(ratio < 1.01 * spread[0]) or np.any(ratio > 0.99 * spread[1])) and spread[0] > 0.0


def _judged(motion: ArcMotion, solution: Solution, certificate: Certificate, best: Attempt | None) -> Attempt | None:
    """Return a motion that may be returned and is better than the best one; else None."""
    exceeded = any(crossing.share > EXCESS for crossing in certificate.crossings)
    rough = float(np.max(solution.error)) > ROUGH
    if certificate.gap > GENTLE or exceeded or rough or without_vanished(motion.arcs) != motion.arcs:
        return None
    wrong = bool(certificate.jumps or certificate.released)
    made = Attempt(motion, certificate, WRONG if wrong else "", 0)
    if best is None or best.certificate is None:
        return made
    return made if (wrong, certificate.gap) < (bool(best.reason), best.certificate.gap) else None


def _revised(task: ArcProblem, nlp: ArcNlp, motion: ArcMotion, certificate: Certificate) -> list[tuple[Arc, ...]]:
    """Return structures to try next, the most promising first."""
    kept, pressed = without_vanished(motion.arcs), pressing(nlp, motion)[:2]
    met = [with_contact(kept, crossing, task.limits) for crossing in pressed]
    met = [with_hold(task.problem, kept, crossing, task.limits) for crossing in pressed] + met
    others = [other for other in met if other != kept]
    return others + revisions(motion, certificate, task.limits)
