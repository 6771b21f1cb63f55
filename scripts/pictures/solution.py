"""Pictures of solutions, and how every picture is written."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from models import Manipulator
from ocp import Problem, SequenceSolution, Solution, System
from ocp.problem.constraints import Where
from pictures.files import finish

POSES = 7  # of the arm in the path picture
MOTION, LIMIT, FAINT, ACCENT = "#1f4e79", "#b03a2e", "#9aa5b1", "#d98c1f"


def time_optimal(
    solution: Solution | SequenceSolution, machine: Manipulator, torques: np.ndarray, title: str, path: Path
) -> None:
    """Draw coordinates, velocities and torques over time, with limits and nodes, and the path of the arm in space.

    Args:
        solution: of a problem whose system has the signals q, v, tau of the machine.
        machine: for names and the skeleton.
        torques: (N d, n) recovered drive torques at the collocation points.
        title: above everything.
        path: of the picture; the suffix chooses the format.
    """
    legs, begins = phases(solution)
    problem = _problem(legs[0])
    system, n = problem.system, len(machine.coordinates)
    figure = plt.figure(figsize=(14.0, 1.9 * n + 1.2), layout="constrained")
    grid = figure.add_gridspec(n, 4, width_ratios=(1.0, 1.0, 1.0, 1.55))
    tau = np.linspace(0.0, 1.0, 9)
    parts = [leg.samples(tau) for leg in legs]
    t = np.concatenate([begin + part[0] for begin, part in zip(begins, parts, strict=True)])
    points = np.concatenate([begin + leg.collocation_times.ravel() for begin, leg in zip(begins, legs, strict=True)])
    nodes = np.concatenate([*(begin + leg.nodes[:-1] for begin, leg in zip(begins, legs, strict=True)),
                            begins[-1:] + legs[-1].duration])  # fmt: skip
    for column, (name, heading) in enumerate((("q", "position"), ("v", "velocity"), ("tau", "drive"))):
        values = np.vstack([_signal(system, leg, name, x, u) for leg, (_, x, _, u) in zip(legs, parts, strict=True)])
        low, high = limits(problem, name)
        at_nodes = np.vstack([values[:: len(tau)], values[-1:]])
        for i, label in enumerate(system.label(name, n)):
            axes = figure.add_subplot(grid[i, column])
            axes.plot(t, values[:, i], color=MOTION, linewidth=1.5, zorder=3)
            axes.plot(nodes, at_nodes[:, i], ".", color=MOTION, markersize=3.5, zorder=4)
            if name == "tau":
                axes.plot(points, torques[:, i], "+", color=ACCENT, markersize=3.5, markeredgewidth=0.7, zorder=5)
            _draw_limits(axes, low[i], high[i])
            axes.set_ylabel(pretty(str(label)), fontsize=9)
            axes.tick_params(labelsize=8, labelbottom=i == n - 1)
            axes.grid(visible=True, color="#e5e8eb", linewidth=0.6)
            axes.margins(x=0.01)
            if i == 0:
                axes.set_title(heading, fontsize=10)
            if i == n - 1:
                axes.set_xlabel("t [s]", fontsize=9)
    _path_in_space(figure, grid[:, 3], solution, machine)
    handles = [
        Line2D([], [], color=MOTION, label="solution"),
        Line2D([], [], color=MOTION, marker=".", linestyle="", label="nodes of the grid"),
        Line2D([], [], color=LIMIT, linestyle="--", label="limit"),
        Line2D([], [], color=ACCENT, marker="+", linestyle="", label="recovered by inverse dynamics"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=11)
    finish(figure, path, dpi=130)


def phases(solution: Solution | SequenceSolution) -> tuple[tuple[Solution, ...], np.ndarray]:
    """Return the solutions of the legs of a motion, and the times at which they begin [s]."""
    legs = solution.phases if isinstance(solution, SequenceSolution) else (solution,)
    return legs, np.concatenate([[0.0], np.cumsum([leg.duration for leg in legs])[:-1]])


def limits(problem: Problem, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits (n,) along the motion of a signal that is constrained as a whole or component by component."""
    expression = problem.system[name]
    size = expression.numel()
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for constraint in problem.subject_to:
        if constraint.where is Where.ALONG:
            for c, component in enumerate(ca.vertsplit(constraint.expression)):
                for i in range(size):
                    if ca.is_equal(component, expression[i], 4):
                        low[i], high[i] = max(low[i], constraint.lower[c]), min(high[i], constraint.upper[c])
    return low, high


