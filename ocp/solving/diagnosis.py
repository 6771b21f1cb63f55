"""Messages for a failed solve: which constraints are violated, where and by how much, and what to try."""

from __future__ import annotations

import numpy as np

from ocp.numerics.arrays import largest_of_unit
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import rates
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.nonsmooth import kinks
from ocp.problem.problem import Fixed, Free, Problem
from ocp.solution.integration_drift import collapsed, drift
from ocp.solution.solution import Solution, Status
from ocp.solution.violations import between_points, excess, touched
from ocp.solving.prechecks import _labels, warnings_before

NOTICEABLE = 1e-6  # violation, relative to the range, from which on a constraint is reported
SHRUNK = 1e-9  # a duration within this share of the guessed one from its lower bound counts as at the bound
NAMED = 3  # violated constraints in a message at most
FEW = 3  # with fewer values of each control, a motion between given ends may be impossible


def explain(solutions: list[Solution], values: list[list[float]]) -> list[str]:
    """Return sentences about a failed solve: the worst violations of its last iterate, and what to try."""
    status = solutions[0].status
    results: list[tuple[float, str]] = []
    for number, solution in enumerate(solutions):
        phase = f" in phase {number + 1}" if len(solutions) > 1 else ""
        results += _worst(solution, phase)
    results.sort(key=lambda pair: -pair[0])
    if any(map(collapsed, solutions)):
        which = [str(k) for k, one in enumerate(solutions, 1) if collapsed(one)]
        if len(solutions) > 1:
            return [
                f"the duration of phase {', '.join(which)} collapsed: no motion; leave out a phase that begins and "
                "ends at the same point, or give it a lower limit, Free(guess, lower=...)"
            ]
        return [
            f"the duration collapsed to {min(s.duration for s in solutions):.2g} s though start and goal differ: "
            "no motion; give it a lower limit, Free(guess, lower=...), or limit the states"
        ]
    sentences = [*touched(solutions), *(words for _, words in results[:NAMED])]
    if min(len(s.controls) * s.controls.shape[1] for s in solutions) < FEW:
        sentences.append("so few values of each control hardly lead anywhere; try a grid of ten elements or more")
    if status is Status.LIMIT:
        sentences += [words for solution in solutions for words in _shrinking(solution)]
    problems = [solution.problem for solution in solutions if solution.problem is not None]
    for problem, numbers in zip(problems, values, strict=True):
        sentences += warnings_before(problem, [numbers])
    for problem in problems:
        sentences += _kinked(problem)
    if solutions[0].rung == "given guess":
        sentences.append("without a guess, the default ladder makes its own")
    return sentences + _remedies(status, problems, bool(results))


def in_words(status: Status, reasons: list[str]) -> str:
    """Return the message of a solution: its status and the sentences of `explain` or `remarks`."""
    return f"{status.value}: {'; '.join(reasons)}" if reasons else status.value


def _kinked(problem: Problem) -> list[str]:
    """Return a sentence about functions without a derivative somewhere; Newton's method stops at such points."""
    result = kinks(problem)
    if not result:
        return []
    named = ", ".join(f"{name} ({function})" for name, function in result[:NAMED])
    return [
        f"{named} has no derivative everywhere, where the solver may stop; state |e| and max(e, 0) by "
        "ocp.absolute and ocp.positive_part, which are exact, and other jumps by a smooth function"
    ]


def remarks(solutions: list[Solution]) -> list[str]:
    """Return warnings for a solved problem: a coarse grid, a duration at its bound, controls beyond their bounds."""
    results = []
    for solution in solutions:
        results += unresolved(solution) + between_points(solution) + wandering(solution)
        horizon = solution.problem.horizon if solution.problem is not None else None
        if isinstance(horizon, Free) and solution.duration <= horizon.lower + SHRUNK * horizon.guess:
            results.append(
                f"the duration is at its lower limit of {horizon.lower:g} s; start and goal coincide, or nothing "
                "keeps the motion from being that short"
            )
    return results


def _worst(solution: Solution, phase: str) -> list[tuple[float, str]]:
    problem = solution.problem
    if problem is None or not np.all(np.isfinite(solution.states)) or solution.duration <= 0.0:
        return []
    results = []
    for share, figure in excess(solution, problem):
        if share > NOTICEABLE:
            kind = {"start limit": "misses its start value", "end limit": "misses its end value"}
            words = kind.get(figure.scale, "is beyond its limit")
            results.append(
                (share, f"{figure.what} {words} by {float(figure):.3g} {figure.unit} at t = {figure.at:.4g} s{phase}")
            )
    system = problem.system
    t, x, rate, u = solution.samples(solution.scheme.points)
    left = np.abs(rate - evaluate(rates(system), x, u, solution.parameters)[0]) * solution.duration
    left[~np.isfinite(left)] = np.inf
    size = np.max(np.abs(x), axis=0)
    size = np.maximum(size, max(1e-9 * float(np.max(size)), 1e-300))
    k, i = np.unravel_index(np.argmax(left / size), left.shape)
    if left[k, i] / size[i] > NOTICEABLE:
        label = system.label("x", x.shape[1])[i]
        amount = left[k, i] / solution.duration
        unit = f"{label.unit}/s" if label.unit else "per s"
        results.append(
            (
                left[k, i] / size[i],
                f"the motion breaks d{label.name}/dt = f by {amount:.3g} {unit} at t = {t[k]:.4g} s{phase}",
            )
        )
    return results


