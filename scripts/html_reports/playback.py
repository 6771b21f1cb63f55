"""Playback of a motion in space, and a cursor of time that it shares with the curves of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from html_reports.page import plotly
from models.plots.space import bounds, surfaces
from models.plots.surfaces import Mesh
from models.scenes.task import Obstacle
from ocp.checks import Array
from ocp.problem.regions import Region

FRAMES = 81  # poses of a playback
ARM, PATH, MARK, SOLID = "#1f4e79", "#d98c1f", "#b03a2e", "#8f7f72"
# The cursor follows the playback; a click on a curve moves the arm to that time.
SCRIPT = """
(function () {
  const arm = document.getElementById("arm"), times = window.times;
  const curves = Array.from(document.querySelectorAll(".plotly-graph-div")).filter(d => d.id.startsWith("curves"));
  const cursor = k => curves.forEach(d => {
    const change = {};
    d.layout.shapes.forEach((s, i) => { if (s.name === "cursor") {
      change["shapes[" + i + "].x0"] = times[k]; change["shapes[" + i + "].x1"] = times[k]; } });
    Plotly.relayout(d, change);
  });
  arm.on("plotly_animatingframe", e => cursor(Number(e.name)));
  curves.forEach(d => d.on("plotly_click", e => {
    const t = e.points[0].x, k = times.reduce((b, s, i) => Math.abs(s - t) < Math.abs(times[b] - t) ? i : b, 0);
    Plotly.animate(arm, [String(k)], {mode: "immediate", frame: {duration: 0, redraw: true}});
  }));
})();
"""


def playback(
    t: Array, corners: Array, obstacles: Sequence[Obstacle | Region] = (), via: Array | None = None,
    links: Sequence[Mesh] = (), height: int = 640,
) -> Any:  # fmt: skip
    """Return a figure with a slider of time and a play button; a motion of no length is a still picture.

    Args:
        t: (K,) times of the poses, equally far apart [s].
        corners: (K, k, 3) of the arm, from the base to the tool [m].
        obstacles: of the task.
        via: (m, 3) points that the tool passes [m], or None.
        links: surface of the links at each time; () for lines alone.
        height: of the figure in pixels.
    """
    go = plotly()
    middle, half = bounds(np.vstack([corners.reshape(-1, 3), *(points for points, _ in links)]))
    shapes = surfaces(obstacles, middle, half)
    for one in shapes:
        half = max(half, min(float(np.abs(one.mesh[0] - middle).max()), 1.5 * half))
    points = np.round(corners, 5)
    drawing = go.Figure(data=[_arm(points[0]), *_still(points, shapes, via), *_hull(links[:1])])
    moved = [0, len(drawing.data) - 1] if links else [0]
    if t[-1] > t[0]:
        drawing.frames = [
            go.Frame(name=str(k), data=[_arm_at(pose), *_hull_at(links[k : k + 1])], traces=moved)
            for k, pose in enumerate(points)
        ]
    drawing.update_layout(
        height=height,
        margin={"l": 0, "r": 0, "t": 10, "b": 0},
        scene={
            **{
                f"{c}axis": {"title": f"{c} [m]", "range": [at - half, at + half]}
                for c, at in zip("xyz", middle, strict=True)
            },
            "aspectmode": "cube",
            "camera": {"eye": {"x": 1.3, "y": -1.4, "z": 0.8}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}},
            "annotations": ends_named(points[:, -1]),
        },
        legend={"x": 0.0, "y": 1.0, "bgcolor": "rgba(255,255,255,0.6)"},
    )
    return _moving(drawing, t) if drawing.frames else drawing


def ends_named(tool: Array) -> list[dict[str, Any]]:
    """Return the words beside both ends of the path (K, 3) of the tool; they are never hidden by the arm."""
    ends = [("start", tool[0]), ("goal", tool[-1])]
    if np.allclose(tool[0], tool[-1]):
        ends = [("start and goal", tool[0])]
    return [
        {**dict(zip("xyz", point.tolist(), strict=True)), "text": text, "showarrow": False, "yshift": 14}
        for text, point in ends
    ]


def _moving(drawing: Any, t: Array) -> Any:
    """Return the figure with a slider of time and the buttons that play it."""
    step = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    play = {"fromcurrent": True, "frame": {"duration": 40, "redraw": True}, "transition": {"duration": 0}}
    return drawing.update_layout(
        sliders=[{
            "currentvalue": {"prefix": "t = ", "suffix": " s"}, "pad": {"t": 10, "b": 10}, "x": 0.12, "len": 0.86,
            "steps": [
                {"method": "animate", "label": f"{time:.3f}", "args": [[str(k)], step]} for k, time in enumerate(t)
            ],
        }],
        updatemenus=[{
            "type": "buttons", "direction": "left", "x": 0.0, "y": 0.0, "xanchor": "left", "yanchor": "top",
            "pad": {"t": 38}, "showactive": False,
            "buttons": [
                {"label": "Play", "method": "animate", "args": [None, play]},
                {"label": "Pause", "method": "animate", "args": [[None], step]},
            ],
        }],
    )  # fmt: skip


def _arm_at(pose: Array) -> dict[str, Any]:
    return {"type": "scatter3d", **_coordinates(pose)}


def _hull_at(surfaces: Sequence[Mesh]) -> list[dict[str, Any]]:
    return [{"type": "mesh3d", **_coordinates(np.round(points, 4))} for points, _ in surfaces]


def _hull(surfaces: Sequence[Mesh]) -> list[Any]:
    """Return the surface of the links at the first time as a trace, if there is one."""
    style = {"name": "links", "color": ARM, "opacity": 0.35, "showlegend": True, "hoverinfo": "skip"}
    return [
        plotly().Mesh3d(
            **_coordinates(np.round(points, 4)), **dict(zip("ijk", triangles.T.tolist(), strict=True)), **style
        )
        for points, triangles in surfaces
    ]


def _arm(pose: Array) -> Any:
    style = {"line": {"width": 9, "color": ARM}, "marker": {"size": 4, "color": ARM}}
    return plotly().Scatter3d(**_coordinates(pose), mode="lines+markers", name="arm", **style)


def _still(points: Array, shapes: Sequence[Any], via: Array | None) -> list[Any]:
    go, tool = plotly(), points[:, -1]
    traces = [
        go.Scatter3d(**_coordinates(tool), mode="lines", name="path of the tool", line={"width": 5, "color": PATH}),
        go.Scatter3d(**_coordinates(points[0]), mode="lines", name="arm at the start",
                     line={"width": 3, "color": "#9aa5b1"}),
        go.Scatter3d(**_coordinates(tool[:1]), mode="markers", name="start", marker={"size": 6, "color": ARM}),
        go.Scatter3d(**_coordinates(tool[-1:]), mode="markers", name="goal",
                     marker={"size": 6, "symbol": "square", "color": PATH}),
    ]  # fmt: skip
    if via is not None and len(via):
        marker = {"size": 5, "symbol": "diamond", "color": MARK}
        traces.append(go.Scatter3d(**_coordinates(via), mode="markers", name="via points", marker=marker))
    for one in shapes:
        (x, y, z), (i, j, k) = np.round(one.mesh[0], 5).T, one.mesh[1].T
        name = f"{one.name} ({'kept inside' if one.inside else 'obstacle'})"
        traces.append(go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, name=name, color=SOLID, showlegend=True,
                                opacity=0.15 if one.inside else 0.5))  # fmt: skip
    return traces


def _coordinates(points: Array) -> dict[str, list[float]]:
    return dict(zip("xyz", points.T.tolist(), strict=True))
