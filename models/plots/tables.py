"""Pictures of torque tables: torques with their split, power, the torque-speed plane, the path of the tool."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from models.plots.signals import skeleton
from models.plots.space import draw_space
from models.plots.style import ACCENT, FAINT, LIMIT, MOTION, File, pretty, saved, styled
from models.torques.torque_table import TorqueTable
from ocp.checks import Array

MOST = 4000  # points drawn of one curve
PATH = 400  # points drawn of the path of the tool
COLOURS = ("#4c9f70", "#8e6bbf", "#c4683f", "#3f8fc4", "#a0822e", "#5b6770", "#b04f86")


def torques(table: TorqueTable, raw: Array | None = None, path: File | None = None) -> Figure:
    """Draw a torque table: torques with their split, power, the torque-speed plane, the arm in space.

    Args:
        table: with its limits, split and uncertainty.
        raw: (K, n) torques from raw differences of the samples, to compare with, or None [N m or N].
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.

    Raises:
        OSError: the file cannot be written.
    """
    n = len(table.machine.coordinates)
    figure = plt.figure(figsize=(18.0, max(2.3 * n, 5.6) + 1.2), layout="constrained")
    grid = figure.add_gridspec(n, 4, width_ratios=(1.5, 1.1, 1.1, 2.0))
    shown = np.unique(np.linspace(0, len(table.t) - 1, min(MOST, len(table.t))).round().astype(int))
    t = table.t[shown]
    for i, c in enumerate(table.machine.coordinates):
        first = figure.add_subplot(grid[i, 0])
        for colour, (name, part) in zip(_cycle(len(table.split)), table.split.items(), strict=True):
            first.plot(t, part[shown, i], color=colour, linewidth=0.9, label=name)
        if raw is not None:
            first.plot(t, raw[shown, i], color=FAINT, linewidth=0.5, zorder=1, label="raw differences")
        first.plot(t, table.tau[shown, i], color=MOTION, linewidth=1.6, zorder=5, label="tau")
        if table.uncertainty is not None:
            low, high = (table.tau[shown, i] + s * 2.0 * table.uncertainty[shown, i] for s in (-1, 1))
            first.fill_between(t, low, high, color=MOTION, alpha=0.2, linewidth=0, label="tau, two standard deviations")
        for low, high in _spans(table, i):
            first.axvspan(low, high, color=LIMIT, alpha=0.15, linewidth=0)
        last = "t [s]" if i == n - 1 else ""
        styled(first, pretty(f"tau_{c.name} [{c.force_unit}]"), "torque and its parts" if i == 0 else "", last)
        if raw is not None:
            reach = 1.3 * np.max(np.abs([*table.split.values(), table.tau]), axis=(0, 1))[i]
            first.set_ylim(-reach, reach)
        second = figure.add_subplot(grid[i, 1])
        power = table.power[shown, i]
        second.fill_between(t, 0.0, np.maximum(power, 0.0), color=ACCENT, alpha=0.7, linewidth=0, label="motor")
        second.fill_between(t, 0.0, np.minimum(power, 0.0), color=COLOURS[0], alpha=0.7, linewidth=0, label="brake")
        styled(second, "power [W]", "power" if i == 0 else "", last)
        third = figure.add_subplot(grid[i, 2])
        _plane(third, table, i, shown)
        styled(third, "", "torque over speed" if i == 0 else "", f"speed [{c.unit}/s]")
        if i == 0:
            second.legend(fontsize=7, frameon=False)
            handles, labels = first.get_legend_handles_labels()
    space = figure.add_subplot(grid[:, 3], projection="3d")
    draw_space(space, skeleton(table.machine, table.q[shown[:: max(1, len(shown) // PATH)]]))
    space.set_title("path of the tool, and the arm at seven times", fontsize=10)
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 8), fontsize=8, frameon=False)
    figure.suptitle(
        f"Torques of a motion of the {table.machine.name} manipulator, {table.t[-1] - table.t[0]:.5g} s", fontsize=11
    )
    return saved(figure, path, dpi=130)


def _plane(axes: Axes, table: TorqueTable, i: int, shown: np.ndarray) -> None:
    v, tau = table.v[shown, i], table.tau[shown, i]
    axes.plot(v, tau, ".", color=MOTION, markersize=1.5)
    if table.limits:
        fastest = max(float(np.max(np.abs(v))) * 1.15, 1e-9)
        limit = table.limits[i]
        if np.isfinite(limit.speed):
            fastest = max(fastest, min(limit.speed, 3.0 * fastest))
        speeds = np.linspace(-fastest, fastest, 401)
        allowed = limit.torque(speeds)
        for sign in (-1.0, 1.0):
            axes.plot(speeds, sign * np.where(np.isfinite(allowed), allowed, np.nan), color=LIMIT, linestyle="--")
        if np.isfinite(limit.continuous):
            for sign in (-1.0, 1.0):
                axes.axhline(sign * limit.continuous, color=LIMIT, linestyle=":", linewidth=0.9)


def _spans(table: TorqueTable, i: int) -> list[tuple[float, float]]:
    return [(span.start, span.end) for span in table.loads[i].exceeded]


def _cycle(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
