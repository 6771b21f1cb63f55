"""Structure carried over: the arcs of a polished solution, solved again for neighbouring parameters and limits."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ocp.arcprogramme import ArcProgramme, prepare_arcs
from ocp.arcs import ArcMotion, ArcProblem, arc_problem
from ocp.certificate import EXCESS, certify, complaint
from ocp.collocation import Control
from ocp.constraint import Where
from ocp.ipopt import Ipopt
from ocp.phases import from_solution
from ocp.polishing import RESIDUAL
from ocp.problem import Fixed, Problem
from ocp.revision import without_vanished
from ocp.solution import Solution, Status, Timings
from ocp.solver import same_structure
from ocp.structure import Arc, tabulate

Array = np.ndarray
# Near the answer from the start: limits that are not met hardly count, multipliers are estimated by least squares.
SETTINGS = Ipopt(
    tol=1e-10,
    max_iter=25,
    progress=False,
    extra={
        "mu_init": 1e-11,
        "bound_push": 1e-9,
        "bound_frac": 1e-9,
        "constr_mult_init_max": 1e8,
        "acceptable_iter": 0,
    },
)


@dataclass(frozen=True, eq=False)
class PreparedStructure:
    """A switching structure with its programme and its solver, to be solved for many parameter values and limits.

    Args:
        origin: the polished solution whose structure it is.
        programme: of its structure; None if it cannot be carried over.
        reason: why it cannot.
        setup: seconds.
    """

    origin: Solution
    programme: ArcProgramme | None
    reason: str
    setup: float

    def __call__(
        self,
        values: Mapping[str, float] | None = None,
        problem: Problem | None = None,
        guess: Solution | None = None,
    ) -> Solution:
        """Solve with this structure, and check that the structure is the right one.

        The answer is a function of the origin, the guess, the values and the problem: bit by bit the same elsewhere.

        Args:
            values: of parameters, by name; nominal where silent.
            problem: one that differs in limits, start and end values only.
            guess: a solution of the same structure to start from, such as the last one carried over; None: the origin.

        Returns:
            The motion with its `structure` if it is solved, the local error of the dynamics is as small as `polish`
            wants it, and the sign conditions hold; else one with structure None, a status that is not SOLVED, and the
            reason in its message. `timings` are those of this call alone.

        Raises:
            TypeError: a guess that is no Solution.
            ValueError: a problem of another structure, or a wrong parameter name.
        """
        begun = time.perf_counter()
        guess = self.origin if guess is None else guess
        if not isinstance(guess, Solution):
            raise TypeError(f"guess: got {guess!r}, expected a Solution")
        old = self._problem
        new = old if problem is None else same_structure(old, problem)
        numbers = tuple(new.system.values(values))
        reason = self.reason or _other_limits(old, new) or self._other_structure(guess)
        if reason or self.programme is None:
            return _refused(replace(guess, problem=new), reason)
        programme = self.programme.adapted(new, numbers)
        motion = programme.solve(programme.restart(guess), limited=False)
        found = replace(motion.solution(programme.task, self.origin), rung="structure carried over")
        found = replace(found, iterations=motion.answer.iterations, message=motion.answer.status.value)
        if not found.ok:
            reason = f"the arcs lead nowhere ({motion.answer.verbatim})"
        elif len(without_vanished(motion.arcs)) < len(motion.arcs):
            reason = "an arc vanishes"
        else:
            certificate, residual = certify(programme.task, motion), float(np.max(found.error))
            if not certificate.sound:
                reason = complaint(programme.task, certificate)
            elif beyond := _beyond(programme.task, motion):
                reason = beyond
            elif residual > RESIDUAL:
                reason = f"the local error of the dynamics is {residual:.1e}, more elements are needed"
            else:
                structure = tabulate(new, programme.task.limits, motion.arcs)
                words = (
                    f"{len(motion.arcs)} arcs carried over, sign conditions open by {certificate.gap:.1e} of the cost"
                )
                found = replace(found, structure=structure, message=f"{found.message}; {words}")
        total, inside = time.perf_counter() - begun, motion.answer.derivatives
        timings = Timings(total - motion.answer.seconds, inside, motion.answer.seconds - inside, total)
        found = replace(found, timings=timings)
        return _refused(found, reason) if reason else found

    @property
    def _problem(self) -> Problem:
        assert self.origin.problem is not None
        return self.origin.problem

    def _other_structure(self, guess: Solution) -> str:
        """Return the reason if a guess does not have the structure and the elements of the origin."""
        origin = self.origin
        if guess.structure is None or _key(guess) != _key(origin):
            return "the guess has another structure"
        if (
            guess.scheme != origin.scheme
            or guess.states.shape != origin.states.shape
            or _elements(guess) != _elements(origin)
        ):
            return "the guess has other elements"
        return ""


def prepare_structure(polished: Solution, solver: Ipopt | None = None) -> PreparedStructure:
    """Transcribe the problem of a polished solution for its structure and build its solver, for many neighbours.

    Args:
        polished: with its `structure`, by `polish` or carried over, loaded or not.
        solver: settings of IPOPT.

    Raises:
        TypeError: no Solution.
        ValueError: a solution without structure, or loaded without its problem.
    """
    begun = time.perf_counter()
    if not isinstance(polished, Solution):
        raise TypeError(f"prepare_structure: got {polished!r}, expected a polished Solution")
    if polished.problem is None:
        raise ValueError("prepare_structure: this solution was loaded without its model; use load(path, problem=...)")
    if polished.structure is None or polished.scheme.control is not Control.COLLOCATED:
        raise ValueError("prepare_structure: this solution has no structure, expected one that polish returned with it")
    task = arc_problem(polished.problem, polished.scheme, polished.values)
    arcs = polished.structure.arcs
    reason = _unfit(task, polished, arcs)
    programme = None
    if not reason:
        settings = SETTINGS if solver is None else solver
        programme = prepare_arcs(task, arcs, _elements(polished), from_solution(polished), settings)
    return PreparedStructure(polished, programme, reason, time.perf_counter() - begun)


def _unfit(task: ArcProblem, polished: Solution, arcs: tuple[Arc, ...]) -> str:
    """Return why a structure cannot be carried over, or nothing."""
    if not polished.ok:
        return "it is not a solved one"
    if task.loose(arcs):
        return "its singular arcs need a price that is iterated away; polish does that"
    return ""


def _elements(solution: Solution) -> tuple[int, ...]:
    """Return the number of elements of each arc."""
    assert solution.structure is not None
    ends = np.cumsum([arc.duration for arc in solution.structure.arcs])
    middle = (solution.grid.ends[:-1] + solution.grid.ends[1:]) / 2.0
    return tuple(np.bincount(np.searchsorted(ends / ends[-1], middle), minlength=len(ends)).tolist())


def _key(solution: Solution) -> tuple[object, ...]:
    assert solution.structure is not None
    return tuple((arc.kinds, arc.held, arc.touched) for arc in solution.structure.arcs)


def _other_limits(old: Problem, new: Problem) -> str:
    """Return the reason if a problem has limits or given values where the other has none."""
    for one, other in zip(old.subject_to, new.subject_to, strict=True):
        pairs = ((one.lower, other.lower), (one.upper, other.upper))
        if any(np.any(np.isfinite(a) != np.isfinite(b)) for a, b in pairs) or np.any(
            (one.lower == one.upper) != (other.lower == other.upper)
        ):
            return "a limit appears or vanishes"
    sides = [
        () if isinstance(p.horizon, Fixed) else (p.horizon.lower > 0.0, p.horizon.upper < np.inf) for p in (old, new)
    ]
    return "a limit of the duration appears or vanishes" if sides[0] != sides[1] else ""


def _beyond(task: ArcProblem, motion: ArcMotion) -> str:
    """Return the reason if a control between its limits is not."""
    system = task.problem.system
    low, high = task.problem.limits(Where.ALONG, system.u)
    size = np.where(
        np.isfinite(high - low), high - low, np.maximum(np.max(np.abs(motion.controls), axis=(0, 1)), 1e-300)
    )
    share = np.max(np.maximum(low - motion.controls, motion.controls - high), axis=(0, 1)) / size
    worst = int(np.argmax(share))
    if share[worst] <= EXCESS:
        return ""
    return f"{system.label('u', len(share))[worst].name} exceeds its limit by {share[worst]:.1e} of its range"


def _refused(solution: Solution, reason: str) -> Solution:
    status = Status.FAILED if solution.ok else solution.status
    return replace(solution, status=status, structure=None, message=f"{status.value}; not carried over: {reason}")
