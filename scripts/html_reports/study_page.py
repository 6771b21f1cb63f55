"""Report of a study: brushing over all columns, results over the axes, ranking, failures, the motion of a case."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from reports.verdict import diagnosis

from html_reports import page
from html_reports.playback import playback
from models.plots.signals import skeleton
from models.plots.studies import is_grid
from models.plots.study_panels import numeric
from models.scenes.scene import Scene
from models.scenes.task import Task
from ocp import Problem, Sequence, SequenceSolution, StudyTable
from ocp.solution.storage import decode
from ocp.studies.main_effects import influences, jumps

FRAMES, NUMBERS = 31, 60_000  # poses of a motion; coordinates in a page, beyond which motions have fewer poses
BRUSHING = "Drag along an axis to keep the cases of that range; drag a name to move the axis."
BRUSHED = 8  # columns of the parallel coordinates
# A click on a case, in a figure or the table, puts its motion into the playback.
SCRIPT = """
(function () {
  const arm = document.getElementById("arm"), title = document.getElementById("case"), first = window.shown;
  const show = k => {
    const motion = window.motions[k];
    if (!motion || !arm) { return; }
    const at = pose => ({x: pose[0], y: pose[1], z: pose[2]});
    const tool = [0, 1, 2].map(i => motion.poses.map(p => p[i][p[i].length - 1]));
    const frames = motion.poses.map((p, i) => ({name: String(i), data: [at(p)], traces: [0]}));
    const ends = [motion.poses[0], tool, motion.poses[0], tool.map(c => [c[0]]), tool.map(c => [c[c.length - 1]])];
    const data = arm.data.map((trace, i) => i < ends.length ? {...trace, ...at(ends[i])} : trace);
    const names = arm.layout.scene.annotations.map((a, i) => ({...a, ...Object.fromEntries(
      ["x", "y", "z"].map((c, j) => [c, i ? tool[j][tool[j].length - 1] : tool[j][0]]))}));
    const sliders = [{...arm.layout.sliders[0], active: 0}];
    Plotly.react(arm, {data: data, layout: {...arm.layout, sliders: sliders,
      scene: {...arm.layout.scene, annotations: names}}, frames: frames});
    title.textContent = motion.title;
    document.querySelectorAll("tr[data-case]").forEach(r => r.classList.toggle("chosen", r.dataset.case === String(k)));
  };
  document.querySelectorAll("tr[data-case]").forEach(r => r.addEventListener("click", () => show(r.dataset.case)));
  document.querySelectorAll(".plotly-graph-div").forEach(d => d.on("plotly_click", e => {
    const k = e.points[0].customdata;
    if (k !== undefined && d !== arm) { show(k); }
  }));
  show(first);
})();
"""


def write_study_report(
    path: Path, name: str, table: StudyTable, result: str, units: Mapping[str, str],
    at: Callable[[int], tuple[Scene, Task]], text: str,
) -> None:  # fmt: skip
    """Write the report of a study of a scene.

    Args:
        path: of the page (.html).
        name: of the study.
        table: of its cases.
        result: column that is looked at first.
        units: of columns, by name.
        at: number of a case -> its scene and task.
        text: of the study file.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    axes = varying(table)
    motions, drawing = _motions(table, at)
    solved, failed = int(table.ok.sum()), table.failures
    sentence = f"{len(table)} cases, {solved} solved" + (f", {len(failed)} failed" if failed else "")
    odd = [f"cases {a} and {b} probably lie in different local optima" for a, b in jumps(table)[:10]] if solved else []
    some = solved > 0 and bool(axes)
    columns = [*table.axes, result, *[c for c in table.results if c not in (result, "cost") and not c.startswith("d ")]]
    rows = [(k, *(table.cases[k].get(c, table[c][k]) for c in columns), table["way"][k]) for k in range(len(table))]
    head = ("case", *(_label(c, units) for c in columns), "how it was solved")
    sections = [
        page.verdict(sentence, not failed),
        *(page.paragraph(one, "note") for one in odd),
        page.section("All cases at once", page.figure(_parallel(table, axes, result, units), "parallel", BRUSHING))
        if some else "",
        page.section(f"{result} over the axes", page.figure(_over(table, axes, result, units), "over",
                     "A click on a case shows its motion below.")) if some else "",
        page.section("What it depends on", _ranking(table, result)) if some else "",
        page.section("The motion of a case", '<p id="case"></p>', page.figure(drawing, "arm")) if drawing else "",
        page.section("Failures and their diagnosis", page.table(
            ("case", *table.axes, "cause", "remedy"),
            [(k, *(table.cases[k][a] for a in table.axes), *diagnosis(words)) for k, words in failed.items()]),
            page.preformatted("\n\n".join(f"case {k}: {words}" for k, words in failed.items()), "In full")
            if failed else ""),
        page.section("Cases", page.table(head, rows, list(range(len(table))))),
        page.section("The study file that made it", page.preformatted(text)),
    ]  # fmt: skip
    data = page.data("motions", motions) + page.data("shown", next(iter(motions), None))
    page.write(path, f"Study {name}", [data, *sections], [SCRIPT] if motions else [])


