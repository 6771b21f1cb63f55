"""Pictures of torque tables: torques with their split, power, the torque-speed plane, the path of the tool."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from models.plots.signals import skeleton
from models.plots.space import draw_space
from models.plots.style import ACCENT, FAINT, LIMIT, MOTION, File, pretty, saved, styled
from models.plots.torque_bounds import Limits, drive_limits
from models.torques.time_means import rms, rms_of_samples
from models.torques.torque_table import TorqueTable
from ocp.checks import Array

Bounds = tuple[Array, Array]  # least and largest torque (K, n) of every drive
NEAR = 1.5  # ranges of a curve within which a limit is drawn
MOST = 4000  # points drawn of one curve
SHORT = 6  # letters of a name that can be an index
PATH = 400  # points drawn of the path of the tool
COLOURS = ("#4c9f70", "#8e6bbf", "#c4683f", "#3f8fc4", "#a0822e", "#5b6770", "#b04f86")


def torques(
    table: TorqueTable, raw: Array | None = None, path: File | None = None, limits: Limits | None = None
) -> Figure:
    """Draw a torque table: torques with their split, power, the torque-speed plane, the arm in space.

    Args:
        table: with its limits, split and uncertainty.
        raw: (K, n) torques from raw differences of the samples, whose error gets a column of its own, or None.
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.
        limits: on signals, such as those of a scene, beside those of drives and effects: signal -> (lower, upper).

    Raises:
        OSError: the file cannot be written.
    """
    bounds = drive_limits(table, limits)
    n = len(table.machine.coordinates)
    widths = [1.5, *([1.1] if raw is not None else []), 1.1, 1.1, 2.0]
    figure = plt.figure(figsize=(2.7 * sum(widths), max(2.3 * n, 5.6) + 1.2), layout="constrained")
    grid = figure.add_gridspec(n, len(widths), width_ratios=widths)
    shown = np.unique(np.linspace(0, len(table.t) - 1, min(MOST, len(table.t))).round().astype(int))
    columns = iter(range(len(widths)))
    handles, labels = _course(figure, grid[:, next(columns)], table, shown, bounds)
    if raw is not None:
        _compared(figure, grid[:, next(columns)], table, np.abs(raw - table.tau), shown)
    _power(figure, grid[:, next(columns)], table, shown)
    _planes(figure, grid[:, next(columns)], table, shown, bounds)
    space = figure.add_subplot(grid[:, next(columns)], projection="3d")
    draw_space(space, skeleton(table.machine, table.q[shown[:: max(1, len(shown) // PATH)]]))
    space.set_title("path of the tool, and the arm at seven times", fontsize=10)
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 10), fontsize=8, frameon=False)
    rows = f"rows from {table.t[0]:.5g} to {table.t[-1]:.5g} s"
    figure.suptitle(f"Torques of a motion of the {table.machine.name} manipulator, {rows}", fontsize=11)
    return saved(figure, path, dpi=130)


def _rows(figure: Figure, column: SubplotSpec, n: int) -> list[Axes]:
    """Return one panel for each drive in a column of the picture."""
    grid = column.subgridspec(n, 1)
    return [figure.add_subplot(grid[i]) for i in range(n)]


def _course(
    figure: Figure, column: SubplotSpec, table: TorqueTable, shown: Array, bounds: Bounds
) -> tuple[list[Artist], list[str]]:
    """Draw the torques over time with their parts, and return the entries of the legend."""
    t, n = table.t[shown], len(table.machine.coordinates)
    several: dict[str, Artist] = {}  # by label, each once
    for i, axes in enumerate(_rows(figure, column, n)):
        for colour, (name, part) in zip(_cycle(len(table.split)), table.split.items(), strict=True):
            axes.plot(t, part[shown, i], color=colour, linewidth=0.9, label=name)
        axes.plot(t, table.tau[shown, i], color=MOTION, linewidth=1.6, zorder=5, label="tau")
        if table.uncertainty is not None:
            low, high = (table.tau[shown, i] + s * 2.0 * table.uncertainty[shown, i] for s in (-1, 1))
            axes.fill_between(t, low, high, color=MOTION, alpha=0.2, linewidth=0, label="tau, two standard deviations")
        for side in _near(axes, bounds, i):
            axes.plot(t, side[shown], color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
        for begin, end in _spans(table, i):
            axes.axvspan(begin, end, color=LIMIT, alpha=0.15, linewidth=0)
        styled(axes, _torque(table, i), "torque and its parts" if i == 0 else "", "t [s]" if i == n - 1 else "")
        several = {**several, **dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))}
    return list(several.values()), list(several)


def _compared(figure: Figure, column: SubplotSpec, table: TorqueTable, apart: Array, shown: Array) -> None:
    """Draw how far torques from raw differences (K, n) are from those of the table, and the uncertainty of these."""
    t, n = table.t[shown], len(table.machine.coordinates)
    for i, axes in enumerate(_rows(figure, column, n)):
        c = table.machine.coordinates[i]
        mean = float(rms_of_samples(table.t, apart[:, [i]])[0])
        axes.plot(t, apart[shown, i], ".", color=FAINT, markersize=2, alpha=0.5)
        axes.axhline(mean, color=LIMIT, linewidth=1.2, label=f"raw differences: {mean:.3g} {c.force_unit} (rms)")
        if table.uncertainty is not None:
            deviation = table.uncertainty[:, i]
            label = f"spline: {float(rms(table.t, deviation[:, None])[0]):.3g} {c.force_unit} (standard deviation)"
            axes.plot(t, deviation[shown], color=MOTION, linewidth=1.4, label=label)
        title = "error by raw differences" if i == 0 else ""
        styled(axes, f"error of {_torque(table, i)}", title, "t [s]" if i == n - 1 else "", log=True)
        axes.set_ylim(bottom=1e-4 * max(mean, 1e-12))
        axes.legend(fontsize=7, frameon=True, framealpha=0.85, edgecolor="none", loc="lower right")


def _power(figure: Figure, column: SubplotSpec, table: TorqueTable, shown: Array) -> None:
    """Draw the powers of the drives over time."""
    t, n = table.t[shown], len(table.machine.coordinates)
    for i, (axes, c) in enumerate(zip(_rows(figure, column, n), table.machine.coordinates, strict=True)):
        power = table.power[shown, i]
        axes.fill_between(t, 0.0, np.maximum(power, 0.0), color=ACCENT, alpha=0.7, linewidth=0, label="motor")
        axes.fill_between(t, 0.0, np.minimum(power, 0.0), color=COLOURS[0], alpha=0.7, linewidth=0, label="brake")
        label = pretty(f"P_{c.name} [W]") if len(c.name) <= SHORT else f"{c.name} [W]"
        styled(axes, label, "power" if i == 0 else "", "t [s]" if i == n - 1 else "")
        if i == 0:
            axes.legend(fontsize=7, frameon=False)


def _planes(figure: Figure, column: SubplotSpec, table: TorqueTable, shown: Array, bounds: Bounds) -> None:
    """Draw the torques over the speeds, with the limits of the drives."""
    n = len(table.machine.coordinates)
    for i, (axes, c) in enumerate(zip(_rows(figure, column, n), table.machine.coordinates, strict=True)):
        _plane(axes, table, i, shown, bounds)
        styled(axes, _torque(table, i), "torque over speed" if i == 0 else "", pretty(f"d{c.name}/dt [{c.unit}/s]"))


def _torque(table: TorqueTable, i: int) -> str:
    c = table.machine.coordinates[i]
    return pretty(f"tau_{c.name} [{c.force_unit}]")


def _plane(axes: Axes, table: TorqueTable, i: int, shown: Array, bounds: Bounds) -> None:
    v, tau = table.v[shown, i], table.tau[shown, i]
    axes.plot(v, tau, "-", color=MOTION, linewidth=1.2)
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
        return
    order = shown[np.argsort(v)]
    for side in _near(axes, bounds, i):
        axes.plot(table.v[order, i], side[order], color=LIMIT, linestyle="--", linewidth=1.0)


def _near(axes: Axes, bounds: Bounds, i: int) -> list[Array]:
    """Return the limits (K,) of a drive, without what is so far away that it would flatten its curve."""
    bottom, top = axes.get_ylim()
    margin = NEAR * (top - bottom)
    sides = [
        np.where((side[:, i] > bottom - margin) & (side[:, i] < top + margin), side[:, i], np.nan) for side in bounds
    ]
    return [side for side in sides if np.isfinite(side).any()]


def _spans(table: TorqueTable, i: int) -> list[tuple[float, float]]:
    return [(span.start, span.end) for span in table.loads[i].exceeded]


def _cycle(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
