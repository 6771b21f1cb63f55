"""Polishing: switching times become unknowns, so that no switch lies inside an element."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from ocp import checks
from ocp.arcs.arc_problems import ArcProblem, arc_problem
from ocp.arcs.control_limits import curved_limit
from ocp.arcs.detection import read
from ocp.arcs.gentle_arcs import ELSEWHERE, EXCESS, settle_gently
from ocp.arcs.least_effort import gentlest, slack, with_effort, without_effort
from ocp.arcs.moving_grid import SETTINGS as MOVING
from ocp.arcs.moving_grid import move_grid
from ocp.arcs.settling import LARGEST, RESIDUAL, Attempt, Budget, settle
from ocp.arcs.switching import switching_functions
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.solution.attached_problem import with_problem
from ocp.solution.parallel_solution import in_phases
from ocp.solution.sequence_solution import Motion, SequenceSolution
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.structure_table import tabulate
from ocp.solution.violations import between_points
from ocp.solving.ipopt import Ipopt
from ocp.solving.solver import solve
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

SETTINGS = Ipopt(tol=1e-10, max_iter=60, progress=None, extra={"mu_init": 1e-6, "acceptable_iter": 0})
SECONDS = 9.0  # of processor time after which no further structure is tried
FEW = 30  # iterations on the structure read from the given grid; where it is right, fewer are enough
LAST = 0.5  # seconds left, below which no further grid is moved
MOST = 60  # elements of a moved grid
MANY = 14  # arcs that are not read from the given grid, where only time counts
FIRST = 0.3  # of the seconds, given to the structure read from the given grid, where only time counts
SPENT = 0.97  # of the seconds, after which nothing is begun
LEAST = 1e-3  # seconds at least
PART, REST = 0.3, 0.95  # of the seconds left, given to the structures read from a moved grid
KEPT, EFFORT_SOLVES = 0.15, 2.0  # share of the seconds, and solves as long as the given one, kept for least effort
DEARER = 1e-5  # share of the cost that least effort may cost
EFFORT = 1e-4  # small cost on effort that makes undetermined controls smooth, share of the cost


def polish(
    solution: Motion, problem: Problem | Sequence | None = None, scheme: Scheme | None = None,
    solver: Ipopt | None = None, *, seconds: float = SECONDS,
) -> Motion:  # fmt: skip
    """Solve again with the durations of the arcs as unknowns, controls at their limits pinned.

    The arcs (each control at its lower or upper limit, interior, or holding a state limit) are read from controls,
    switching functions and state limits. On an arc where a limit c <= c_max of order r holds, c^(r) = 0 determines its
    control, with c = c_max, c' = ... = 0 at the entry; a touch has c = c_max, c' = 0 at one instant. Then arcs that
    vanish are dropped, contacts with a multiplier of the wrong sign released, contacts added where a limit is exceeded
    or presses on the motion, and arcs inserted where a switching function has the wrong sign, until nothing is wrong.
    If that fails, or if there are controls between their bounds that the cost does not determine, the structure is read
    again from a grid whose widths are unknowns, with a small cost on effort that makes such controls smooth. There only
    what stays at a bound on whole elements is fixed, and state limits are inequalities, until little is left to gain.
    Where little or nothing is left to choose, the last steps are those of Newton's iteration on the equations alone, as
    the barrier of limits that the motion only comes near moves its switches by 1e-8 of the duration.

    Interior arcs of controls that enter the Hamiltonian linearly are singular: a penalty on the distance from the last
    iterate keeps them from chattering and is iterated away (proximal point); the message gives its final value.

    Args:
        solution: solved, of a Problem or a Sequence, whose phases are polished together.
        problem: needed only for a solution loaded without it.
        scheme: with collocated control, default legendre(6, control=Control.COLLOCATED). A motion with controls that
            the cost hardly determines may come back with legendre(4, control=Control.SEGMENTS), linear on each element.
        solver: settings of IPOPT.
        seconds: of processor time, after which no further structure is tried.

    Returns:
        The polished solution with its `structure`; it counts only if it is solved, confirms or improves the cost, and
        meets the sign conditions. Else a solution with structure None and the reason in its message: on a grid moved to
        the switches if that has a lower cost and keeps its limits, or the given one; controls that minimum time leaves
        open are those of least effort then.
        `timings` are those of polishing alone: derivatives and solver of its last solve, set-up for all before it.

    Raises:
        TypeError: no Solution, or a scheme whose control is not collocated.
        ValueError: a solution loaded without its problem.

    Source: Kaya, Noakes, Computational method for time-optimal switching control, J. Optim. Theory Appl. 117, 2003;
        Hartl, Sethi, Vickson, SIAM Review 37, 1995; Rockafellar, Monotone operators and the proximal point algorithm,
        SIAM J. Control Optim. 14, 1976.
    """
    begun = time.perf_counter()
    if isinstance(solution, SequenceSolution):
        return in_phases("polish", solution, problem, lambda one: polish(one, None, scheme, solver, seconds=seconds))
    solution, problem = with_problem("polish", solution, problem)
    checks.instance("polish: solver", solver, Ipopt | None, "settings of the solver, Ipopt(...), or None")
    scheme = legendre(6, Control.COLLOCATED) if scheme is None else scheme
    if not isinstance(scheme, Scheme) or scheme.control is not Control.COLLOCATED:
        shown = checks.shown(scheme)
        raise TypeError(f"polish: scheme is {shown}, expected one with control=Control.COLLOCATED")
    if scheme.slope_at_start:
        raise TypeError(f"polish: scheme is {scheme!r}, expected radau or legendre")
    checks.number("polish: seconds", seconds, "a number of seconds > 0, or inf", above=0.0, finite=False)
    settings = SETTINGS if solver is None else solver
    if not solution.ok:
        return _unpolished(solution, "it is not a solved one")
    if solution.duration <= 0.0:
        return _unpolished(solution, "it has no duration")
    task = arc_problem(problem, scheme, solution.values)
    allowed, iterations, reason = solution.cost + _doubt(problem, solution), 0, ""
    open_controls = slack(problem, solution) if _timed(problem) else ""
    kept = min(KEPT * seconds, EFFORT_SOLVES * solution.timings.total) if open_controls else 0.0
    whole = Budget(seconds, sys.stderr.isatty() if settings.progress is None else settings.progress)
    budget = replace(whole, seconds=SPENT * seconds - kept)
    latest, near, curved = solution, solution, curved_limit(problem)
    if curved:
        reason = f"{curved} is curved in several controls; arcs are those of controls at bounds and of linear limits"
    for motion, tried in () if curved else _attempts(task, solution, settings, budget):
        latest, reason = motion, tried.reason or reason
        iterations += tried.iterations
        better = solution if tried.cheaper is None else _better(solution, tried.cheaper, whole)
        if better is not solution:
            result = polish(better, problem, scheme, solver, seconds=max(whole.left, LEAST))
            return _from_better(result, better, solution, (iterations, time.perf_counter() - begun))
        if tried.motion is None or tried.certificate is None:
            continue
        cost = tried.motion.result.cost - tried.motion.penalty
        found = tried.motion.solution(tried.task, solution)
        loose, residual = between_points(found), float(np.max(found.error))
        if residual > LARGEST:
            loose.insert(0, f"the local error of the dynamics is {residual:.1e}, more elements are needed")
        if cost > allowed:
            reason = f"the structure read leads to a cost of {cost:.9g}, more than {solution.cost:.9g}"
        elif loose:
            reason = loose[0]
        elif tried.reason:
            near = found
        else:
            budget.show("")
            result = _polished(solution, tried, (iterations, time.perf_counter() - begun))
            left = slack(problem, result) if open_controls and tried.task.loose(tried.motion.arcs) else ""
            return replace(result, message=f"{result.message}{_eased(left)}")
    if budget.left <= 0.0:
        reason = f"{reason or 'no structure found'} (within {seconds:.3g} s)"
    if near is not solution and near.cost < solution.cost:
        budget.show("")
        return _unpolished(_with_gain(near, solution), f"{reason}{_eased(open_controls)}")
    result = _on_moved_grid(solution, latest, problem, budget)
    if open_controls:
        result, words = _with_least_effort(result, problem, whole)
        reason = f"{reason}; {open_controls}{words}"
    budget.show("")
    return _unpolished(result, reason)


def _with_least_effort(result: Solution, problem: Problem, budget: Budget) -> tuple[Solution, str]:
    """Return a motion in which controls that the cost leaves open take the least effort, and what to say of them."""
    budget.show("no structure found, least effort")
    settings = Ipopt(progress=False, max_seconds=max(budget.left, LAST))
    eased = gentlest(result, problem, solver=settings)
    dearer = (eased.cost - result.cost) / max(abs(result.cost), 1e-300)
    if eased.message == result.message or not eased.message.endswith("gentlest") or dearer > DEARER:
        return result, "; gentlest(...) does"
    words = f"; it is that of least effort here, at {max(dearer, 0.0):.1e} of the cost"
    return replace(eased, message=result.message), words


def _better(solution: Solution, guess: Solution, budget: Budget) -> Solution:
    """Return a local optimum of much lower cost than that of a solution, found from a guess; else the solution."""
    if budget.left <= 0.0:
        return solution
    budget.show("a better local optimum")
    settings = budget.limited(Ipopt(progress=False))
    assert solution.problem is not None
    found = solve(solution.problem, solution.scheme, solution.grid, settings, guess, solution.values)
    return found if found.ok and found.cost < solution.cost - ELSEWHERE / 2.0 * abs(solution.cost) else solution


def _from_better(result: Solution, better: Solution, given: Solution, spent: tuple[int, float]) -> Solution:
    """Return what became of a better local optimum, with the work before it and what to say of it."""
    gain, (iterations, seconds) = (given.cost - better.cost) / max(abs(given.cost), 1e-300), spent
    words = f"; the given motion was no local optimum, that near it has a cost lower by {gain:.1e}"
    iterations += better.iterations + (result.iterations if result.structure is not None else 0)
    timings = replace(result.timings, setup=seconds - result.timings.total + result.timings.setup, total=seconds)
    return replace(result, message=f"{result.message}{words}", iterations=iterations, timings=timings)


def _eased(open_controls: str) -> str:
    return f"; {open_controls}; these are kept near those of least effort" if open_controls else ""


def _attempts(
    task: ArcProblem, solution: Solution, settings: Ipopt, budget: Budget
) -> Iterator[tuple[Solution, Attempt]]:
    """Yield motions and what becomes of the structures read from them: the given one, then one on a moved grid."""
    problem, timed = task.problem, _timed(task.problem)
    arcs = read(problem, solution, task.limits)
    # Where only time counts, controls between their bounds are slack as a rule, and arbitrary in the given motion.
    if not timed:
        yield solution, settle(task, solution, arcs, settings, budget)
    elif not task.loose(arcs) and len(arcs) <= MANY:
        given = replace(settings, max_iter=min(settings.max_iter, FEW))
        yield solution, settle(task, solution, arcs, given, budget.part(FIRST), again=False)
    if budget.left <= 0.0:
        return
    budget.show("moving the grid")
    eased = with_effort(problem, solution, EFFORT)
    ends = solution.grid.ends
    shares = np.linspace(0.0, 1.0, min(len(ends) - 1, MOST) + 1)
    grid = Grid(np.interp(shares, np.linspace(0.0, 1.0, len(ends)), ends))
    moved = move_grid(solution, eased, legendre(4, Control.SEGMENTS), grid, budget.limited(MOVING))
    if moved.status not in (Status.SOLVED, Status.ACCEPTABLE, Status.LIMIT):
        return
    moved = without_effort(moved, problem)
    sharp = read(problem, moved, task.limits, sharp=True)
    if not task.loose(sharp):
        yield moved, settle(task, moved, sharp, settings, budget.part(PART), again=False)
    yield moved, settle_gently(task, moved, settings, budget.part(REST))


def _on_moved_grid(solution: Solution, coarse: Solution, problem: Problem, budget: Budget) -> Solution:
    """Return the motion with constant controls on a moved grid if it is better and keeps its limits; else the given.

    `ocp.estimate` gives the error of its cost.
    """
    moved = coarse
    if budget.left > LAST:
        budget.show("no structure found, moving the grid")
        moved = move_grid(coarse, problem, radau(4), solver=budget.limited(MOVING))
    found = moved.status is Status.SOLVED and moved.scheme.control is Control.CONSTANT and moved is not solution
    if not found or moved.cost > solution.cost or between_points(moved):
        return solution
    return _with_gain(moved, solution)


def _with_gain(moved: Solution, given: Solution) -> Solution:
    gain = (given.cost - moved.cost) / max(abs(given.cost), 1e-300)
    return replace(moved, message=f"{Status.SOLVED.value}; grid moved to the switches, cost lower by {gain:.1e}")


def _timed(problem: Problem) -> bool:
    """Return whether only time counts."""
    cost, states = problem.minimise, problem.system.x
    return cost.running.is_zero() and not any(ca.depends_on(part, states) for part in (cost.final, cost.initial))


def _doubt(problem: Problem, solution: Solution) -> float:
    """Return by how much the cost of a solution may be too low, to first order."""
    _, x, _, u = solution.samples(solution.scheme.points)
    costates = solution.costates.reshape(len(x), -1)
    result = switching_functions(problem, x, u, costates, solution.parameters)
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    return float(weights @ result.gains.sum(axis=1)) + 1e-6 * abs(solution.cost)


def _polished(given: Solution, tried: Attempt, spent: tuple[int, float]) -> Solution:
    motion, certificate, task = tried.motion, tried.certificate, tried.task
    assert motion is not None
    assert certificate is not None
    iterations, seconds = spent
    result = motion.solution(task, given)
    summary = f"polished: {len(motion.arcs)} arcs, sign conditions open by {certificate.gap:.1e} of the cost"
    excess = max((crossing.share for crossing in certificate.crossings), default=0.0)
    if excess > EXCESS:
        summary += f", state limits exceeded by up to {excess:.1e} of their range between points"
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
    message = solution.message.replace("polished: ", "solved arc by arc: ")
    return replace(solution, structure=None, message=f"{message}; not polished: {reason}")
