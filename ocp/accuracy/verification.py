"""Verification of a solution; shares no code with the transcription."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.accuracy.even_multipliers import even
from ocp.checks import Array
from ocp.integrators.simulation import simulate
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Free, Problem
from ocp.solution.attached_problem import with_problem
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution
from ocp.solution.state_scales import extent
from ocp.solution.violations import Figure, excess

TIGHT = 1e-12  # tolerance of the re-integration


@dataclass(frozen=True, eq=False)
class Report:
    """What an independent look at a solution found; every figure is zero for a perfect one, NaN if undefined."""

    status: str  # of the solver
    drift: Figure  # largest distance of the re-integrated motion from the solution, all times
    drift_end: Figure  # the same at the end
    violation: Figure  # largest excess over a limit, between nodes included
    hamiltonian: Figure  # largest deviation of the Hamiltonian from its constant value
    hamiltonian_value: float  # its mean; minus the weight of time for a free duration [cost/s]
    hamiltonian_offset: Figure  # distance of the mean from that value
    switching: Figure  # cost that the controls leave on the table to first order: integral of H(u) - min H
    energy: Figure  # work of the drives minus losses minus change of energy
    excess: tuple[Figure, ...]  # violation of every limited component in its own unit

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Sentences on what is not verified; empty for a verified solution."""
        result = [] if self.status == "SOLVED" else [f"the solver ended with {self.status}"]
        checks = (
            ("the re-integrated motion drifts away by", self.drift, 1e-6),
            ("a limit is exceeded by", self.violation, 2e-3),
            ("the energy balance is open by", self.energy, 1e-6),
            ("the Hamiltonian is away from its value by", self.hamiltonian_offset, 1e-2),
            ("the switching functions leave a gain of", self.switching, 2e-2),
        )
        for words, figure, allowed in checks:
            if figure > allowed or (np.isnan(figure) and figure.what != "undefined"):
                result.append(f"{words} {figure}, allowed are {allowed:g}")
        return tuple(result)

    @property
    def ok(self) -> bool:
        """Whether the solution is verified."""
        return not self.failures

    def __str__(self) -> str:
        names = ("drift", "drift_end", "violation", "hamiltonian", "switching", "energy")
        lines = [f"{name:12s} {getattr(self, name)}" for name in names]
        lines.insert(4, f"{'H':12s} {self.hamiltonian_value:.6g} (mean)")
        return "\n".join([*lines, "verified" if self.ok else "not verified: " + "; ".join(self.failures)])


def verify(solution: Solution | SequenceSolution, problem: Problem | None = None) -> Report:
    """Check a solution by means that the solve did not use.

    drift: x' = f(x, u(t), p) integrated from x(0) with steps of order 16 at 1e-12, ended at every jump of u, against
    x(t); relative to the range of each state, or a thousandth of the largest with the same unit, or a thousandth of
    what the controls could make of it.
    violation: every limit at 24 places of each element. hamiltonian: lambda . f + running at the collocation points.
    switching: integral of what H loses when every control alone goes where a quadratic model of H is least in its
    range; dH/du_i (u_i - u_i*) where H is linear in it, u_i* the end of its range that lowers H; for controls limited
    one by one, the multipliers of limits of states spread over their elements. energy: signals
    "energy", "power" and, if there, "loss", along the integrated motion.

    Args:
        solution: of any status; of a sequence, the worst figure of its phases counts, and gaps between them are
            violations.
        problem: needed only for a solution loaded without it.

    Raises:
        ValueError: no problem.

    Source: the Hamiltonian of an autonomous problem is constant (Pontryagin et al., The Mathematical Theory of
        Optimal Processes); the gap bounds the first-order gain of the cost.
    """
    if isinstance(solution, SequenceSolution):
        return _merged([verify(phase) for phase in solution.phases], _gaps(solution))
    solution, problem = with_problem("verify", solution, problem)
    scale, work = extent(solution, problem)
    drift, end, energy = _reintegrate(solution, problem, scale, work)
    beyond = excess(solution, problem, scale)
    relative = max(beyond, key=lambda pair: pair[0], default=(0.0, None))
    worst = relative[1]
    violation = Figure(
        relative[0], "share", "the range of the limit", worst.what if worst else "", worst.at if worst else np.nan
    )
    hamiltonian, mean, offset, switching = _pontryagin(solution, problem)
    figures = tuple(figure for _, figure in beyond)
    return Report(solution.status.name, drift, end, violation, hamiltonian, mean, offset, switching, energy, figures)


