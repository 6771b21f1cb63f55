"""From a first guess of the switching structure to the optimal one: solve its NLP, check it, revise it, repeat."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field, replace

import numpy as np

from ocp.arcs.active_limits import pressing
from ocp.arcs.arc_nlp import ArcNlp, prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.arcs import durations, key_of, refined
from ocp.arcs.optimality_check import Certificate, certify, complaint
from ocp.arcs.revision import (
    revisions,
    swapped,
    with_contact,
    with_hold,
    without_shortest_hold,
    without_vanished,
)
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt
from ocp.solving.iteration_watch import QUIET_SECONDS

EVEN = np.array([0.0, 1.0]), np.zeros(1)  # no density of elements
FINER = 6.0  # most parts that an element is divided into at once
OVERSHOOT = 5e-4  # accepted excess of a control between collocation points, share of its range
BETWEEN_POINTS = np.linspace(0.0, 1.0, 11)
NEARLY = 1e-6  # gain, share of the cost, and violation of limits, share of their ranges, if nothing better is found
ROUGH = 1e-5  # local error of the dynamics, share of the range of a state, accepted then
MORE_DOUBLINGS = 6  # the same where the residual would not be accepted at all
DOUBLINGS = 3  # of the elements, until the residual is small enough
LARGEST = 1e-4  # local error above which no motion is called polished
RESIDUAL = 5e-7  # accepted local error of the dynamics on an element, share of the range of a state
REVISIONS = 16  # most structures tried for one detection
FAILURES = 2  # most structures whose NLP is not solved, for one detection
PUSHED = 1e-4  # largest change of a scaled unknown when the barrier of inactive limits is removed
STRONG = 1e-2  # penalty on the distance of singular controls from the last iterate, cost per second; halved each step
# Where the first NLP is not solved, it is tried again from farther inside its bounds.
PATIENT = 60  # iterations from there
CLOSE = {"mu_init": 1e-9, "bound_push": 1e-9, "bound_frac": 1e-9}  # for the same structure with more elements
FAR = {
    "accept_every_trial_step": "no",
    "watchdog_shortened_iter_trigger": 2,
    "mu_init": 1e-2,
    "bound_push": 1e-2,
    "bound_frac": 1e-2,
}
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

    def part(self, share: float) -> Budget:
        """Return a budget with a share of the seconds left."""
        return replace(self, seconds=share * max(self.left, 0.0), started=time.process_time())

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
    """The result of one detection and the revisions that followed: a motion that meets all conditions, or a reason.

    Args:
        motion, certificate: None if no NLP was solved.
        reason: why it is not sound; empty if it is.
        iterations: of all NLPs.
        task: the problem, with the scheme of the motion.
        cheaper: guess of a much better local optimum, towards which the solver moved.
    """

    motion: ArcMotion | None
    certificate: Certificate | None
    reason: str
    iterations: int
    task: ArcProblem
    cheaper: Solution | None = None


def settle(
    task: ArcProblem, coarse: Solution, arcs: tuple[Arc, ...], settings: Ipopt, budget: Budget,
    again: bool = True,
) -> Attempt:  # fmt: skip
    """Solve the NLP of a structure and revise the structure until all conditions of optimality hold.

    Args:
        task: the problem.
        coarse: the motion that the structure was read from, guess of the first NLP.
        arcs: the structure.
        settings: of IPOPT.
        budget: of seconds.
        again: whether the first NLP is tried again from farther inside its bounds if it is not solved.
    """
    guess, density = from_solution(coarse), EVEN
    seen: set[tuple[object, ...]] = set()
    solves = iterations = level = failures = 0
    far, step = False, 1
    settled: Attempt | None = None
    near: Attempt | None = None  # the best one whose conditions hold nearly
    rate = abs(coarse.cost) / coarse.duration
    while solves < REVISIONS + DOUBLINGS + PROXIMAL and (solves == 0 or budget.left > 0.0):
        elements, loose = refined(arcs, density), task.loose(arcs)
        weight = rate * STRONG * 0.5 ** (step - 1) if loose else 0.0
        new_singular = loose and step == 1
        begin = settings
        if far or new_singular:
            begin = replace(settings, max_iter=max(settings.max_iter, PATIENT), extra={**settings.extra, **FAR})
        elif level and not loose:
            begin = replace(settings, extra={**settings.extra, **CLOSE})
        budget.show(f"structure {len(seen) + 1} with {len(arcs)} arcs")
        nlp = prepare_arcs(task, arcs, elements, guess, budget.limited(begin), weight)
        motion = nlp.solve(nlp.start(guess, durations(arcs)))
        solves, iterations = solves + 1, iterations + motion.result.iterations
        seen.add(key_of(arcs))
        if motion.result.status is not Status.SOLVED:
            if settled is not None:
                return replace(settled, iterations=iterations)  # only its residual could have been smaller
            if solves == 1 and not far and (again or motion.result.status is Status.ACCEPTABLE):
                far = True
                continue
            failures, far = failures + 1, False
            others = swapped(motion.arcs), without_shortest_hold(arcs), without_vanished(motion.arcs)
            other = next((o for o in others if key_of(o) not in seen), None)
            if other is not None and failures <= (FAILURES if again else 1):
                arcs = tuple(replace(a, duration=max(a.duration, 1e-6 * coarse.duration)) for a in other)
                continue
            reason = f"the NLP of the arcs read is not solved ({motion.result.verbatim})"
            return near or Attempt(None, None, reason, iterations, task)
        far, solution = False, motion.solution(task, coarse)
        certificate = certify(task, motion)
        sound = certificate.sound
        worst = float(np.max(solution.error))
        density = denser(motion, solution)
        # Singular controls oscillate where elements are of different widths.
        if worst > LARGEST or (loose and worst > RESIDUAL):
            density = motion.grid.ends, 2.0 / motion.grid.widths
        pressed = pressing(nlp, motion)[:2]
        kept = without_vanished(motion.arcs)
        met = [with_contact(kept, crossing, task.limits) for crossing in pressed]
        met = [with_hold(task.problem, kept, crossing, task.limits) for crossing in pressed] + met
        proposed = [*(other for other in met if other != kept), *revisions(motion, certificate, task.limits)]
        sound = sound and not pressed
        least = NEARLY if near is None or near.certificate is None else near.certificate.gap
        if kept == motion.arcs and certificate.sound_within(least, NEARLY) and worst <= ROUGH:
            near = Attempt(motion, certificate, "", iterations, task)
        new = [other for other in proposed if key_of(other) not in seen]
        regularised = motion.penalty > LEFT * abs(motion.result.cost) and step < PROXIMAL
        if new and (not sound or len(new[0]) < len(motion.arcs)):
            arcs, guess, step = new[0], from_solution(solution), min(step, 1)
            continue
        if not sound and regularised and not (certificate.signs or certificate.crossings or certificate.jumps):
            # Only singular arcs are wrong, because of the penalty on them.
            arcs, guess, step = motion.arcs, from_solution(solution), step + 1
            continue
        if not sound and (level >= DOUBLINGS or (level >= 1 and worst <= RESIDUAL)):
            return near or Attempt(None, None, complaint(task, certificate), iterations, task)
        settled = Attempt(motion, certificate, "", iterations, task) if sound else None
        if not sound or (worst > RESIDUAL and level < (DOUBLINGS if worst <= LARGEST else MORE_DOUBLINGS)):
            arcs, guess, level = motion.arcs, from_solution(solution), level + 1
            continue
        if regularised:
            arcs, guess, step = motion.arcs, from_solution(solution), step + 1
            continue
        return Attempt(*finished(nlp, motion, certificate), "", iterations, task)
    if settled is not None:
        return replace(settled, iterations=iterations)
    return near or Attempt(None, None, "the structure does not settle", iterations, task)


def denser(motion: ArcMotion, solution: Solution) -> tuple[Array, Array]:
    """Return the density of elements that the errors of a motion ask for; see `refined`.

    Args:
        motion: the solution of the NLP of a structure.
        solution: the same as a Solution.
    """
    error = np.maximum(solution.error, RESIDUAL * overshoot(solution) / OVERSHOOT)
    finer = np.clip(np.ceil((error / RESIDUAL) ** (1.0 / 3.0)), 1.0, FINER)
    return motion.grid.ends, finer / motion.grid.widths


def overshoot(solution: Solution) -> Array:
    """Return by how much controls leave their limits between the points of each element (N,), share of their ranges."""
    assert solution.problem is not None
    low, high = solution.problem.limits(Where.ALONG, solution.problem.system.u)
    u = np.einsum("sm,kma->ksa", solution.scheme.control_at(BETWEEN_POINTS), solution.controls)
    both = np.isfinite(low) & np.isfinite(high) & (high > low)
    over = np.maximum(low - u, u - high)[:, :, both] / (high - low)[both]
    return np.asarray(np.max(over, axis=(1, 2), initial=0.0))


def finished(nlp: ArcNlp, motion: ArcMotion, certificate: Certificate) -> tuple[ArcMotion, Certificate]:
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
