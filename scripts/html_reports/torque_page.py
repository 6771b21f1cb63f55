"""Report of the torques of a motion: playback, torques with their split, torque over speed, loads of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from reports.motion_clearance import Clearances
from reports.scene_toml import as_toml

from html_reports import page
from html_reports.clearance_table import clearance_table
from html_reports.playback import FRAMES, SCRIPT, playback
from html_reports.time_curves import HIGH, Panel, colour_of, time_curves
from models import Motion, Scene, TorqueTable
from models.plots.signals import links, skeleton
from models.plots.torque_bounds import Limits, drive_limits
from models.scenes.task import Obstacle
from models.scenes.toml_document import Table
from ocp.checks import Array

MOST = 600  # points of a curve
MOST_PLANES = 4  # panels beside each other


def write_torque_report(
    path: Path, motion: Motion, table: TorqueTable, scene: Scene, document: Table | None, broken: list[str],
    limits: Limits | None = None, obstacles: Sequence[Obstacle] = (), clear: Clearances = (),
) -> None:  # fmt: skip
    """Write the report of a torque table.

    Args:
        path: of the page (.html).
        motion: of the table.
        table: torques with their split and loads.
        scene: machine and effects.
        document: the scene file, or None without one.
        broken: sentences about limits that are exceeded.
        limits: of the scene on signals.
        obstacles: of the task of the scene file.
        clear: least distances of the links.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    bounds = drive_limits(table, limits)
    kept = np.unique(np.linspace(0, len(table.t) - 1, min(MOST, len(table.t))).round().astype(int))
    t = np.linspace(float(table.t[0]), float(table.t[-1]), FRAMES)
    q = motion.q(t)
    space = playback(t, skeleton(table.machine, q), obstacles, None, links(table.machine, q))
    rows = [
        (load.name, load.unit, load.peak, load.rms, load.speed, load.mean_power, load.peak_power)
        for load in table.loads
    ]
    head = ("drive", "unit", "peak", "rms", "speed [rad/s or m/s]", "mean power [W]", "peak power [W]")
    parts = [(name, *np.sqrt(np.mean(part**2, axis=0)).tolist()) for name, part in table.split.items()]
    drives = [f"{c.name} [{c.force_unit}]" for c in table.machine.coordinates]
    text = f"limits are exceeded: {'; '.join(broken)}" if broken else _kept(bounds)
    sections = [
        page.verdict(text, not broken),
        page.paragraph(f"{motion!r}. {'; '.join(motion.notes)}"),
        page.section("The motion", page.figure(space, "arm", "The slider and a click on a curve below go to a time.")),
        page.section("Torques and their parts", page.key(
            {name: colour_of(k) for k, name in enumerate(["torque", *table.split])}), page.figure(
            time_curves([_torques(table, kept, bounds), _speeds(table, kept), _powers(table, kept)]), "curves",
            "Thick: the torque; thin: its parts by cause. Dashed: what the drive has. Shaded: nothing is left.")),
        page.section("Torque over speed", page.figure(_planes(table, kept, bounds), "planes")),
        page.section("How near the links come", clearance_table(clear)) if clear else "",
        page.section("Loads of the drives", page.table(head, rows)),
        page.section("Parts of the torque, root mean square", page.table(("part", *drives), parts)),
        page.section("The scene", page.preformatted(as_toml(document.entries)) if document is not None else "",
                     page.preformatted(scene.card(), "Card of the scene")),
    ]  # fmt: skip
    times = page.data("times", np.round(t, 6).tolist())
    page.write(path, f"Torques of a motion of the {table.machine.name} manipulator", [times, *sections], [SCRIPT])


def _kept(bounds: tuple[Array, Array]) -> str:
    known = any(np.isfinite(side).any() for side in bounds)
    return "all limits are kept" if known else "no limits of the drives were given: see --limit, --speed"


def _torques(table: TorqueTable, kept: Array, bounds: tuple[Array, Array]) -> list[Panel]:
    panels = []
    for i, c in enumerate(table.machine.coordinates):
        lines = {"torque": table.tau[kept, i], **{name: part[kept, i] for name, part in table.split.items()}}
        spans = [(span.start, span.end, HIGH) for span in table.loads[i].exceeded]
        lower, upper = (side[kept, i] for side in bounds)
        heading = "torque and its parts" if i == 0 else ""
        panels.append(Panel(f"tau_{c.name} [{c.force_unit}]", table.t[kept], lines, lower, upper, heading, spans))
    return panels


def _speeds(table: TorqueTable, kept: Array) -> list[Panel]:
    return [
        Panel(f"d{c.name}/dt [{c.unit}/s]", table.t[kept], {"": table.v[kept, i]}, heading="" if i else "speed")
        for i, c in enumerate(table.machine.coordinates)
    ]


def _powers(table: TorqueTable, kept: Array) -> list[Panel]:
    return [
        Panel(f"power of {c.name} [W]", table.t[kept], {"": table.power[kept, i]}, heading="" if i else "power")
        for i, c in enumerate(table.machine.coordinates)
    ]


def _planes(table: TorqueTable, kept: Array, bounds: tuple[Array, Array]) -> Any:
    go, coordinates = page.plotly(), table.machine.coordinates
    rows = -(-len(coordinates) // MOST_PLANES)
    columns = -(-len(coordinates) // rows)
    drawing = page.plotly("subplots").make_subplots(
        rows=rows, cols=columns, horizontal_spacing=0.24 / columns, vertical_spacing=0.36 / rows
    )
    for i, c in enumerate(coordinates):
        place = {"row": 1 + i // columns, "col": 1 + i % columns}
        v, tau = table.v[kept, i], table.tau[kept, i]
        hover = f"%{{x:.4g}} {c.unit}/s, %{{y:.5g}} {c.force_unit}, t = %{{customdata:.4g}} s<extra></extra>"
        drawing.add_trace(go.Scatter(x=v.tolist(), y=tau.tolist(), customdata=table.t[kept].tolist(), mode="lines",
                                     line={"color": "#1f4e79"}, hovertemplate=hover, name=c.name),
                          **place)  # fmt: skip
        if table.limits:
            limit = table.limits[i]
            fastest = 1.15 * max(float(np.max(np.abs(table.v[:, i]))), 1e-9)
            fastest = max(fastest, min(limit.speed, 3.0 * fastest)) if np.isfinite(limit.speed) else fastest
            speeds = np.linspace(-fastest, fastest, 201)
            allowed = np.asarray(limit.torque(speeds))
            for sign in (-1.0, 1.0):
                y = [float(sign * a) if np.isfinite(a) else None for a in allowed]
                line = {"color": "#b03a2e", "dash": "dash"}
                drawing.add_trace(go.Scatter(x=speeds.tolist(), y=y, mode="lines", line=line, name="limit"), **place)
        else:
            order = kept[np.argsort(v)]
            for side in bounds:
                y = [float(a) if np.isfinite(a) else None for a in side[order, i]]
                line = {"color": "#b03a2e", "dash": "dash"}
                drawing.add_trace(go.Scatter(x=table.v[order, i].tolist(), y=y, mode="lines", line=line, name="limit"),
                                  **place)  # fmt: skip
        drawing.update_xaxes(title_text=f"d{c.name}/dt [{c.unit}/s]", **place)
        drawing.update_yaxes(title_text=f"tau_{c.name} [{c.force_unit}]", **place)
    return drawing.update_layout(height=60 + 300 * rows, showlegend=False, margin={"l": 60, "r": 10, "t": 20, "b": 50})