def _gaps(solution: SequenceSolution) -> list[tuple[float, Figure]]:
    """Return the distance of both sides of every link, relative to its largest value in the phase before."""
    results = []
    for k, (before, after) in enumerate(pairwise(solution.phases)):
        left, right = solution.problem.sides[k]
        path = before.signal(left, before.t)
        apart = np.abs(path[-1] - after.signal(right, 0.0))
        size = np.max(np.abs(path), axis=0)
        size = np.where(size > 0.0, size, 1.0)
        for i, amount in enumerate(apart):
            figure = Figure(amount, "", "link", f"link {i + 1} at junction {k + 1}", before.duration)
            results.append((float(amount / size[i]), figure))
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
        violation = Figure(share, "share", "the size of the link", gap.what, gap.at)
    bad = [report.status for report in reports if report.status != "SOLVED"]
    excess = tuple(figure for report in reports for figure in report.excess) + tuple(figure for _, figure in gaps)
    return Report(
        bad[0] if bad else "SOLVED", worst("drift"), worst("drift_end"), violation, worst("hamiltonian"),
        reports[0].hamiltonian_value, worst("hamiltonian_offset"), worst("switching"), worst("energy"), excess,
    )  # fmt: skip


def _reintegrate(solution: Solution, problem: Problem, scale: Array, least: float) -> tuple[Figure, Figure, Figure]:
    system = problem.system
    balance = [system.signals[name] for name in ("energy", "power") if name in system.signals]
    rate, x = system.rate, system.x
    work = ca.SX.sym("work")
    if len(balance) == 2:
        supplied = balance[1] - system.signals.get("loss", ca.SX(0))
        x, rate = ca.vertcat(x, work), ca.vertcat(rate, ca.sum1(supplied))
    augmented = type(system)(x, system.u, system.p, rate, nominal=system.nominal, singular=system.singular)
    x0 = np.append(solution.states[0, 0], [0.0] * (x.numel() - system.x.numel()))
    atol = TIGHT * np.append(scale, _turned(solution, problem, supplied)) if len(balance) == 2 else TIGHT * scale
    nodes = solution.nodes
    unit, words = "share", "the size of each state"
    if solution.duration <= 0.0 or not np.all(np.isfinite(solution.states)):
        nothing = Figure(0.0 if solution.duration == 0.0 else np.nan, unit, words)
        return nothing, nothing, nothing
    moved = simulate(augmented, x0, solution, nodes, rtol=TIGHT, atol=atol)
    distance = np.abs(moved.x[:, : len(scale)] - solution.x(nodes)) / scale
    distance[np.isnan(distance)] = np.inf
    k, i = np.unravel_index(np.argmax(distance), distance.shape)
    labels = [label.name for label in system.label("x", len(scale))]
    drift = Figure(distance[k, i], unit, words, labels[i], nodes[k])
    last = int(np.argmax(distance[-1]))
    end = Figure(distance[-1, last], unit, words, labels[last], nodes[-1])
    if len(balance) < 2:
        return drift, end, Figure(np.nan, "share", "the energy turned over", "undefined")
    level = ca.Function("level", [system.x, system.p], [balance[0]])
    p = solution.parameters
    levels = np.array([float(level(xk, p)) for xk in moved.x[:, : len(scale)]])
    open_ = np.abs(moved.x[:, -1] - (levels - levels[0]))
    turned = max(np.ptp(levels), np.ptp(moved.x[:, -1]), least, 1e-300)
    return drift, end, Figure(float(np.max(open_)) / turned, "share", "the energy turned over")


