"""Gentlest motion among the best ones: controls that the cost does not determine take the least effort."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ocp import checks
from ocp.arcs.control_limits import sides_of
from ocp.arcs.limit_arcs import contacts
from ocp.arcs.switching import switching_functions
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Bolza, Problem
from ocp.problem.sequence import Sequence
from ocp.problem.state_constraints import state_limits
from ocp.solution.attached_problem import with_problem
from ocp.solution.parallel_solution import in_phases
from ocp.solution.sequence_solution import Motion, SequenceSolution
from ocp.solution.solution import Solution
from ocp.solving.ipopt import Ipopt
from ocp.solving.solver import solve

WEIGHT = 1e-4  # of the effort of all controls at their limits, share of the cost
GENTLE = 1e-2  # the same where few iterations matter more
NAMED = 0.05  # share of the motion from which it is named: switches take some of it
LOOSE = 0.1  # length of the share of a control that no limit holds, from which it is open
SLACK, INSIDE = 1e-2, 0.98  # shares: a switching function below that of its scale vanishes, a control of its limit


def gentlest(
    solution: Motion, problem: Problem | Sequence | None = None, weight: float = WEIGHT, solver: Ipopt | None = None
) -> Motion:
    """Solve again with a small cost on effort, so that drives with slack move smoothly instead of arbitrarily.

    J + weight J* / T* integral of sum_i (u_i / limit_i)^2 dt, J* and T* those of the given solution,

    over the limited controls that enter the Hamiltonian linearly, or the limited expressions of those without bounds.
    While one drive of a machine sets the time, the others have infinitely many optimal controls; the effort picks the
    smooth one. The cost J rises by at most weight times the share of the effort that is saved, and no motion of that J
    has less effort: a solve with the duration held there has the same result, but takes more iterations.

    Args:
        solution: solved, of a Problem or a Sequence.
        problem: needed only for a solution loaded without it.
        weight: of the effort, share of the cost.
        solver: settings of IPOPT.

    Returns:
        The motion on the same grid with the same scheme; `cost` is J without the effort, and `problem` the given one.
        If it cannot be solved, the given solution with the reason in its message.

    Raises:
        TypeError: no Solution.
        ValueError: a solution loaded without its problem, or a weight that is not > 0.
    """
    if isinstance(solution, SequenceSolution):
        return in_phases("gentlest", solution, problem, lambda one: gentlest(one, None, weight, solver))
    solution, problem = with_problem("gentlest", solution, problem)
    checks.number("gentlest: weight", weight, "a number > 0", above=0.0)
    checks.instance("gentlest: solver", solver, Ipopt | None, "settings of the solver, Ipopt(...), or None")
    if not solution.ok or solution.duration <= 0.0:
        return replace(solution, message=f"{solution.message}; not made gentler: it is not a solved motion")
    eased = with_effort(problem, solution, weight)
    if eased is problem:
        return replace(solution, message=f"{solution.message}; not made gentler: the cost determines all controls")
    settings = Ipopt(progress=False) if solver is None else solver
    result = solve(eased, solution.scheme, solution.grid, settings, solution, solution.values)
    if not result.ok:
        return replace(solution, message=f"{solution.message}; not made gentler: {result.message}")
    return replace(without_effort(result, problem), message=f"{result.message}; gentlest")


def gentle(problem: Problem, weight: float = GENTLE) -> Problem:
    """Return a problem of minimum time with a small cost on effort, which determines controls with slack.

    c T + weight c integral of mean_i (u_i / limit_i)^2 dt, c the weight of the time,

    over the limited controls that enter the Hamiltonian linearly, or the limited expressions of those without bounds.
    While one drive of a machine sets the time, the others have infinitely many optimal controls, among which a solver
    wanders: with many axes and speed limits this problem takes a fraction of the iterations. The duration rises by at
    most weight times the share of the effort that is saved.

    Args:
        problem: with a cost on the duration.
        weight: of the effort of all controls at their limits, in seconds per second.

    Raises:
        TypeError: no Problem.
        ValueError: the cost has no weight of the duration, no control is undetermined, or weight is not > 0.
    """
    checks.instance("gentle: problem", problem, Problem, "a Problem")
    checks.number("gentle: weight", weight, "a number > 0", above=0.0)
    cost = problem.minimise
    if not cost.time > 0.0:
        raise ValueError("gentle: the cost has no weight of the duration, expected a problem such as minimum time")
    shares = effort_shares(problem)
    if not shares.numel():
        raise ValueError("gentle: the cost determines all limited controls already; solve the problem as it is")
    effort = ca.sumsqr(shares) / shares.numel()
    return replace(problem, minimise=replace(cost, running=cost.running + weight * cost.time * effort))


def slack(problem: Problem, solution: Solution) -> str:
    """Return a sentence on controls that the cost does not determine for a part of the motion; empty if there are none.

    Such a control is between its limits while its switching function vanishes, and holds no limit; one without bounds
    is open while the limits that are met, of expressions and states, do not determine it.
    """
    _, x, _, u = solution.samples(solution.scheme.points)
    functions = switching_functions(problem, x, u, solution.costates.reshape(len(x), -1), solution.parameters)
    weights = (solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    low, high = sides_of(problem, x, u, solution.parameters)
    limit = scales(problem)
    margin = (1.0 - INSIDE) * np.where(np.isfinite(limit), limit, 0.0)
    loose = (np.abs(functions.shares) < SLACK) & (u > low + margin) & (u < high - margin)
    loose &= ~_holding(problem, solution, u.shape)
    labels = problem.system.label("u", u.shape[1])
    parts = [(float(weights @ loose[:, i]), labels[i].name) for i in undetermined(problem)]
    parts += _free_controls(problem, x, u, weights, solution.parameters)
    named = [f"{name} ({share:.0%})" for share, name in sorted(parts, reverse=True) if share > NAMED]
    if not named:
        return ""
    return f"the cost does not determine {', '.join(named)} of the motion"


def _free_controls(problem: Problem, x: Array, u: Array, weights: Array, p: Array) -> list[tuple[float, str]]:
    """Return share of the motion and name of the controls without bounds that the limits met leave open, at K points.

    Every limit that is met holds a combination of controls, the gradient of its first derivative that depends on them;
    a control is open if it can change along all of these.
    """
    system, limits, free = problem.system, state_limits(problem), _undetermined_by_bounds(problem)
    if not free or not limits:
        return []
    values, last = (ca.vertcat(*(one.chain[k] for one in limits)) for k in (0, -1))
    outputs = [ca.densify(values), ca.densify(ca.jacobian(last, system.u).T)]
    function = ca.Function("limits", [system.x, system.u, system.p], outputs)
    reached, slopes = evaluate(function, x, u, p)
    low, high, margin = np.array([(one.lower, one.upper, (1.0 - INSIDE) / 2.0 * one.range) for one in limits]).T
    met = (reached <= low + margin) | (reached >= high - margin)
    rows = slopes.reshape(*met.shape, -1)
    rows = rows / np.maximum(np.max(np.abs(rows), axis=(0, 2)), 1e-300)[:, None] * met[:, :, None]
    left = np.eye(u.shape[1]) - np.linalg.pinv(rows, rcond=1e-6) @ rows  # projection on what no limit holds
    loose = np.linalg.norm(left, axis=2) > LOOSE
    labels = system.label("u", u.shape[1])
    return [(float(weights @ loose[:, i]), labels[i].name) for i in free]


def _holding(problem: Problem, solution: Solution, shape: tuple[int, ...]) -> Array:
    """Return whether controls hold a state limit at the points of a motion, of a shape (K, nu)."""
    result = np.zeros(shape, dtype=bool)
    times = solution.samples(solution.scheme.points)[0]
    for hold in contacts(problem, solution, state_limits(problem))[0]:
        result[(times >= hold.start) & (times <= hold.end), hold.contact.control] = True
    return result


def undetermined(problem: Problem) -> Array:
    """Return the indices of the limited controls that the Hamiltonian is linear in."""
    curvature = hamiltonian_of(problem).curvature
    limit = scales(problem)
    return np.array(
        [i for i in range(len(limit)) if np.isfinite(limit[i]) and ca.SX(curvature[i, i]).is_zero()], dtype=int
    )


def scales(problem: Problem) -> Array:
    """Return the largest finite bound of every control, (nu,); inf without one or with zero."""
    sides = np.abs(np.stack(problem.limits(Where.ALONG, problem.system.u)))
    sides[~np.isfinite(sides)] = 0.0
    largest = np.max(sides, axis=0)
    return np.where(largest > 0.0, largest, np.inf)


def with_effort(problem: Problem, solution: Solution, weight: float) -> Problem:
    """Return a problem with the effort of its undetermined controls added to the cost; itself if it has none.

    Args:
        problem: one phase.
        solution: sets the scale, J* / T*.
        weight: share of the cost.
    """
    shares = effort_shares(problem)
    if not shares.numel():
        return problem
    share = weight * max(abs(solution.cost), abs(problem.minimise.time) * solution.duration) / solution.duration
    cost = problem.minimise
    running = cost.running + share * ca.sumsqr(shares) / shares.numel()
    return replace(problem, minimise=Bolza(cost.time, running, cost.final))


def effort_shares(problem: Problem) -> ca.SX:
    """Return the shares (n,) of their limits that undetermined controls use; nothing if the cost determines all.

    Where a control that the Hamiltonian is linear in has no bounds, they are those of the expressions that hold it.
    """
    limit, u = scales(problem), problem.system.u
    own = [u[int(i)] / limit[i] for i in undetermined(problem)]
    return ca.vertcat(ca.SX(0, 1), *own, *_held_expressions(problem))


def _undetermined_by_bounds(problem: Problem) -> list[int]:
    """Return the indices of the controls without bounds that the Hamiltonian is linear in."""
    limit, curvature = scales(problem), hamiltonian_of(problem).curvature
    return [i for i in range(len(limit)) if not np.isfinite(limit[i]) and ca.SX(curvature[i, i]).is_zero()]


def _held_expressions(problem: Problem) -> list[ca.SX]:
    """Return the share of its limits of every expression that holds a control without bounds, linear in H."""
    u, free, held = problem.system.u, _undetermined_by_bounds(problem), list[ca.SX]()
    for constraint in problem.subject_to if free else ():
        for c in range(constraint.expression.numel()) if constraint.where is Where.ALONG else ():
            largest = max(abs(constraint.lower[c]), abs(constraint.upper[c]))
            part = constraint.expression[c]
            if np.isfinite(largest) and largest > 0.0 and ca.depends_on(part, u[free]):
                held.append(part / largest)
    return held


def without_effort(result: Solution, problem: Problem) -> Solution:
    """Return a solution of the problem with effort as one of the problem without it: its cost is computed again.

    Args:
        result: solved with `with_effort(problem, ...)`.
        problem: the one without.
    """
    cost, system = problem.minimise, problem.system
    value = cost.time * result.duration
    function = ca.Function("cost", [system.x, system.u, system.p], [cost.running, cost.final])
    _, x, _, u = result.samples(result.scheme.points)
    p = result.parameters
    running = np.array(function.map(len(x))(x.T, u.T, np.tile(p[:, None], len(x)))[0]).reshape(len(result.grid), -1)
    value += float(result.duration * result.grid.widths @ (running @ result.scheme.weights))
    value += float(function(result.states[-1, -1], result.controls[-1, -1], p)[1])
    return replace(result, cost=value, problem=problem)
