"""Report of an effect budget: what each effect costs, and the motions with and without it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from reports.effect_budget import Budget, Row
from reports.scene_toml import as_toml

from html_reports import page
from html_reports.playback import FRAMES, SCRIPT, playback
from html_reports.time_curves import Panel, colour_of, time_curves
from models import Scene
from models.plots.signals import links, skeleton
from models.scenes.task import Task
from models.scenes.toml_document import Table
from ocp import SequenceSolution, Solution
from ocp.checks import Array

SAMPLES = 241  # of a curve
COSTS = "Time of the whole scene less time without the effect. Below the error of the grid it means nothing."
MORE, LESS = "#1f4e79", "#d98c1f"
Motion = Solution | SequenceSolution


def write_budget_report(path: Path, budget: Budget, scene: Scene, task: Task, document: Table) -> None:
    """Write the report of a budget.

    Args:
        path: of the page (.html).
        budget: of the scene, with its motions.
        scene: machine and effects.
        task: with its obstacles.
        document: the scene file.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    whole = budget.rows[0]
    solved = [(row, motion) for row, motion in zip(budget.rows, budget.motions, strict=True) if motion is not None]
    rows = [row for row, _ in solved if row.name]
    sections = [page.verdict(_sentence(whole, rows), whole.ok)]
    scripts = []
    if whole.ok:
        motion = budget.motions[0]
        assert motion is not None
        t = np.linspace(0.0, whole.duration, FRAMES)
        q = np.atleast_2d(motion.signal("q", t))
        space = playback(t, skeleton(scene.machine, q), task.drawn, None, links(scene.machine, q))
        for number, (row, one) in enumerate(solved[1:], 1):
            poses = skeleton(scene.machine, np.atleast_2d(one.signal("q", _times(one))))
            space.add_trace(_path(poses[:, -1], row.name, colour_of(number)))
        sections += [
            page.section("What each effect costs", page.figure(_costs(rows, whole), "costs", COSTS)) if rows else "",
            page.section("Peak torques without each effect", page.figure(_peaks(budget, solved), "peaks")),
            page.section("The motion of the whole scene, and the paths without each effect", page.figure(
                space, "arm", "A click on a name of the legend hides a path.")),
            page.section("With and without", _key(solved), page.figure(
                _curves(scene, solved), "curves", "Thick: the whole scene; thin: without one effect.")),
        ]  # fmt: skip
        sections.append(page.data("times", np.round(t, 6).tolist()))
        scripts = [SCRIPT]
    sections += [
        page.section("Table", page.table(_head(budget), [_cells(row, whole) for row in budget.rows]), page.listed([
            "Every row is a solve of its own, of the scene that never heard of the effect; nothing is linearised.",
            "work: what the drives deliver, braking not counted; net: braking counted as recovered.",
        ])),
        page.section("Notes", page.listed([f"{_name(row)}: {row.message}" for row in budget.rows if row.message])),
        page.section("The scene file that made it", page.preformatted(as_toml(document.entries)),
                     page.preformatted(f"{scene.card()}\n{task.card(scene.system)}", "Card of the scene and the task")),
    ]  # fmt: skip
    page.write(path, f"What each effect of the {scene.machine.name} manipulator costs", sections, scripts)


def _sentence(whole: Row, rows: list[Row]) -> str:
    if not whole.ok:
        return f"NOT VERIFIED: the whole scene has no verified motion, so there is nothing to compare: {whole.message}"
    if not rows:
        return f"The whole scene takes {whole.duration:.5g} s; there is no effect that it could be without."
    dearest = max(rows, key=lambda row: whole.duration - row.duration)
    cost = whole.duration - dearest.duration
    return (
        f"The whole scene takes {whole.duration:.5g} s. The dearest effect is {dearest.name}: {cost:+.4f} s, "
        f"{100 * cost / whole.duration:.2g} % of the time."
    )


