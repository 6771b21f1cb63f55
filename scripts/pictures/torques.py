"""Pictures of torque tables: torques with their split, power, the torque-speed plane, the path of the tool."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from models import TorqueTable
from pictures.files import finish
from pictures.solution import ACCENT, FAINT, LIMIT, MOTION, pretty

MOST = 4000  # points drawn of one curve
COLOURS = ("#4c9f70", "#8e6bbf", "#c4683f", "#3f8fc4", "#a0822e", "#5b6770", "#b04f86")


def draw(table: TorqueTable, raw: np.ndarray | None, path: Path) -> None:
    """Draw a torque table.

    Args:
        table: with its limits, split and uncertainty.
        raw: (K, n) torques from raw differences, to compare with, or None.
        path: of the picture; the suffix chooses the format.
    """
    n = len(table.machine.coordinates)
    figure = plt.figure(figsize=(16.0, 2.3 * n + 1.2), layout="constrained")
    grid = figure.add_gridspec(n, 4, width_ratios=(1.5, 1.1, 1.1, 1.3))
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
        _style(first, pretty(f"tau_{c.name} [{c.force_unit}]"), "torque and its parts" if i == 0 else "", i == n - 1)
        if raw is not None:
            reach = 1.3 * np.max(np.abs([*table.split.values(), table.tau]), axis=(0, 1))[i]
            first.set_ylim(-reach, reach)
        second = figure.add_subplot(grid[i, 1])
        power = table.power[shown, i]
        second.fill_between(t, 0.0, np.maximum(power, 0.0), color=ACCENT, alpha=0.7, linewidth=0, label="motor")
        second.fill_between(t, 0.0, np.minimum(power, 0.0), color=COLOURS[0], alpha=0.7, linewidth=0, label="brake")
        _style(second, "power [W]", "power" if i == 0 else "", i == n - 1)
        third = figure.add_subplot(grid[i, 2])
        _plane(third, table, i, shown)
        _style(third, "", "torque over speed" if i == 0 else "", labelled=True, x=f"speed [{c.unit}/s]")
        if i == 0:
            second.legend(fontsize=7, frameon=False)
            handles, labels = first.get_legend_handles_labels()
    _tool(figure.add_subplot(grid[:, 3], projection="3d"), table, shown)
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 8), fontsize=8, frameon=False)
    figure.suptitle(
        f"Torques of a motion of the {table.machine.name} manipulator, {table.t[-1] - table.t[0]:.5g} s", fontsize=11
    )
    finish(figure, path, dpi=130)


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


def _tool(axes: Axes, table: TorqueTable, shown: np.ndarray) -> None:
    tool = table.tool[shown]
    axes.plot(*tool.T, color=ACCENT, linewidth=1.8)
    axes.plot(*tool[:1].T, "o", color=MOTION, markersize=5)
    axes.plot(*tool[-1:].T, "s", color=MOTION, markersize=6)
    middle, half = (tool.max(axis=0) + tool.min(axis=0)) / 2.0, max(float(np.ptp(tool, axis=0).max()) / 2.0, 1e-6)
    for axis, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{axis}lim")(centre - 1.05 * half, centre + 1.05 * half)
        getattr(axes, f"set_{axis}label")(f"{axis} [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.set_title("path of the tool, from circle to square", fontsize=10)


def _spans(table: TorqueTable, i: int) -> list[tuple[float, float]]:
    return [(span.start, span.end) for span in table.loads[i].exceeded]


def _style(axes: Axes, label: str, title: str, labelled: bool, x: str = "t [s]") -> None:
    axes.set_ylabel(label, fontsize=9)
    axes.set_title(title, fontsize=10)
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, color="#e5e8eb", linewidth=0.6)
    if labelled:
        axes.set_xlabel(x, fontsize=9)


def _cycle(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