def _problem(solution: Solution) -> Problem:
    if solution.problem is None:
        raise ValueError("picture: this solution was loaded without its model; use load(path, problem=...)")
    return solution.problem


def _signal(system: System, solution: Solution, name: str, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    function = ca.Function("signal", [system.x, system.u, system.p], [ca.densify(system[name])])
    p = np.array([solution.values[key] for key in system.nominal])[:, None]
    return np.array(function.map(len(x))(x.T, u.T, np.tile(p, len(x)))).T


def _draw_limits(axes: Axes, low: float, high: float) -> None:
    """Draw the limits that lie near the motion; one far outside would flatten the curve."""
    bottom, top = axes.get_ylim()
    reach = max(top - bottom, 1e-12)
    for side in (low, high):
        if np.isfinite(side) and bottom - 1.5 * reach <= side <= top + 1.5 * reach:
            axes.axhline(side, color=LIMIT, linestyle="--", linewidth=1.0, zorder=2)


def _path_in_space(figure: Figure, place: object, solution: Solution | SequenceSolution, machine: Manipulator) -> None:
    axes = figure.add_subplot(place, projection="3d")
    lines = ca.Function("skeleton", [machine.q], [ca.densify(machine.skeleton)])
    t = np.linspace(0.0, solution.duration, 200)
    q = solution.signal("q", t)
    corners = np.array([np.array(lines(qk)) for qk in q])  # (200, 3, k)
    tool = corners[:, :, -1]
    shown = np.linspace(0, len(t) - 1, POSES).round().astype(int)
    for place_, k in enumerate(shown):
        edge = place_ in (0, POSES - 1)
        colour = MOTION if edge else FAINT
        axes.plot(*corners[k], "-o", color=colour, linewidth=2.2 if edge else 1.0, markersize=3 if edge else 1.5)
    axes.plot(*tool.T, color=ACCENT, linewidth=2.0)
    axes.scatter(*tool[0], color=MOTION, s=28, marker="o")
    axes.scatter(*tool[-1], color=MOTION, s=36, marker="s")
    axes.text(*tool[0], "  start", fontsize=9)
    axes.text(*tool[-1], "  end", fontsize=9)
    everything = corners.transpose(0, 2, 1).reshape(-1, 3)
    middle = (everything.max(axis=0) + everything.min(axis=0)) / 2.0
    half = max(np.ptp(everything, axis=0).max() / 2.0, 1e-6) * 1.05
    for axis, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{axis}lim")(centre - half, centre + half)
        getattr(axes, f"set_{axis}label")(f"{axis} [m]", fontsize=9)
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=0.88)
    axes.tick_params(labelsize=7, pad=0)
    axes.set_title("path of the tool, and the arm at seven equal times", fontsize=10)


def pretty(label: str) -> str:
    """Return a label with its letters as mathematics."""
    greek = ("theta", "psi", "phi", "xi")
    name, _, unit = label.partition(" ")
    for letter in greek:
        name = name.replace(letter, rf"\{letter}")
    dotted = name.startswith("d") and name.endswith("/dt")
    name = name[1:-3] if dotted else name
    head, _, tail = name.partition("_")
    head = r"\tau" if head == "tau" else head
    tail, digit = (tail[:-1], tail[-1]) if tail[-1:].isdigit() else (tail, "")
    if not tail and head[-1:].isdigit():
        head, digit = head[:-1], head[-1]
    index = f"{tail}_{digit}" if tail and digit else tail + digit
    head = rf"\dot{{{head}}}" if dotted else head
    return f"${head}_{{{index}}}$ {unit}" if index else f"${head}$ {unit}"