def _turned(solution: Solution, problem: Problem, power: ca.SX) -> Array:
    """Return the work (1,) done and taken along the motion, added up; one if there is none."""
    system = problem.system
    _, x, _, u = solution.samples(solution.scheme.points)
    function = ca.Function("power", [system.x, system.u, system.p], [ca.sum1(ca.fabs(power))])
    p = solution.parameters
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    size = np.array(function.map(len(x))(x.T, u.T, np.tile(p[:, None], len(x)))) @ weights
    return np.where(size > 0.0, size, 1.0)


def _pontryagin(solution: Solution, problem: Problem) -> tuple[Figure, float, Figure, Figure]:
    """Return the deviation of the Hamiltonian, its mean, and the gap left by the controls."""
    system = problem.system
    H = hamiltonian_of(problem)
    function = ca.Function("H", list(H.arguments), [H.value, H.slope, ca.diag(ca.densify(H.curvature)), H.terms])
    times, x, _, u = solution.samples(solution.scheme.points)
    p = solution.parameters

    def evaluated(costates: Array) -> list[Array]:
        given = x.T, u.T, np.tile(p[:, None], times.size), costates.reshape(times.size, -1).T
        return [np.array(part) for part in function.map(times.size)(*given)]

    adjoint = even(solution, problem)
    values, slopes, bends, sizes = evaluated(solution.costates)
    if adjoint.moved:
        _, slopes, bends, _ = evaluated(adjoint.costates)
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    total = max(weights.sum(), 1e-300)
    mean = float(weights @ values[0] / total)
    size = max(abs(problem.minimise.time), float(weights @ sizes[0] / total), 1e-300)
    horizon = problem.horizon
    inside = isinstance(horizon, Free) and horizon.lower + 1e-9 * max(horizon.lower, horizon.guess) < solution.duration
    # A duration at its limit has a multiplier of its own, and the Hamiltonian another constant value.
    free = inside and isinstance(horizon, Free) and solution.duration * (1.0 + 1e-9) < horizon.upper
    target = -problem.minimise.time if free else mean
    far = np.abs(values[0] - target)
    place = int(np.argmax(far))
    deviation = Figure(far[place] / size, "share", "the mean size of its terms", "H", times[place])
    offset = Figure(abs(mean - target) / size, "share", "the mean size of its terms", "mean H")
    low, high = problem.limits(Where.ALONG, system.u)
    coupled = any(
        ca.depends_on(c.expression, system.u)
        and not all(component.is_symbolic() for component in ca.vertsplit(c.expression))
        for c in problem.subject_to
    )
    if coupled:
        return deviation, mean, offset, Figure(np.nan, "share", "the cost", "undefined")
    reach = np.max(np.abs(u), axis=0, initial=0.0)
    best = np.where(
        slopes.T > 0.0, np.where(np.isfinite(low), low, u - reach), np.where(np.isfinite(high), high, u + reach)
    )
    # Along one control alone the least value of a convex Hamiltonian may come before its limit.
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(bends.T > 0.0, slopes.T / bends.T, np.inf)
    way = np.minimum(np.abs(u - best), np.abs(least))
    gain = np.abs(slopes.T) * way - np.where(bends.T > 0.0, bends.T, 0.0) * way**2 / 2.0
    gap = np.sum(np.where(slopes.T * (u - best) > 0.0, gain, 0.0), axis=1)
    cost = max(abs(solution.cost), 1e-300)
    where = times[int(np.argmax(gap))] if gap.size else np.nan
    left = float(weights @ gap + adjoint.slack.sum())
    return deviation, mean, offset, Figure(left / cost, "share", "the cost", "controls", where)