def _shrinking(solution: Solution) -> list[str]:
    """Return a sentence about controls without bounds that let a minimum-time motion become arbitrarily short."""
    problem = solution.problem
    if problem is None or not isinstance(problem.horizon, Free) or problem.minimise.time <= 0.0:
        return []
    low, high = problem.limits(Where.ALONG, problem.system.u)
    labels = _labels(problem, "u", problem.system.u)
    endless = [one.name for one, a, b in zip(labels, low, high, strict=True) if not np.isfinite(b - a)]
    if not endless or solution.duration > 1e-3 * problem.horizon.guess:
        return []
    return [
        f"{', '.join(endless)} without limits let the motion be as short as it likes, {solution.duration:.2g} s so "
        "far; limit them, or give the duration a lower limit"
    ]


def _remedies(status: Status, problems: list[Problem], violated: bool) -> list[str]:
    if status is Status.UNBOUNDED:
        return [
            "try an upper limit of the duration, Free(guess, upper=...), limits on the states, or a cost bounded below"
        ]
    if status is Status.INFEASIBLE:
        if any(isinstance(problem.horizon, Fixed) for problem in problems):
            return ["try a longer duration: with Free() and minimise time the same limits show the shortest one"]
        return ["try wider limits, or a guess nearer to a feasible motion"]
    if status is Status.LIMIT:
        free = any(isinstance(problem.horizon, Free) for problem in problems)
        return [
            "try more iterations (Ipopt(max_iter=...)), a coarser grid first"
            + (", or a better guess of the duration" if free else "")
        ]
    return ["try another guess or a coarser grid"] if violated else []


RESOLVED = 1e-6  # drift relative to the largest value of the state, as in `verify`
LOOK = 1  # Gauss points of the re-integration beyond the degree: a warning needs one digit
LEAST = 1e-3  # smallest scale of a state in that comparison, relative to the largest state of the same unit


def unresolved(solution: Solution) -> list[str]:
    """Return a warning if the grid is too coarse: integrated with its own controls, the motion drifts away.

    The NLP satisfies x' = f(x, u) at the collocation points only. On a coarse grid, or where the motion is unstable,
    a solution that meets every tolerance of the NLP may therefore be no motion of the system.

    Args:
        solution: with status SOLVED.
    """
    problem = solution.problem
    if problem is None or solution.duration <= 0.0 or not np.all(np.isfinite(solution.data)):
        return []
    with np.errstate(all="ignore"):
        try:
            away = np.abs(drift(solution, problem, LOOK))
        except np.linalg.LinAlgError:
            away = np.full((len(solution.grid) + 1, solution.states.shape[2]), np.inf)
        largest = np.max(np.abs(solution.states), axis=(0, 1))
        labels = problem.system.label("x", len(largest))
        scale = np.maximum(largest, LEAST * largest_of_unit(largest, [label.unit for label in labels]))
        share = away / np.where(scale > 0.0, scale, 1.0)
    share[~np.isfinite(share)] = np.inf
    k, i = np.unravel_index(np.argmax(share), share.shape)
    if not share[k, i] > RESOLVED:
        return []
    return [
        f"the grid does not resolve the motion: integrated with these controls, {labels[i].name} leaves it by about "
        f"{share[k, i]:.1e} of its largest value at t = {solution.nodes[k]:.4g} s; "
        "resolved(solution), a finer grid or solve_to_accuracy cures it, and a motion that is unstable without "
        "feedback needs one most"
    ]


MANY = 150  # iterations from which on controls that the cost leaves open are the probable reason


def wandering(solution: Solution) -> list[str]:
    """Return a sentence if a solve of minimum time with several limited controls took many iterations.

    While one drive sets the time, the others may have infinitely many optimal controls, among which the solver wanders.

    Args:
        solution: with status SOLVED.
    """
    problem = solution.problem
    if problem is None or solution.iterations < MANY or not problem.minimise.time > 0.0:
        return []
    limits = np.array(problem.limits(Where.ALONG, problem.system.u))
    if limits.shape[1] < 2 or not np.all(np.isfinite(limits)) or not hamiltonian_of(problem).curvature.is_zero():
        return []
    return [
        f"it took {solution.iterations} iterations, as a rule because the cost leaves controls open: "
        "gentle(problem) determines them by a small cost on effort and is solved in fewer"
    ]
