"""Structures with controls that the cost hardly determines: these take the least effort, the others switch exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ocp.arcs.arc_nlp import prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.arcs import durations, elements_of
from ocp.arcs.loose_arcs import active_limits, freed, held_exactly, read_loosely, with_active_limits, without_islands
from ocp.arcs.optimality_check import Certificate, Crossing, certify, complaint, crossings_of
from ocp.arcs.revision import starts_of, with_saturated, without_vanished
from ocp.arcs.settling import OVERSHOOT, Attempt, Budget, overshoot, settle
from ocp.checks import Array
from ocp.solution.integration_drift import drift
from ocp.solution.solution import Solution, Status
from ocp.solution.structure import Arc
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt
from ocp.transcription.guess import Guess

NEAR = 3e-4  # penalty on the distance of free controls from those of least effort, share of the cost per second
SPREAD = 0.3, 2.0  # durations of arcs, shares of the guessed ones
GENTLE = 1e-5  # gain, share of the cost, that controls may give away by taking the least effort
ENOUGH = 5e-6  # the same, below which nothing more is tried
EXCESS, MOST_EXCESS = 1e-6, 1e-4  # wanted and accepted violation of a state limit, share of its range
KEPT = 5e-4  # the same, for a motion that is not called polished
LARGE = 1e-5  # the same, above which elements are divided; below, the limit is drawn in
TIGHTER = 1.05  # by how much a state limit is drawn in where it is exceeded between points, share of the excess
FINE = 5e-7  # wanted local error of the dynamics, share of the range of a state
DRIFT, MOST_DRIFT = 7e-7, 5e-6  # wanted and accepted drift of the re-integrated motion, share of the range of a state
SMALL = 2e-7  # wanted gain on an element, share of the cost
PARTS = 4  # most parts that an element is divided into at once
MOST_ELEMENTS = 120
LEAST = 0.1  # width of an element that remains of one where an arc begins, share of the least width around
ELSEWHERE = 1e-3  # gain of one NLP, share of the cost, that shows that the given motion was no local optimum
ROUNDS, MORE = 7, 3  # NLPs for one reading, and from the first on that may be returned
SHARPER, FEW = 2, 30  # NLPs with state limits held by equations, and their iterations
AROUND = 2  # elements beside a limit that is held, on which it presses as well
SAMPLES = 16  # of the guess on every element
ITERATIONS, TOL = 100, 1e-7
START = {"constr_viol_tol": 1e-9, "mumps_permuting_scaling": 0, "mumps_scaling": 0}
PUSHES = "bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"
CLOSE = {**START, **dict.fromkeys(PUSHES, 1e-8), "mu_init": 1e-8}  # to a motion of the same polynomials
NEXT = {**START, **dict.fromkeys(PUSHES, 1e-6), "mu_init": 1e-6}  # to one of others


@dataclass(frozen=True, eq=False)
class _Step:
    """A structure to be solved."""

    arcs: tuple[Arc, ...]
    ends: Array  # of the elements [s]; arcs begin at some of them
    guess: Guess
    crossings: tuple[Crossing, ...]  # state limits that are drawn in, and by how much


@dataclass(frozen=True, eq=False)
class _Judged:
    """The solution of a step, and how far its conditions are open."""

    motion: ArcMotion
    solution: Solution
    certificate: Certificate
    drift: float  # of the re-integrated motion, share of the range of a state

    @property
    def excess(self) -> float:
        """Largest violation of a state limit, share of its range."""
        return max((crossing.share for crossing in self.certificate.crossings), default=0.0)

    @property
    def score(self) -> float:
        """Largest ratio of a figure to the wanted one; 1 or less if nothing is to do."""
        return max(self.certificate.gap / ENOUGH, self.excess / EXCESS, self.drift / DRIFT)

    @property
    def feasible(self) -> bool:
        """Whether limits and equations of motion are kept."""
        return self.excess <= KEPT and self.drift <= MOST_DRIFT

    @property
    def acceptable(self) -> bool:
        """Whether it may be returned as polished."""
        return self.feasible and self.certificate.gap <= GENTLE and self.excess <= MOST_EXCESS


def settle_gently(task: ArcProblem, coarse: Solution, settings: Ipopt, budget: Budget) -> Attempt:
    """Solve the NLP of a structure whose free controls keep close to those of least effort, until it is sound.

    Controls are pinned only where they stay at a bound on whole elements of the given motion; elsewhere they are free
    between their limits and linear on each element, so that they keep these everywhere, and state limits stay
    inequalities. A pinned control whose switching function has the wrong sign is freed there. Where a state limit is
    exceeded between the points of an element, it is drawn in by as much. Once little is left to gain, the motion with
    polynomials of the scheme wanted, on which limits that are active along arcs are held by equations, is returned if
    it is sound.

    Args:
        task: the problem, with the scheme wanted.
        coarse: motion with least effort on a moved grid, with controls that are linear on each element.
        settings: of IPOPT.
        budget: of seconds.

    Returns:
        The motion; with a reason beside it if better controls would save more than may be left.
    """
    loose = replace(task, scheme=coarse.scheme)
    arcs = read_loosely(task.problem, coarse)
    ends, crossings = coarse.grid.ends * coarse.duration, crossings_of(loose, coarse)
    ends = _divided(ends, _parts_where_exceeded(crossings, ends, _parts(coarse.error)))
    now = _Step(arcs, ends, from_solution(coarse, SAMPLES), ())
    rate, iterations = abs(coarse.cost) / coarse.duration, 0
    best: _Judged | None = None
    near: _Judged | None = None  # that keeps its limits, whatever may be gained
    sharper, more = SHARPER, MORE
    reason, cheaper = "the structure does not settle", None
    begin = replace(settings, tol=TOL, max_iter=ITERATIONS, extra={**settings.extra, **CLOSE})
    for count in range(ROUNDS):
        if budget.left <= 0.0:
            break
        budget.show(f"structure {count + 1} with {len(now.arcs)} arcs")
        counts, shares = _elements(now.arcs, now.ends)
        nlp = prepare_arcs(
            loose, now.arcs, counts, now.guess, budget.limited(begin), rate * NEAR, spread=SPREAD,
            drawn_in=now.crossings, shares=shares, tied=True,
        )  # fmt: skip
        motion = nlp.solve(nlp.start(now.guess, durations(now.arcs)))
        iterations += motion.result.iterations
        if motion.result.cost < coarse.cost - ELSEWHERE * abs(coarse.cost):
            cheaper = motion.solution(loose, coarse)
            break
        if motion.result.status is not Status.SOLVED:
            reason = f"the NLP of the arcs read is not solved ({motion.result.verbatim})"
            break
        judged = _judged(loose, motion, coarse)
        reason = complaint(loose, judged.certificate)
        if judged.feasible and (near is None or judged.score < near.score):
            near = judged
        if judged.acceptable and (best is None or judged.score < best.score):
            best = judged
        if judged.certificate.gap <= GENTLE and judged.drift <= MOST_DRIFT and sharper:
            sharper -= 1
            better = _sharpened(task, loose, judged, coarse, settings, budget)
            if better is not None:
                return replace(better, iterations=iterations + better.iterations)
        more -= int(best is not None)
        if judged.score <= 1.0 or not more:
            break
        now = _next(loose, judged, now)
    if near is None:
        return Attempt(None, None, reason, iterations, loose, cheaper)
    chosen = best or near
    motion = replace(chosen.motion, arcs=with_active_limits(loose, chosen.motion))
    reason = "" if best else complaint(loose, chosen.certificate)
    return Attempt(motion, chosen.certificate, reason, iterations, loose, cheaper)


def _sharpened(
    task: ArcProblem, loose: ArcProblem, judged: _Judged, coarse: Solution, settings: Ipopt, budget: Budget
) -> Attempt | None:
    """Solve once more with polynomials, state limits held by equations along arcs; None if that is not sound."""
    motion, active = judged.motion, active_limits(loose, judged.motion)
    held = np.any([np.zeros(len(motion.grid), dtype=bool), *active.values()], axis=0)
    near = np.convolve(held, np.ones(2 * AROUND + 1), "same")[: len(held)] > 0.0
    if budget.left <= 0.0 or np.any(motion.pressed & ~near):
        return None  # a limit that presses on a part of an arc is held by more elements only
    arcs = without_islands(held_exactly(loose, motion))
    if not task.loose(arcs):
        found = settle(task, judged.solution, arcs, settings, budget, again=False)
        return None if found.motion is None else found
    guess, iterations = from_solution(judged.solution, SAMPLES), 0
    begin = replace(settings, max_iter=FEW, extra={**settings.extra, **NEXT})
    weight = abs(coarse.cost) / coarse.duration * NEAR
    for effort in (True, False):
        nlp = prepare_arcs(task, arcs, elements_of(arcs), guess, budget.limited(begin), weight, True, effort)
        motion = nlp.solve(nlp.start(guess, durations(arcs)))
        iterations += motion.result.iterations
        if motion.result.status is not Status.SOLVED or without_vanished(motion.arcs) != motion.arcs:
            return None
        arcs, guess = motion.arcs, from_solution(motion.solution(task, coarse), SAMPLES)
    sharp = _judged(task, motion, coarse)
    sound = sharp.certificate.sound_within(ENOUGH, EXCESS) and sharp.drift <= DRIFT
    if not sound or float(np.max(overshoot(sharp.solution))) > OVERSHOOT:
        return None
    return Attempt(motion, sharp.certificate, "", iterations, task)


def _judged(task: ArcProblem, motion: ArcMotion, coarse: Solution) -> _Judged:
    solution = motion.solution(task, coarse)
    away = np.max(np.abs(drift(solution, task.problem)), axis=0)
    size = np.maximum(np.ptp(solution.states, axis=(0, 1)), 1e-300)
    return _Judged(motion, solution, certify(task, motion), float(np.max(away / size)))


def _next(task: ArcProblem, judged: _Judged, now: _Step) -> _Step:
    """Return the structure to solve next, with more elements where something is not fine enough."""
    motion, certificate, solution = judged.motion, judged.certificate, judged.solution
    arcs = with_saturated(task.problem, motion, without_vanished(motion.arcs))
    ends, parts = motion.grid.ends * motion.duration, np.ones(len(motion.grid), dtype=int)
    if certificate.gap > ENOUGH:
        arcs = freed(arcs, certificate.signs)
        parts = np.where(certificate.gains > SMALL, 2, parts)
    if judged.drift > DRIFT:
        parts = np.maximum(parts, _parts(solution.error))
    parts = _parts_where_exceeded(certificate.crossings, ends, parts)
    small = [c for c in certificate.crossings if EXCESS / 10.0 < c.share <= LARGE]
    drawn = (*now.crossings, *(replace(c, share=TIGHTER * c.share) for c in small))
    return _Step(arcs, _divided(ends, parts), from_solution(solution, SAMPLES), drawn)


def _parts_where_exceeded(crossings: tuple[Crossing, ...], ends: Array, parts: Array) -> Array:
    """Return into how many parts elements are divided, at least three where a state limit is exceeded inside."""
    for crossing in crossings:
        inside = (ends[1:] > crossing.start) & (ends[:-1] < crossing.end) & (crossing.share > LARGE)
        parts = np.where(inside, np.maximum(parts, 3), parts)
    return parts


def _parts(error: Array) -> Array:
    """Return into how many parts elements are divided for their local error (N,)."""
    return np.asarray(np.clip(np.ceil((error / FINE) ** 0.2), 1.0, PARTS).astype(int))


def _divided(ends: Array, parts: Array) -> Array:
    """Return the ends of elements, each divided into equal parts, fewer ones if there are too many elements."""
    for most in range(int(np.max(parts)), 0, -1):
        some = np.minimum(parts, most)
        if np.sum(some) <= MOST_ELEMENTS:
            break
    widths = np.repeat(np.diff(ends) / some, some)
    return np.append(ends[0], ends[0] + np.cumsum(widths))


def _elements(arcs: tuple[Arc, ...], ends: Array) -> tuple[tuple[int, ...], Array]:
    """Return the number of elements of every arc and their widths as shares of it, cut where arcs begin."""
    counts, shares = [], []
    starts = starts_of(arcs)
    for a, b in pairwise(starts):
        least = LEAST * np.min(np.append(np.diff(ends)[(ends[1:] > a) & (ends[:-1] < b)], b - a))
        inner = ends[(ends > a + least) & (ends < b - least)]
        widths = np.diff(np.concatenate([[a], inner, [b]]))
        counts.append(len(widths))
        shares.append(widths / widths.sum())
    return tuple(counts), np.concatenate(shares)
