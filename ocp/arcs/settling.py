"""From a first guess of the switching structure to the optimal one: solve its NLP, check it, revise it, repeat."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field, replace

import numpy as np

from ocp.arcs.active_limits import pressing
from ocp.arcs.arc_nlp import ArcNlp, prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.arcs import durations, elements_of, key_of
from ocp.arcs.optimality_check import Certificate, certify, complaint
from ocp.arcs.revision import (
    revisions,
    swapped,
    with_contact,
    with_hold,
    with_saturated,
    without_shortest_hold,
    without_vanished,
)
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import QUIET_SECONDS, Ipopt

DOUBLINGS = 3  # of the elements, until the residual is small enough
RESIDUAL = 5e-7  # accepted local error of the dynamics on an element, share of the range of a state
REVISIONS = 16  # most structures tried for one detection
FAILURES = 2  # most structures whose NLP is not solved, for one detection
PUSHED = 1e-4  # largest change of a scaled unknown when the barrier of inactive limits is removed
# Penalty on singular controls, share of the cost per second: first on their size, then on their distance from the
# last iterate. STRONG, halved with each step, is for motions that have not begun with least effort.
EFFORT, WEIGHT, STRONG = 1e-3, 1e-3, 1e-2
# Where the first NLP is not solved, it is tried again from farther inside its bounds.
ROUGH = 10.0  # times the accepted local error, from which the elements are halved at once
FAR = {"mu_init": 1e-2, "bound_push": 1e-2, "bound_frac": 1e-2}
BIAS = 1e-5  # gain by wrong signs, share of the cost, that a penalty may cause
PROXIMAL, LEFT = 8, 1e-11  # most proximal steps; they end when the penalty is this share of the cost


@dataclass(frozen=True, eq=False)
class Budget:
    """Processor time after which no further NLP is begun, and progress on the terminal meanwhile.

    Processor time, so that a busy machine finds the same.

    Args:
        seconds: allowed [s].
        shown: whether progress is shown.
        started: processor time at the beginning [s].
        begun: wall-clock time at the beginning [s].
    """

    seconds: float
    shown: bool = False
    started: float = field(default_factory=time.process_time)
    begun: float = field(default_factory=time.perf_counter)

    @property
    def left(self) -> float:
        """Seconds left."""
        return self.started + self.seconds - time.process_time()

    def show(self, text: str) -> None:
        """Show a line of progress, once polishing has lasted two seconds; an empty text wipes it."""
        spent = time.perf_counter() - self.begun
        if self.shown and spent > QUIET_SECONDS:
            line = f"  polishing, {text}, {spent:.0f} s" if text else ""
            print(f"\r{line:76s}" + ("" if text else "\r"), end="", file=sys.stderr, flush=True)

    def limited(self, settings: Ipopt) -> Ipopt:
        """Return settings of the solver that keep within it."""
        return replace(settings, extra={"max_cpu_time": min(max(self.left, 0.01), 1e6), **settings.extra})


@dataclass(frozen=True, eq=False)
class Attempt:
    """The result of one detection and the revisions that followed: a motion that meets all conditions, or a reason."""

    motion: ArcMotion | None
    certificate: Certificate | None
    reason: str
    iterations: int


def settle(
    task: ArcProblem, coarse: Solution, arcs: tuple[Arc, ...], settings: Ipopt, budget: Budget, eased: bool = False
) -> Attempt:
    """Solve the NLP of a structure and revise the structure until all conditions of optimality hold.

    Args:
        task: the problem.
        coarse: the motion that the structure was read from, guess of the first NLP.
        arcs: the structure.
        settings: of IPOPT.
        budget: of seconds.
        eased: whether undetermined controls of the given motion take the least effort; those of the result then do too.
    """
    guess = from_solution(coarse)
    seen: set[tuple[object, ...]] = set()
    solves = iterations = level = failures = 0
    far, step = False, 0 if eased else 1
    settled: Attempt | None = None
    rate = abs(coarse.cost) / coarse.duration
    while solves < REVISIONS + DOUBLINGS + PROXIMAL and (solves == 0 or budget.left > 0.0):
        elements, loose = elements_of(arcs, level), task.loose(arcs)
        weight = rate * (EFFORT if step == 0 else WEIGHT if eased else STRONG * 0.5 ** (step - 1)) if loose else 0.0
        new_singular = loose and not eased and step == 1
        begin = replace(settings, extra={**settings.extra, **FAR}) if far or new_singular else settings
        budget.show(f"structure {len(seen) + 1} with {len(arcs)} arcs")
        nlp = prepare_arcs(task, arcs, elements, guess, budget.limited(begin), weight, effort=step == 0)
        motion = nlp.solve(nlp.start(guess, durations(arcs)))
        solves, iterations = solves + 1, iterations + motion.result.iterations
        seen.add(key_of(arcs))
        if motion.result.status is not Status.SOLVED:
            if settled is not None:
                return replace(settled, iterations=iterations)  # only its residual could have been smaller
            if solves == 1 and not far:
                far = True
                continue
            failures, far = failures + 1, False
            others = swapped(motion.arcs), without_shortest_hold(arcs), without_vanished(motion.arcs)
            other = next((o for o in others if key_of(o) not in seen), None)
            if other is not None and failures <= FAILURES:
                arcs = tuple(replace(a, duration=max(a.duration, 1e-6 * coarse.duration)) for a in other)
                continue
            reason = f"the NLP of the arcs read is not solved ({motion.result.verbatim})"
            return Attempt(None, None, reason, iterations)
        far, solution = False, motion.solution(task, coarse)
        if loose and step == 0:
            # The costates are those of a cost with effort: nothing but vanished and saturated arcs can be judged.
            other = with_saturated(task.problem, motion, without_vanished(motion.arcs))
            guess = from_solution(solution)
            if key_of(other) in seen or key_of(other) == key_of(arcs):
                arcs, step = motion.arcs, 1
            else:
                arcs = other
            continue
        certificate = certify(task, motion)
        sound = certificate.sound
        error = float(np.max(solution.error))
        pressed = pressing(nlp, motion)[:2]
        kept = without_vanished(motion.arcs)
        met = [with_contact(kept, crossing, task.limits) for crossing in pressed]
        met = [with_hold(task.problem, kept, crossing, task.limits) for crossing in pressed] + met
        proposed = [*(other for other in met if other != kept), *revisions(motion, certificate, task.limits)]
        sound = sound and not pressed
        new = [other for other in proposed if key_of(other) not in seen]
        regularised = motion.penalty > LEFT * abs(motion.result.cost) and step < PROXIMAL
        gains = sum(wrong.gain for wrong in certificate.signs)
        if (
            regularised
            and not sound
            and eased
            and gains < BIAS * abs(motion.result.cost)
            and len(kept) == len(motion.arcs)
        ):
            # Small switching functions with a wrong sign may be due to the penalty on singular controls.
            arcs, guess, step = motion.arcs, from_solution(solution), step + 1
            level += int(error > ROUGH * RESIDUAL and level < DOUBLINGS)
            continue
        if new and (not sound or len(new[0]) < len(motion.arcs)):
            arcs, guess, step = new[0], from_solution(solution), min(step, 1)
            continue
        if not sound and regularised and not (certificate.signs or certificate.crossings or certificate.jumps):
            # Only singular arcs are wrong, because of the penalty on them.
            arcs, guess, step = motion.arcs, from_solution(solution), step + 1
            continue
        if not sound and (level >= DOUBLINGS or (level >= 1 and error <= RESIDUAL)):
            return Attempt(None, None, complaint(task, certificate), iterations)
        settled = Attempt(motion, certificate, "", iterations) if sound else None
        if not sound or (error > RESIDUAL and level < DOUBLINGS):
            arcs, guess, level = motion.arcs, from_solution(solution), level + 1
            continue
        if regularised:
            arcs, guess, step = motion.arcs, from_solution(solution), step + 1
            continue
        return Attempt(*_finished(nlp, motion, certificate), "", iterations)
    if settled is not None:
        return replace(settled, iterations=iterations)
    return Attempt(None, None, "the structure does not settle", iterations)


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
    result = replace(
        before, z=after.z, multipliers=after.multipliers, limits=after.limits, cost=after.cost, derivatives=inside,
        seconds=seconds,
    )  # fmt: skip
    return (replace(better, result=result), again) if again.sound else (motion, certificate)
