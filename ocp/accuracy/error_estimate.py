"""A-posteriori error estimate of a solution, from the solution alone."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.polynomial import legendre as polynomials

from ocp.accuracy.even_multipliers import even
from ocp.accuracy.hamiltonian_minimum import Minimum, minimise
from ocp.accuracy.smooth_costates import costates_between
from ocp.accuracy.violation_costs import cost_of_violations
from ocp.checks import Array
from ocp.problem.problem import Free, Problem
from ocp.problem.sequence import Sequence
from ocp.solution.accuracy import Errors
from ocp.solution.attached_problem import with_problem
from ocp.solution.cost_scale import scale_of_cost
from ocp.solution.integration_drift import MORE, accumulated, propagated
from ocp.solution.parallel_solution import with_sequence
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status
from ocp.solution.state_scales import LEAST

PANELS, PER_PANEL = 8, 3  # panels of every element and Gauss points of each, for integrands with kinks
SAFETY = 2.0  # factor: the estimate is of first order, asymptotically exact for smooth problems
ROUNDING = 1e-12  # share of the cost that is added for rounding


def estimate(solution: Solution | SequenceSolution, problem: Problem | Sequence | None = None) -> Errors:
    """Estimate the errors of cost, duration and states of a solution; the optimum need not be known.

    The computed motion is an optimal motion of a perturbed problem. With the costate lambda = dJ/dx, each perturbation
    changes the cost, to first order, by

        J* = J + D - G + O + V,
        D = sum_k lambda(t_k+1) . (phi_k(x_k) - x_k+1) + integral of running dt - its quadrature,
        G - O = integral of H(x, u, lambda) - min over allowed u of H(x, u, lambda) dt,
        V = sum of the multipliers of state limits times the excess over the limits between the nodes.

    phi_k is the motion over element k from x_k under the computed control, by Gauss collocation of higher order (one
    step of Newton's method from the interpolant). In G the multipliers of state limits are redistributed over their
    elements (`ocp.accuracy.even_multipliers`). `cost` is twice the sum of |D|, G, O, V and the complementarity error
    of the solver. The estimate holds to first order and is not a proven bound; docs/calibration.md compares it with
    known optima. It refers to a local optimum; other optima are not considered. If the cost is not the duration
    itself, the relative error of a free duration is taken as that of the cost times the order of the scheme.

    Args:
        solution: of any status; of a Sequence, the errors are those of the whole motion.
        problem: needed only for a solution loaded without it.

    Raises:
        ValueError: no problem.

    Source: Becker, Rannacher, An optimal control approach to a posteriori error estimation in finite element methods,
        Acta Numerica 10 (2001); Cao, Petzold, SIAM J. Sci. Comput. 26 (2004), for initial value problems.
    """
    if isinstance(solution, SequenceSolution):
        one, parallel = with_sequence("estimate", solution, problem)
        errors = estimate(one)
        share = 1.0 if parallel.timed else one.scheme.order
        return replace(errors, duration=share * solution.duration * errors.cost / errors.cost_scale)
    solution, problem = with_problem("estimate", solution, problem)
    count, nx = len(solution.grid), solution.states.shape[2]
    labels = problem.system.label("x", nx)
    converged = solution.status in (Status.SOLVED, Status.ACCEPTABLE)
    if converged and solution.duration == 0.0:
        zero = np.zeros(count)
        none = np.zeros((count, nx))
        return Errors(
            0.0, 0.0, np.zeros(nx), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, zero, none, np.zeros((count + 1, nx)), labels
        )
    if not converged or solution.duration <= 0.0 or not np.all(np.isfinite(solution.data)):
        unknown = np.full((count, nx), np.nan)
        late = np.inf if isinstance(problem.horizon, Free) else 0.0
        return Errors(
            np.inf, late, np.full(nx, np.inf), np.nan, np.nan, np.nan, np.nan, np.nan, np.nan,
            np.full(count, np.nan), unknown, np.full((count + 1, nx), np.nan), labels,
        )  # fmt: skip
    local, transition, running = _reintegrated(solution, problem)
    at_end = costates_between(solution, problem, np.ones(1))[:, 0]
    dynamics = np.sum(at_end * local, axis=1) + running
    away = accumulated(local, transition)
    tau, weights = _panels()
    given = minimise(solution, problem, tau, costates_between(solution, problem, tau))
    adjoint = even(solution, problem)
    best = minimise(replace(solution, costates=adjoint.costates), problem, tau) if adjoint.moved else given
    optimality, overshoot = _gaps(given, solution, weights)
    if adjoint.moved:
        # Multipliers move within their elements only, so that every element may have the smaller of both bounds.
        moved = _gaps(best, solution, weights)
        better = moved[0] + moved[1] + adjoint.slack < optimality + overshoot
        optimality = np.where(better, moved[0] + adjoint.slack, optimality)
        overshoot = np.where(better, moved[1], overshoot)
    violation, left = cost_of_violations(solution, problem)
    parts = SAFETY * (np.abs(dynamics) + optimality + overshoot + violation)
    turnover = float(solution.duration * (given.scale.reshape(count, -1) @ weights @ solution.grid.widths))
    least = scale_of_cost(solution, problem)
    scale = max(abs(solution.cost), turnover)
    cost = SAFETY * (abs(float(dynamics.sum())) + float((optimality + overshoot + violation).sum()) + left)
    cost += ROUNDING * scale
    return Errors(
        cost, _of_duration(cost / least, solution, problem), np.max(np.abs(away), axis=0), float(dynamics.sum()),
        float(optimality.sum()), float(overshoot.sum()), float(violation.sum()), left,
        _variation(given, weights, solution, problem), parts, np.abs(local), away, labels, least,
    )  # fmt: skip


def _panels() -> tuple[Array, Array]:
    nodes, weights = polynomials.leggauss(PER_PANEL)
    tau = (np.arange(PANELS)[:, None] + (nodes + 1.0) / 2.0) / PANELS
    return tau.ravel(), np.tile(weights / 2.0 / PANELS, PANELS)


def _gaps(minimum: Minimum, solution: Solution, weights: Array) -> tuple[Array, Array]:
    """Return the integrals of H(u) - min H over every element (N,), of its positive and of its negative part."""
    count = len(solution.grid)
    gap = (minimum.value - minimum.least).reshape(count, -1) * weights
    gap = gap * (solution.duration * solution.grid.widths)[:, None]
    return np.sum(np.maximum(gap, 0.0), axis=1), np.sum(np.maximum(-gap, 0.0), axis=1)


def _of_duration(share: float, solution: Solution, problem: Problem) -> float:
    if not isinstance(problem.horizon, Free):
        return 0.0
    minimise = problem.minimise
    if minimise.time and all(p.is_zero() for p in (minimise.running, minimise.final, minimise.initial)):
        return share * solution.duration
    return share * solution.duration * solution.scheme.order


def _reintegrated(solution: Solution, problem: Problem) -> tuple[Array, Array, Array]:
    """Return phi_k(x_k) - x_k+1 (N, nx), d phi_k/dx_k (N, nx, nx), quadrature errors of the running cost (N,)."""
    system, scheme, running = problem.system, solution.scheme, problem.minimise.running
    local, transition, delta = propagated(solution, problem)
    count, m, nx = delta.shape[:3]
    nodes, weights = polynomials.leggauss(scheme.degree + MORE)
    outputs = [ca.densify(running), ca.densify(ca.jacobian(running, system.x))]
    function = ca.Function("running", [system.x, system.u, system.p], outputs)
    p = solution.parameters[:, None]
    _, x, _, u = solution.samples((nodes + 1.0) / 2.0)
    rate, gradient = (np.array(o) for o in function.map(len(x))(x.T, u.T, np.tile(p, len(x))))
    exact = rate.reshape(count, m) @ (weights / 2.0)
    exact = exact + np.einsum("j,kja,kja->k", weights / 2.0, gradient.reshape(count, m, nx), delta[..., 0])
    _, x, _, u = solution.samples(scheme.points)
    discrete = np.array(function.map(len(x))(x.T, u.T, np.tile(p, len(x)))[0]).reshape(count, -1) @ scheme.weights
    return local, transition, solution.duration * solution.grid.widths * (exact - discrete)


def _variation(result: Minimum, weights: Array, solution: Solution, problem: Problem) -> float:
    """Return the standard deviation of H from its constant value, relative to the mean of its terms."""
    shares = (solution.grid.widths[:, None] * weights).ravel()
    mean = float(shares @ result.value)
    horizon = problem.horizon
    free = isinstance(horizon, Free) and horizon.lower < solution.duration < horizon.upper
    target = -problem.minimise.time if free else mean
    least = LEAST * scale_of_cost(solution, problem) / max(solution.duration, 1e-300)
    scale = max(float(shares @ result.scale), abs(problem.minimise.time), least)
    return float(np.sqrt(shares @ (result.value - target) ** 2)) / scale
