"""The switching structure of a polished solution, solved again for neighbouring parameters and limits."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ocp import checks
from ocp.arcs.arc_nlp import ArcNlp, prepare_arcs
from ocp.arcs.arc_problems import ArcMotion, ArcProblem, arc_problem
from ocp.arcs.arcs import durations, elements_of, key_of
from ocp.arcs.optimality_check import EXCESS, certify, complaint
from ocp.arcs.revision import revise, swapped, without_vanished
from ocp.arcs.settling import RESIDUAL
from ocp.problem.constraints import Where
from ocp.problem.problem import Fixed, Problem, same_structure
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.structure import Arc
from ocp.solution.structure_table import tabulate
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt

REVISIONS = 3  # of a structure that turns out wrong
SHORTEST = 1e-6  # initial duration, share of the motion, of a new arc between two switches that are exchanged
KEPT = 16  # NLPs kept in memory
# The guess is close to the solution: a small barrier, and first multipliers by least squares.
SETTINGS = Ipopt(
    tol=1e-12,
    max_iter=25,
    progress=False,
    extra={
        "mu_init": 1e-11,
        "bound_push": 1e-9,
        "bound_frac": 1e-9,
        "constr_mult_init_max": 1e8,
        "acceptable_iter": 0,
        "mumps_permuting_scaling": 0,
    },
)


@dataclass(frozen=True, eq=False)
class PreparedStructure:
    """A switching structure to be solved for many parameter values and limits; made by `prepare_structure`.

    Args:
        origin: the polished solution that the structure comes from.
        task: its problem.
        settings: of IPOPT.
        nlps: NLPs of its structure and of the structures tried since.
        setup: seconds spent on preparing.
    """

    origin: Solution
    task: ArcProblem
    settings: Ipopt
    nlps: dict[object, ArcNlp]
    setup: float

    def __call__(
        self,
        values: Mapping[str, float] | None = None,
        problem: Problem | None = None,
        guess: Solution | None = None,
    ) -> Solution:
        """Solve with the structure of the guess, revise it where it is wrong, and check the sign conditions.

        The result depends on the origin, the guess, the values and the problem only, bit by bit.

        Args:
            values: of parameters, by name; nominal values for the others.
            problem: one that differs in limits, start and end values only; one whose system is another object with the
                same states, controls, parameters and constraints is transcribed anew.
            guess: a solution with its structure, such as the last one carried over; None: the origin.

        Returns:
            The motion with its `structure` if it is solved, the local error of the dynamics is within that of `polish`,
            and the sign conditions hold; else a motion with structure None, a status other than SOLVED, and the
            reason in its message. `timings` are those of this call alone.

        Raises:
            TypeError: a guess that is no Solution.
            ValueError: a problem of another structure, a guess of another system, or a wrong parameter name.
        """
        begun = time.perf_counter()
        guess = self.origin if guess is None else guess
        self._check(guess)
        checks.instance("problem", problem, Problem | None, "a Problem, or None for that of the origin")
        if problem is not None and _restated(self.task.problem, problem):
            return self._elsewhere(values, problem, guess)
        new = self.task.problem if problem is None else same_structure(self.task.problem, problem)
        numbers = tuple(new.system.values(values))
        reason = _other_limits(self.task.problem, new)
        if reason or guess.structure is None:
            return _refused(replace(guess, problem=new), reason or "the guess has no structure")
        arcs, seen, iterations, derivatives, solver = guess.structure.arcs, set[object](), 0, 0.0, 0.0
        elements, before = _elements(guess), guess
        while True:
            if self.task.loose(arcs):
                result, reason = before, "singular arcs need a penalty that is iterated away; polish does that"
                break
            nlp = self._nlp(arcs, elements).adapted(new, numbers)
            start = nlp.start(from_solution(before), durations(arcs)) if seen else nlp.restart(guess)
            motion = nlp.solve(start)
            seen.add(key_of(arcs))
            iterations += motion.result.iterations
            derivatives, solver = derivatives + motion.result.derivatives, solver + motion.result.seconds
            result = before = motion.solution(nlp.task, self.origin)
            reason, revised = _judged(nlp.task, motion, result)
            if not reason or key_of(revised) in seen or len(seen) > REVISIONS:
                break
            elements = elements if len(revised) == len(arcs) else elements_of(revised, _level(self.origin))
            arcs = revised
        total = time.perf_counter() - begun
        timings = Timings(total - solver, derivatives, solver - derivatives, total)
        result = replace(result, iterations=iterations, timings=timings, rung="structure carried over")
        if reason:
            return _refused(result, reason)
        summary = f"{len(motion.arcs)} arcs carried over" + (
            f", {len(seen) - 1} times revised" if len(seen) > 1 else ""
        )
        structure = tabulate(new, nlp.task.limits, motion.arcs)
        return replace(result, structure=structure, message=f"{result.status.value}; {summary}")

    def _check(self, guess: Solution) -> None:
        checks.instance("guess", guess, Solution, "a Solution, or None for the origin")
        sizes, expected = ((one.scheme, one.states.shape[2], one.controls.shape[2]) for one in (guess, self.origin))
        if sizes != expected:
            raise ValueError(f"guess: has (scheme, nx, nu) = {sizes}, the structure was prepared with {expected}")

    def _elsewhere(self, values: Mapping[str, float] | None, problem: Problem, guess: Solution) -> Solution:
        """Solve for a problem with a system of its own; its NLP is not kept."""
        there = prepare_structure(replace(self.origin, problem=problem), self.settings)
        orders = [[(k.constraint, k.component, k.order) for k in one.task.limits] for one in (self, there)]
        reason = _other_limits(self.task.problem, problem)
        if reason or orders[0] != orders[1]:
            return _refused(replace(guess, problem=problem), reason or "its state limits have another order")
        result = there(values, guess=guess)
        spent = result.timings
        spent = replace(spent, setup=spent.setup + there.setup, total=spent.total + there.setup)
        return replace(result, timings=spent)

    def _nlp(self, arcs: tuple[Arc, ...], elements: tuple[int, ...]) -> ArcNlp:
        """Return the NLP of a structure; it is scaled by the origin, whatever was solved before."""
        key = key_of(arcs), elements
        if key not in self.nlps:
            if len(self.nlps) >= KEPT:
                del self.nlps[next(iter(self.nlps))]
            scale = from_solution(self.origin)
            self.nlps[key] = prepare_arcs(self.task, arcs, elements, scale, self.settings, limited=False)
        return self.nlps[key]


def prepare_structure(polished: Solution, solver: Ipopt | None = None) -> PreparedStructure:
    """Transcribe the problem of a polished solution for its structure, to be solved for many neighbours.

    Args:
        polished: with its `structure`, by `polish` or carried over, loaded or not.
        solver: settings of IPOPT; it is called only where there are fewer equations than unknowns.

    Raises:
        TypeError: no Solution, or no settings.
        ValueError: a solution without structure, or loaded without its problem.
    """
    begun = time.perf_counter()
    if not isinstance(polished, Solution):
        shown = checks.shown(polished)
        raise TypeError(f"prepare_structure: polished is {shown}, expected a polished Solution")
    checks.instance("prepare_structure: solver", solver, Ipopt | None, "settings of the solver, Ipopt(...), or None")
    if polished.problem is None:
        raise ValueError("prepare_structure: this solution was loaded without its problem; use load(path, problem=...)")
    if polished.structure is None:
        raise ValueError("prepare_structure: this solution has no structure, expected one that polish returned with it")
    task = arc_problem(polished.problem, polished.scheme, polished.values)
    settings = SETTINGS if solver is None else solver
    prepared = PreparedStructure(polished, task, settings, {}, 0.0)
    arcs = polished.structure.arcs
    if not task.loose(arcs):
        prepared._nlp(arcs, _elements(polished))
    return replace(prepared, setup=time.perf_counter() - begun)


def _judged(task: ArcProblem, motion: ArcMotion, result: Solution) -> tuple[str, tuple[Arc, ...]]:
    """Return the reason why a motion is not the optimum, empty if it is, and the arcs to try next."""
    arcs, least = motion.arcs, SHORTEST * motion.duration
    if motion.result.status is not Status.SOLVED:
        return f"the NLP of these arcs is not solved ({motion.result.verbatim})", arcs
    if len(without_vanished(arcs)) < len(arcs):
        other = swapped(arcs)
        other = other if key_of(other) != key_of(arcs) else without_vanished(arcs)
        return "an arc vanishes", tuple(replace(arc, duration=max(arc.duration, least)) for arc in other)
    certificate = certify(task, motion)
    if not certificate.sound:
        return complaint(task, certificate), revise(motion, certificate, task.limits)
    residual = float(np.max(result.error))
    if residual > RESIDUAL:
        return f"the local error of the dynamics is {residual:.1e}, more elements are needed", arcs
    return _beyond(task, motion), arcs


def _elements(solution: Solution) -> tuple[int, ...]:
    """Return the number of elements of each arc."""
    assert solution.structure is not None
    ends = np.cumsum([arc.duration for arc in solution.structure.arcs])
    middle = (solution.grid.ends[:-1] + solution.grid.ends[1:]) / 2.0
    return tuple(np.bincount(np.searchsorted(ends / ends[-1], middle), minlength=len(ends)).tolist())


def _level(solution: Solution) -> int:
    """Return how often the elements of a solution have been halved."""
    assert solution.structure is not None
    plain = elements_of(solution.structure.arcs)
    return max(0, round(float(np.log2(len(solution.grid) / sum(plain)))))


def _restated(old: Problem, new: Problem) -> bool:
    """Return whether a problem has the same form for another system object with as many states and controls."""
    kinds = [
        (
            *(type(part) for part in (problem, problem.horizon)),
            *(symbols.numel() for symbols in (problem.system.x, problem.system.u)),
            list(problem.system.nominal),
            [(constraint.where, constraint.expression.numel()) for constraint in problem.subject_to],
        )
        for problem in (old, new)
    ]
    return old.system is not new.system and kinds[0] == kinds[1]


def _other_limits(old: Problem, new: Problem) -> str:
    """Return the reason if a problem has limits or fixed values where the other has none; else empty."""
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
    """Return the reason if a control leaves its bounds on an arc where it should lie between them; else empty."""
    system = task.problem.system
    low, high = task.problem.limits(Where.ALONG, system.u)
    scale = np.where(
        np.isfinite(high - low), high - low, np.maximum(np.max(np.abs(motion.controls), axis=(0, 1)), 1e-300)
    )
    share = np.max(np.maximum(low - motion.controls, motion.controls - high), axis=(0, 1)) / scale
    worst = int(np.argmax(share))
    if share[worst] <= EXCESS:
        return ""
    return f"{system.label('u', len(share))[worst].name} exceeds its limit by {share[worst]:.1e} of its range"


def _refused(solution: Solution, reason: str) -> Solution:
    status = Status.FAILED if solution.ok else solution.status
    return replace(solution, status=status, structure=None, message=f"{status.value}; not carried over: {reason}")
