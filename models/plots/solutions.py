"""Picture of a solved motion: signals over time with their limits, and the arm in space."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from models.machines.manipulator import Manipulator
from models.plots.signals import Curves, Motion, curves, links, minimised, phases, skeleton
from models.plots.space import draw_space
from models.plots.style import ACCENT, LIMIT, MOTION, File, pretty, saved, styled
from models.scenes.task import Obstacle
from ocp.checks import Array
from ocp.problem.regions import Region

TIMES = 200  # of the path in space
NEAR = 1.5  # a limit farther away than this many ranges of a curve would flatten it and is left out


def motion(
    solution: Motion, machine: Manipulator | None = None, torques: Array | None = None,
    obstacles: Sequence[Obstacle | Region] = (), title: str = "", path: File | None = None,
) -> Figure:  # fmt: skip
    """Draw a solved motion: each signal over time with limits and nodes, and the arm in space.

    Args:
        solution: of a Problem or a Sequence. Position, velocity and drives are drawn if the system has the signals
            q, v and tau, else state and control.
        machine: whose arm is drawn in space; None: no arm.
        torques: (N d, n) recovered drive torques at the collocation points [N m or N], or None.
        obstacles: of the task; regions that the tool stays out of.
        title: above the picture; "" for what was minimised and the duration.
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.

    Raises:
        ValueError: the solution was loaded without its problem.
        OSError: the file cannot be written.
    """
    shown = curves(solution)
    rows = max(len(one.labels) for one in shown)
    space = machine is not None
    figure = plt.figure(
        figsize=(9.6 + 6.4 * space, max(1.75 * rows, 5.6 if space else 2.4) + 1.1), layout="constrained"
    )
    grid = figure.add_gridspec(rows, len(shown) + space, width_ratios=[1.0] * len(shown) + [2.1] * space)
    legs, begins = phases(solution)
    points = np.concatenate([begin + leg.collocation_times.ravel() for begin, leg in zip(begins, legs, strict=True)])
    for column, one in enumerate(shown):
        for i, label in enumerate(one.labels):
            axes = figure.add_subplot(grid[i, column])
            if one.name == "tau" and torques is not None:
                axes.plot(points, torques[:, i], "+", color=ACCENT, markersize=3.5, markeredgewidth=0.7, zorder=5)
            _component(axes, one, i)
            last = i == len(one.labels) - 1
            styled(axes, pretty(label), one.heading if i == 0 else "", "t [s]" if last else "")
            for begin in begins[1:]:
                axes.axvline(begin, color="black", linewidth=0.6, linestyle=":")
    if machine is not None:
        axes = figure.add_subplot(grid[:, -1], projection="3d")
        t = np.linspace(0.0, solution.duration, TIMES)
        via = None
        if len(legs) > 1:
            via = skeleton(machine, np.atleast_2d(solution.signal("q", begins[1:])))[:, -1]
        q = solution.signal("q", t)
        draw_space(axes, skeleton(machine, q), obstacles, via, links(machine, q[[0, -1]]))
        axes.set_title("path of the tool, and the arm at seven equal times", fontsize=10)
    figure.legend(handles=_legend(torques is not None), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    figure.suptitle(title or f"{minimised(solution).capitalize()}: $t_f$ = {solution.duration:.6g} s", fontsize=11)
    return saved(figure, path, dpi=130)


def _component(axes: Axes, curve: Curves, i: int) -> None:
    values = curve.values[:, i]
    axes.plot(curve.t, values, color=MOTION, linewidth=1.5, zorder=3)
    axes.plot(curve.nodes, curve.at_nodes[:, i], ".", color=MOTION, markersize=3.5, zorder=4)
    bottom, top = axes.get_ylim()
    margin = NEAR * max(top - bottom, 1e-12)
    for side in (curve.lower[:, i], curve.upper[:, i]):
        inside = np.where((side > bottom - margin) & (side < top + margin), side, np.nan)
        if np.isfinite(inside).any():
            axes.plot(curve.t, inside, color=LIMIT, linestyle="--", linewidth=1.0, zorder=2)


def _legend(recovered: bool) -> list[Line2D]:
    handles = [
        Line2D([], [], color=MOTION, label="solution"),
        Line2D([], [], color=MOTION, marker=".", linestyle="", label="nodes of the grid"),
        Line2D([], [], color=LIMIT, linestyle="--", label="limit"),
    ]
    cross = Line2D([], [], color=ACCENT, marker="+", linestyle="", label="recovered by inverse dynamics")
    return [*handles, cross] if recovered else handles