def _motions(table: StudyTable, at: Callable[[int], tuple[Scene, Task]]) -> tuple[dict[str, Any], Any]:
    """Return number of a case -> its motion as plain data, and the playback of the first."""
    motions: dict[str, Any] = {}
    drawing, every = None, []
    numbers = [int(k) for k in np.flatnonzero(table.ok)]
    for k in numbers:
        scene, task = at(k)
        problem = task.problem(scene.system)
        solution = table.solution(k, problem) if isinstance(problem, Problem) else _legs(table, k, problem)
        n = 3 * scene.machine.skeleton.shape[1]
        frames = int(np.clip(NUMBERS / (n * len(numbers)) * 3, 8, FRAMES))
        t = np.linspace(0.0, solution.duration, frames)
        corners = skeleton(scene.machine, solution.signal("q", t))
        every.append((t, corners, task))
        given = ", ".join(f"{name} = {_cell(value)}" for name, value in table.cases[k].items())
        motions[str(k)] = {
            "title": f"case {k}: {given}; {solution.duration:.6g} s",
            "poses": np.round(corners, 3).transpose(0, 2, 1).tolist(),
        }
    if every:
        t, corners, task = every[0]
        reach = max((corners for _, corners, _ in every), key=lambda c: float(np.abs(c).max()))
        drawing = playback(np.linspace(0.0, 1.0, len(t)), corners, task.drawn, height=520)
        half = float(np.abs(reach).max()) * 1.05
        drawing.update_layout(scene={f"{c}axis": {"range": [-half, half]} for c in "xyz"})
        drawing.layout.sliders[0].currentvalue = {"prefix": "share of the duration: "}
    return motions, drawing


def _legs(table: StudyTable, number: int, problem: Sequence) -> SequenceSolution:
    """Return the stored motion of a case through points, whose legs are stored apart."""
    result = table.records[number]
    assert result is not None
    legs = []
    for k, part in enumerate(problem.problems, 1):
        content = table.read(result.id, f"phase {k}")
        assert content is not None
        legs.append(decode(content, part, f"leg {k} of case {number}"))
    cost, last = sum(leg.cost for leg in legs), legs[-1]
    return SequenceSolution(tuple(legs), last.status, last.message, last.solver_status, cost, last.timings, 0, problem)


def varying(table: StudyTable) -> list[str]:
    """Return the axes on which solved cases differ, of numbers or texts."""
    return [name for name in table.axes if len(dict.fromkeys(map(str, table[name][table.ok]))) > 1]


def _parallel(table: StudyTable, axes: list[str], result: str, units: Mapping[str, str]) -> Any:
    go, ok = page.plotly(), table.ok
    others = [c for c in table.results if c not in (result, "cost", "iterations") and not c.startswith("d ")]
    chosen = [*axes, result, *(c for c in others if np.ptp(table[c][ok]) > 0.0)][:BRUSHED]
    line = {"color": table[result][ok].tolist(), "colorscale": "Viridis", "showscale": True}
    dimensions = [_dimension(table[c][ok], _label(c, units)) for c in chosen]
    drawing = go.Figure(go.Parcoords(line=line, dimensions=dimensions, labelangle=-12))
    return drawing.update_layout(height=440, margin={"l": 90, "r": 30, "t": 90, "b": 30})


def _dimension(values: Any, label: str) -> dict[str, Any]:
    """Return a column of the parallel coordinates; texts stand at whole numbers."""
    if values.dtype.kind in "fiu":
        return {"label": label, "values": values.tolist(), "tickformat": ".6~g"}
    words = list(dict.fromkeys(map(str, values)))
    numbers = [words.index(str(value)) for value in values]
    return {"label": label, "values": numbers, "tickvals": list(range(len(words))), "ticktext": words}


