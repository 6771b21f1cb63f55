"""Picture of a switching structure: drives, switching functions, limits of states and the Hamiltonian over time."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from models.plots.signals import minimised, problem_of
from models.plots.style import ACCENT, FAINT, LIMIT, MOTION, File, saved
from ocp import Problem, Solution
from ocp.arcs.switching import switching_functions
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.state_constraints import StateLimit, state_limits
from ocp.solution.structure import Kind, Row

SAMPLED = np.linspace(0.0, 1.0, 17)  # on each element at which curves are drawn
# Of the palette of Okabe and Ito, which the colour-blind tell apart.
COLOURS = {
    Kind.LOWER: "#56b4e9",
    Kind.UPPER: "#e69f00",
    Kind.INTERIOR: "#cfd6dc",
    Kind.HOLDING: "#009e73",
    Kind.LIMIT: "#009e73",
    Kind.TOUCH: LIMIT,
}
WORDS = {
    Kind.LOWER: "at the lower limit",
    Kind.UPPER: "at the upper limit",
    Kind.INTERIOR: "between its limits",
    Kind.HOLDING: "holding a limit of the states",
    Kind.TOUCH: "limit touched",
}


def structure(solution: Solution, path: File | None = None) -> Figure:
    """Draw what every drive does and why, the limits of states that are met, and the Hamiltonian along the motion.

    Each drive: its control with its limits, over bars in the colour of its arcs; below it the switching function dH/du
    times half the range [cost/s], which is > 0 where the lower limit is optimal. Each limit that is met: the limited
    value, and where it is held or touched. Last the Hamiltonian minus its mean [cost/s].

    Args:
        solution: polished, with its problem.
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.

    Raises:
        ValueError: a solution without structure, or loaded without its problem.
        OSError: the picture cannot be written.
    """
    problem = problem_of(solution)
    if solution.structure is None:
        raise ValueError(f"picture: this solution has no structure; polish it first ({solution.message})")
    rows = solution.structure.rows
    labels = problem.system.label("u", problem.system.u.numel())
    met = [limit for limit in state_limits(problem) if any(row.name == limit.label.name for row in rows)]
    heights = [*[1.0, 0.8] * len(labels), *[0.8] * len(met), 0.8]
    figure, axes = plt.subplots(
        len(heights), 1, sharex=True, figsize=(7.2, 0.95 * sum(heights) + 1.2), height_ratios=heights,
        layout="constrained",
    )  # fmt: skip
    t, u, values, hamiltonian, x = along_motion(solution, problem)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    for i, label in enumerate(labels):
        own = [row for row in rows if row.name == label.name]
        control, switching = axes[2 * i], axes[2 * i + 1]
        _bars(control, own)
        _bars(switching, own, faint=True)
        _curve(control, t, u[:, i])
        for side in (low[i], high[i]):
            if np.isfinite(side):
                control.axhline(side, color=LIMIT, linestyle="--", linewidth=0.8)
        control.set_ylabel(f"{label.name}\n[{label.unit}]" if label.unit else label.name, fontsize=8)
        switching.axhline(0.0, color=FAINT, linewidth=0.8)
        _curve(switching, t, values[:, i], ACCENT)
        reach = 1.15 * max(float(np.max(np.abs(values[:, i]))), 1e-300)
        switching.set_ylim(-reach, reach)
        switching.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
        switching.set_ylabel("switching\nfunction", fontsize=8)
    for panel, limit in zip(axes[2 * len(labels) : -1], met, strict=True):
        own = [row for row in rows if row.name == limit.label.name]
        _bars(panel, own)
        _limit(panel, problem, solution, limit, t, x, u)
    _curve(axes[-1], t, hamiltonian)
    axes[-1].set_ylabel("H minus\nits mean", fontsize=8)
    axes[-1].set_xlabel("t [s]", fontsize=9)
    axes[-1].ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
    for panel in axes:
        panel.tick_params(labelsize=7)
        panel.yaxis.get_offset_text().set_fontsize(7)
        panel.set_xlim(0.0, solution.duration)
    used = [kind for kind in WORDS if any(row.kind is kind for row in rows)]
    handles = [Patch(color=COLOURS[kind], alpha=0.55, label=WORDS[kind]) for kind in used]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 3), fontsize=8, frameon=False)
    figure.align_ylabels()
    arcs = len(solution.structure.arcs)
    words = (
        f"{minimised(solution).capitalize()}: {arcs} arc{'s' if arcs > 1 else ''}, $t_f$ = {solution.duration:.10g} s"
    )
    figure.suptitle(words, fontsize=10)
    return saved(figure, path)


def along_motion(solution: Solution, problem: Problem) -> tuple[np.ndarray, ...]:
    """Return t, u, switching functions times half the range, H minus its mean, and x, sampled on every element."""
    system = problem.system
    t, x, _, u = solution.samples(SAMPLED)
    costates = np.einsum("sd,kda->ksa", solution.scheme.costate_at(SAMPLED), solution.costates).reshape(len(t), -1)
    parameters = solution.parameters
    low, high = problem.limits(Where.ALONG, system.u)
    half = np.where(np.isfinite(high - low), high - low, np.max(np.abs(u), axis=0)) / 2.0
    values = switching_functions(problem, x, u, costates, parameters).values * half
    H = hamiltonian_of(problem)
    function = ca.Function("H", list(H.arguments), [H.value])
    p = np.tile(parameters[:, None], len(t))
    level = np.array(function.map(len(t))(x.T, u.T, p, costates.T)).ravel()
    return t, u, values, level - np.mean(level), x


def _curve(axes: Axes, t: np.ndarray, values: np.ndarray, colour: str = MOTION) -> None:
    axes.plot(t, values, color=colour, linewidth=1.2, zorder=3)
    axes.grid(visible=True, axis="x", color="#e5e8eb", linewidth=0.5)


def _bars(axes: Axes, rows: Sequence[Row], faint: bool = False) -> None:
    for row in rows:
        if row.kind is Kind.TOUCH:
            axes.axvline(row.start, color=COLOURS[row.kind], linewidth=1.4, zorder=4)
        else:
            axes.axvspan(row.start, row.end, color=COLOURS[row.kind], alpha=0.18 if faint else 0.55, linewidth=0.0)


def _limit(
    axes: Axes, problem: Problem, solution: Solution, limit: StateLimit, t: np.ndarray, x: np.ndarray, u: np.ndarray
) -> None:
    """Draw a limited expression with its limits as far as they are near."""
    system = problem.system
    function = ca.Function("limit", [system.x, system.u, system.p], [limit.chain[0]])
    p = np.tile(solution.parameters[:, None], len(t))
    values = np.array(function.map(len(t))(x.T, u.T, p)).ravel()
    _curve(axes, t, values)
    reach = max(float(np.ptp(values)), 1e-12)
    for side in (limit.lower, limit.upper):
        if np.isfinite(side) and np.min(np.abs(values - side)) < 0.5 * reach:
            axes.axhline(side, color=LIMIT, linestyle="--", linewidth=0.8)
    label = limit.label
    axes.set_ylabel(f"{label.name}\n[{label.unit}]" if label.unit else label.name, fontsize=8)
