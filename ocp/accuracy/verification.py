"""Verification of a solution by re-integration, a search for violated limits, and Pontryagin's conditions.

Of the transcription it uses the interpolants x(t), u(t), lambda(t) and the collocation points only: no defect, no row
and no derivative of the NLP. The re-integration has an integrator and steps of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp import checks
from ocp.accuracy.optimality_figures import optimality
from ocp.accuracy.report import Allowed, Report
from ocp.checks import Array
from ocp.integrators.simulation import Trajectory, simulate
from ocp.problem.problem import Problem
from ocp.solution.attached_problem import with_problem
from ocp.solution.cost_scale import scale_of_cost
from ocp.solution.figure import Figure
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.state_scales import scales_of_states
from ocp.solution.violations import excess
from ocp.system import System

TIGHT = 1e-12  # tolerance of the re-integration
SCALE = "the scale of each state"
TURNOVER = "the energy turned over"


def verify(
    solution: Solution | SequenceSolution, problem: Problem | None = None, allowed: Allowed | None = None
) -> Report:
    """Check a solution by means that the solve did not use.

    drift: x' = f(x, u(t), p) integrated from x(0) with steps of order 16 and a tolerance of 1e-12, restarted at every
    jump of u, minus x(t); relative to the range of each state, at least 1/1000 of the largest range with the same
    unit, and at least 1/1000 of the change that the controls could cause.
    violation: every limit at 24 points of each element. hamiltonian: lambda . f + running at the collocation points.
    switching: integral of the decrease of H when every control alone moves to the minimum of a quadratic model of H
    within its limits; for H linear in u_i that is dH/du_i (u_i - u_i*), u_i* the limit that minimises H. Multipliers
    of state limits are redistributed over their elements. NaN if limits couple controls. energy: signals "energy",
    "power" and, if there, "loss", along the re-integrated motion.

    Args:
        solution: of any status; of a sequence, the worst figure of all phases, and gaps between phases are violations.
        problem: needed only for a solution loaded without it.
        allowed: what counts as verified, such as Allowed(drift=1e-5); None for the defaults.

    Raises:
        ValueError: no problem.

    Source: the Hamiltonian of an autonomous problem is constant (Pontryagin et al., The Mathematical Theory of
        Optimal Processes); the decrease of H bounds the gain of the cost to first order.
    """
    checks.instance("verify: allowed", allowed, Allowed | None, "an Allowed(...), or None")
    allowed = Allowed() if allowed is None else allowed
    if isinstance(solution, SequenceSolution):
        return _merged([verify(phase, None, allowed) for phase in solution.phases], _gaps(solution))
    solution, problem = with_problem("verify", solution, problem)
    scale, energy_scale = scales_of_states(solution, problem)
    drift, end, energy = _reintegrated(solution, problem, scale, energy_scale)
    beyond = excess(solution, problem, scale)
    share, worst = max(beyond, key=lambda pair: pair[0], default=(0.0, None))
    violation = Figure(
        share, "share", "the range of the limit", worst.what if worst else "", worst.at if worst else np.nan
    )
    conditions = optimality(solution, problem)
    amounts = {
        "drift": _amount(drift, scale, problem.system),
        "violation": f"{float(worst):.2g} {worst.unit}".strip() if worst is not None and share > 0.0 else "",
        "switching": gain_in_words(conditions.gain, solution, problem),
    }
    return Report(
        solution.status.name, drift, end, violation, conditions.deviation, conditions.mean, conditions.offset,
        conditions.gain, energy, tuple(figure for _, figure in beyond), allowed, amounts, len(solution.grid),
        solution.scheme.order,
    )  # fmt: skip


def _amount(drift: Figure, scale: Array, system: System) -> str:
    """Return a drift in the unit of its state."""
    labels = system.label("x", len(scale))
    amounts = [f"{drift * s:.2g} {label.unit}".strip() for label, s in zip(labels, scale, strict=True)
               if label.name == drift.what]  # fmt: skip
    return next(iter(amounts), "") if np.isfinite(drift) else ""


def gain_in_words(gain: float, solution: Solution, problem: Problem) -> str:
    """Return a share of the cost in the unit of the cost: seconds if it is the duration; empty if undefined.

    Args:
        gain: share of the cost.
        solution: with its cost.
        problem: that it solves.
    """
    cost = problem.minimise
    timed = cost.time == 1.0 and all(part.is_zero() for part in (cost.running, cost.final, cost.initial))
    unit = "s" if timed else "in units of the cost"
    return f"{gain * scale_of_cost(solution, problem):.2g} {unit}" if np.isfinite(gain) else ""


def _gaps(solution: SequenceSolution) -> list[tuple[float, Figure]]:
    """Return the difference of both sides of every link, relative to the largest value in the phase before it."""
    results = []
    for k, (i, j, left, right) in enumerate(solution.problem.junctions):
        before, after = solution.phases[i], solution.phases[j]
        path = before.signal(left, before.t)
        apart = np.abs(path[-1] - after.signal(right, 0.0))
        largest = np.max(np.abs(path), axis=0)
        scale = np.where(largest > 0.0, largest, 1.0)
        for i, amount in enumerate(apart):
            figure = Figure(amount, "", "link", f"link {i + 1} at junction {k + 1}", before.duration)
            results.append((float(amount / scale[i]), figure))
    return results


def _merged(reports: list[Report], gaps: list[tuple[float, Figure]]) -> Report:
    """Return the worst figures of several reports; a gap between phases counts as a violated limit."""

    def worst(name: str) -> Figure:
        figures: list[Figure] = [getattr(report, name) for report in reports]
        defined = [figure for figure in figures if not np.isnan(figure)]
        return max(defined, default=figures[0])

    violation = worst("violation")
    share, gap = max(gaps, key=lambda pair: pair[0])
    if share > violation:
        violation = Figure(share, "share", "the scale of the link", gap.what, gap.at)
    bad = [report.status for report in reports if report.status != "SOLVED"]
    excess = tuple(figure for report in reports for figure in report.excess) + tuple(figure for _, figure in gaps)
    return Report(
        bad[0] if bad else "SOLVED", worst("drift"), worst("drift_end"), violation, worst("hamiltonian"),
        reports[0].hamiltonian_value, worst("hamiltonian_offset"), worst("switching"), worst("energy"), excess,
        reports[0].allowed, {}, max(report.elements for report in reports), reports[0].order,
    )  # fmt: skip


class _Balance(NamedTuple):
    """Energy balance of a system with the signals "energy" and "power"."""

    stored: ca.SX
    supplied: ca.SX  # power minus losses


def _balance(system: System) -> _Balance | None:
    if "energy" not in system.signals or "power" not in system.signals:
        return None
    return _Balance(system.signals["energy"], system.signals["power"] - system.signals.get("loss", ca.SX(0)))


def _reintegrated(
    solution: Solution, problem: Problem, scale: Array, energy_scale: float
) -> tuple[Figure, Figure, Figure]:
    """Return the largest drift, the drift at the end, and the error of the energy balance."""
    balance, nodes = _balance(problem.system), solution.nodes
    if solution.duration <= 0.0 or not np.all(np.isfinite(solution.states)):
        nothing = Figure(0.0 if solution.duration == 0.0 else np.nan, "share", SCALE)
        return nothing, nothing, nothing
    moved = _integrated(solution, problem.system, balance, scale)
    distance = np.abs(moved.x[:, : len(scale)] - solution.x(nodes)) / scale
    distance[np.isnan(distance)] = np.inf
    k, i = np.unravel_index(np.argmax(distance), distance.shape)
    labels = [label.name for label in problem.system.label("x", len(scale))]
    drift = Figure(distance[k, i], "share", SCALE, labels[i], nodes[k])
    last = int(np.argmax(distance[-1]))
    end = Figure(distance[-1, last], "share", SCALE, labels[last], nodes[-1])
    return drift, end, _open_balance(moved, solution, problem.system, balance, energy_scale)


def _integrated(solution: Solution, system: System, balance: _Balance | None, scale: Array) -> Trajectory:
    """Return the motion integrated from x(0); with a balance, the supplied energy is its last state."""
    if balance is None:
        return simulate(system, solution.states[0, 0], solution, solution.nodes, rtol=TIGHT, atol=TIGHT * scale)
    energy = ca.SX.sym("supplied energy")
    augmented = type(system)(
        ca.vertcat(system.x, energy), system.u, system.p, ca.vertcat(system.rate, ca.sum1(balance.supplied)),
        nominal=system.nominal, singular=system.singular,
    )  # fmt: skip
    atol = TIGHT * np.append(scale, _turnover(solution, system, balance.supplied))
    start = np.append(solution.states[0, 0], 0.0)
    return simulate(augmented, start, solution, solution.nodes, rtol=TIGHT, atol=atol)


def _open_balance(
    moved: Trajectory, solution: Solution, system: System, balance: _Balance | None, energy_scale: float
) -> Figure:
    if balance is None:
        return Figure(np.nan, "share", TURNOVER, "undefined")
    stored = ca.Function("stored", [system.x, system.p], [balance.stored])
    p = solution.parameters
    levels = np.array([float(stored(x, p)) for x in moved.x[:, :-1]])
    supplied = moved.x[:, -1]
    missing = np.abs(supplied - (levels - levels[0]))
    turnover = max(np.ptp(levels), np.ptp(supplied), energy_scale, 1e-300)
    return Figure(float(np.max(missing)) / turnover, "share", TURNOVER)


def _turnover(solution: Solution, system: System, power: ca.SX) -> Array:
    """Return the integral (1,) of the absolute power along the motion; one if it is zero."""
    _, x, _, u = solution.samples(solution.scheme.points)
    function = ca.Function("power", [system.x, system.u, system.p], [ca.sum1(ca.fabs(power))])
    p = solution.parameters
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    energy = np.array(function.map(len(x))(x.T, u.T, np.tile(p[:, None], len(x)))) @ weights
    return np.where(energy > 0.0, energy, 1.0)