def _over(table: StudyTable, axes: list[str], result: str, units: Mapping[str, str]) -> Any:
    go, ok = page.plotly(), np.flatnonzero(table.ok)
    drawing = page.plotly("subplots").make_subplots(rows=1, cols=max(2, min(len(axes), 4)))
    label = _label(result, units)
    if len(axes) == 2 and numeric(table) == axes and is_grid(table, axes):
        x, y = (np.unique(table[a]) for a in axes)
        z = np.full((len(y), len(x)), np.nan)
        z[np.searchsorted(y, table[axes[1]][ok]), np.searchsorted(x, table[axes[0]][ok])] = table[result][ok]
        drawing = go.Figure(go.Contour(x=x.tolist(), y=y.tolist(), z=[[_finite(v) for v in row] for row in z],
                                       colorscale="Viridis", colorbar={"title": label}, hoverinfo="skip"))  # fmt: skip
        text = [f"{label} {v:.6g}" for v in table[result][ok]]
        drawing.add_trace(go.Scatter(
            x=table[axes[0]][ok].tolist(), y=table[axes[1]][ok].tolist(), customdata=ok.tolist(), mode="markers",
            text=text, marker={"size": 7, "color": "white", "line": {"width": 1, "color": "black"}},
            hovertemplate="case %{customdata}: %{x:.4g}, %{y:.4g}<br>%{text}<extra></extra>",
        ))  # fmt: skip
        _failed(drawing, table, axes[0], axes[1])
        drawing.update_xaxes(title_text=_label(axes[0], units))
        drawing.update_yaxes(title_text=_label(axes[1], units))
        return drawing.update_layout(height=480, showlegend=False, margin={"l": 60, "r": 10, "t": 20, "b": 50})
    for i, axis in enumerate(axes[:4]):
        hover = f"case %{{customdata}}: {axis} %{{x}}, {result} %{{y:.6g}}<extra></extra>"
        drawing.add_trace(go.Scatter(x=_words(table[axis][ok]), y=table[result][ok].tolist(), customdata=ok.tolist(),
                                     mode="markers", marker={"size": 7, "color": "#1f4e79"}, hovertemplate=hover),
                          1, i + 1)  # fmt: skip
        drawing.update_xaxes(title_text=_label(axis, units), row=1, col=i + 1)
        drawing.update_yaxes(title_text=label if i == 0 else "", row=1, col=i + 1)
    return drawing.update_layout(height=420, showlegend=False, margin={"l": 60, "r": 10, "t": 20, "b": 50})


def _words(values: Any) -> list[Any]:
    """Return values of an axis for a figure: numbers as they are, anything else as text."""
    return values.tolist() if values.dtype.kind in "fiu" else list(map(str, values))


def _failed(drawing: Any, table: StudyTable, x: str, y: str) -> None:
    bad = np.flatnonzero(~table.ok)
    if len(bad):
        drawing.add_trace(page.plotly().Scatter(
            x=table[x][bad].tolist(), y=table[y][bad].tolist(), mode="markers",
            text=[table.failures.get(int(k), "") for k in bad], hovertemplate="%{text}<extra></extra>",
            marker={"size": 10, "symbol": "x", "color": "#b03a2e"},
        ))  # fmt: skip


def _ranking(table: StudyTable, result: str) -> str:
    try:
        rows = influences(table, result)
    except (ValueError, KeyError) as error:
        return page.paragraph(f"No ranking: {error.args[0]}", "note")
    bars = page.plotly().Figure(page.plotly().Bar(
        x=[row.elasticity for row in rows][::-1], y=[row.axis for row in rows][::-1], orientation="h",
        marker={"color": "#1f4e79"}, hovertemplate="%{y}: %{x:.3g} % per %<extra></extra>"))  # fmt: skip
    bars.update_layout(height=120 + 36 * len(rows), margin={"l": 160, "r": 10, "t": 10, "b": 50})
    bars.update_xaxes(title_text=f"elasticity of {result} [% per %]")
    cells = [(row.axis, row.elasticity, row.effect, 100.0 * row.share) for row in rows]
    return page.figure(bars, "ranking") + page.table(
        ("axis", "elasticity [% per %]", "main effect", "share [%]"), cells
    )


def _label(name: str, units: Mapping[str, str]) -> str:
    return f"{name} [{units[name]}]" if units.get(name) else name


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