def _costs(rows: list[Row], whole: Row) -> Any:
    go = page.plotly()
    ordered = sorted(rows, key=lambda row: whole.duration - row.duration)
    costs = [1e3 * (whole.duration - row.duration) for row in ordered]
    bars = go.Bar(
        x=costs, y=[row.name for row in ordered], orientation="h", hovertemplate="%{y}: %{x:.4g} ms<extra></extra>",
        marker={"color": [MORE if cost > 0.0 else LESS for cost in costs]},
    )  # fmt: skip
    drawing = go.Figure(bars).update_xaxes(title_text="costs [ms]")
    return drawing.update_layout(height=110 + 34 * len(rows), margin={"l": 150, "r": 10, "t": 10, "b": 50})


def _peaks(budget: Budget, solved: list[tuple[Row, Motion]]) -> Any:
    """Return the peak torques of every scene, in percent of those of the whole scene."""
    go, whole = page.plotly(), budget.rows[0]
    drawing = go.Figure()
    for i, drive in enumerate(budget.drives):
        peaks = [row.peak[i] for row, _ in solved]
        drawing.add_trace(go.Bar(
            x=[row.name or "whole scene" for row, _ in solved], y=[100.0 * p / (whole.peak[i] or 1.0) for p in peaks],
            customdata=peaks, name=drive, hovertemplate=f"{drive}: %{{customdata:.5g}}<extra>%{{x}}</extra>",
        ))  # fmt: skip
    drawing.update_yaxes(title_text="share of the whole scene [%]")
    return drawing.update_layout(barmode="group", height=380, margin={"l": 60, "r": 10, "t": 10, "b": 60})


def _path(tool: Array, name: str, colour: str) -> Any:
    x, y, z = np.round(tool, 5).T.tolist()
    return page.plotly().Scatter3d(
        x=x, y=y, z=z, mode="lines", name=f"without {name}", line={"width": 3, "color": colour}
    )


def _key(solved: list[tuple[Row, Motion]]) -> str:
    return page.key({_name(row): colour_of(k) for k, (row, _) in enumerate(solved)})


def _times(motion: Motion) -> Array:
    return np.linspace(0.0, motion.duration, SAMPLES)


def _curves(scene: Scene, solved: list[tuple[Row, Motion]]) -> Any:
    """Return position, velocity and drives of all scenes over one axis of time."""
    longest = max(row.duration for row, _ in solved)
    t = np.linspace(0.0, longest, SAMPLES)
    columns = []
    for signal, heading in (("q", "position"), ("v", "velocity"), ("tau", "drive")):
        labels = scene.system.label(signal, len(scene.machine.coordinates))
        lines: list[dict[str, Array]] = [{} for _ in labels]
        for row, motion in solved:
            inside = t <= row.duration
            values = np.full((len(t), len(labels)), np.nan)
            values[inside] = np.atleast_2d(motion.signal(signal, t[inside])).reshape(-1, len(labels))
            for i, own in enumerate(lines):
                own[_name(row)] = values[:, i]
        columns.append([
            Panel(str(label), t, own, heading="" if i else heading)
            for i, (label, own) in enumerate(zip(labels, lines, strict=True))
        ])  # fmt: skip
    return time_curves(columns)


def _head(budget: Budget) -> tuple[str, ...]:
    peaks = (f"peak {drive}" for drive in budget.drives)
    return ("scene", "t_f [s]", "costs [s]", *peaks, "work [J]", "net [J]", "solver [s]")


def _name(row: Row) -> str:
    return f"without {row.name}" if row.name else "whole scene"


def _cells(row: Row, whole: Row) -> tuple[object, ...]:
    if not row.ok:
        return (
            f"{_name(row)}: {'not possible' if row.status is None else 'not verified'}",
            *([float("nan")] * (len(row.peak) + 5)),
        )
    cost = round(whole.duration - row.duration, 6) + 0.0 if row.name and whole.ok else float("nan")
    return (_name(row), row.duration, cost, *row.peak, row.work, row.net, row.seconds)
