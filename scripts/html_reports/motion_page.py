"""Report of a solved motion: verdict, playback, curves, what limits it and what it would gain, tables, scene file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from reports.motion_clearance import Clearances, unkept
from reports.scene_toml import as_toml
from reports.verdict import Verdict

from html_reports import page
from html_reports.clearance_table import clearance_table
from html_reports.playback import FRAMES, SCRIPT, playback
from html_reports.time_curves import Panel, time_curves
from models import Scene
from models.plots.signals import SHARES, Curves, curves, links, minimised, phases, skeleton
from models.plots.structures import COLOURS, SAMPLED, WORDS, along_motion
from models.scenes.task import Task
from models.scenes.toml_document import Table
from ocp import Problem, Report, SequenceSolution, Solution, sensitivity
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.solution.structure import Kind, Row

MORE = 0.1  # share by which a limit is widened in the table of what that would gain
TURN, GO = "Drag to turn, scroll to zoom.", " The slider and a click on a curve below go to a time."
MOST = 900  # points of a curve that are drawn without thinning
AT_LIMIT = 1e-3  # share of the range within which a drive counts as at its limit


def write_motion_report(
    path: Path, solution: Solution | SequenceSolution, scene: Scene, task: Task, document: Table, report: Report,
    result: Verdict, clear: Clearances = (),
) -> None:  # fmt: skip
    """Write the report of a motion.

    Args:
        path: of the page (.html).
        solution: of the task, of any status.
        scene: machine and effects.
        task: with its obstacles.
        document: the scene file, with what the options of the command changed.
        report: of `verify`.
        result: verdict on the motion.
        clear: least distances of the links.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    legs, begins = phases(solution)
    moves = solution.duration > 0.0
    t = np.linspace(0.0, solution.duration, FRAMES if moves else 1)
    via = skeleton(scene.machine, np.atleast_2d(solution.signal("q", begins[1:])))[:, -1] if len(legs) > 1 else None
    q = np.atleast_2d(solution.signal("q", t))
    space = playback(t, skeleton(scene.machine, q), task.drawn, via, links(scene.machine, q))
    shown = curves(solution)
    rows = solution.structure.rows if isinstance(solution, Solution) and solution.structure is not None else ()
    sections = [
        page.verdict(str(result), result.ok),
        page.paragraph(_summary(solution, scene, shown)),
        page.section("The motion" if moves else "The position", page.figure(space, "arm", TURN + GO * moves)),
        page.section("Position, velocity and drives over time", page.figure(
            time_curves([_panels(one, rows) for one in shown]), "curves",
            "Dashed: limits. Shaded: times at which a limit is active (blue the lower, orange the upper one)" +
            (", for the drives the arcs of the switching structure." if rows else "."))) if moves else "",
        page.section("What limits it", _drives(shown[-1]), _gains(solution)) if moves else "",
        page.section("How near the links come", clearance_table(clear), page.listed(unkept(task))) if clear else "",
        _structure(solution, rows),
        page.section("How accurate it is", _accuracy(report)) if solution.ok else
        page.section("What the solver found", page.listed(solution.message.split("; "))),
        page.section("The scene file that made it", page.preformatted(as_toml(document.entries)),
                     page.preformatted(f"{scene.card()}\n{task.card(scene.system)}", "Card of the scene and the task")),
    ]  # fmt: skip
    title = f"{minimised(solution).capitalize()} of the {scene.machine.name} manipulator"
    title += "" if solution.ok else ": no motion found"
    page.write(path, title, [page.data("times", np.round(t, 6).tolist()), *sections], [SCRIPT] * moves)


def _summary(solution: Solution | SequenceSolution, scene: Scene, shown: Sequence[Curves]) -> str:
    form = f"{scene.form_name} form, frame {scene.frame_name}"
    if not solution.ok:
        return f"There is no motion ({form}). What is shown below is where the solver stopped; it breaks constraints."
    if not solution.duration > 0.0:
        return f"Start and goal coincide: nothing moves, and it takes 0 s ({form})."
    drives = shown[-1]
    busy = []
    for i, label in enumerate(drives.labels):
        share = _at_limit(drives, i)
        if share > 0.01:
            busy.append(f"{label.partition(' ')[0]} {100 * share:.0f} %")
    limited = f"Share of the time at a limit of the drive: {', '.join(busy)}." if busy else "No drive is at its limit."
    legs = f" in {len(solution.phases)} legs" if isinstance(solution, SequenceSolution) else ""
    return f"The motion takes {solution.duration:.6g} s{legs} ({form}). {limited}"


def _at_limit(drives: Curves, i: int) -> float:
    """Return the share of the time at which a drive is at one of its limits."""
    low, high, values = drives.lower[:, i], drives.upper[:, i], drives.values[:, i]
    near = AT_LIMIT * np.where(np.isfinite(high - low), high - low, 0.0)
    active = ((values <= low + near) | (values >= high - near)).astype(float)
    steps = np.diff(drives.t)
    return float(np.sum(steps * (active[1:] + active[:-1]) / 2.0) / max(drives.t[-1], 1e-300))


def _panels(curve: Curves, rows: Sequence[Row]) -> list[Panel]:
    panels, kept = [], _kept(len(curve.t), len(SHARES))
    for i, label in enumerate(curve.labels):
        own = [row for row in rows if curve.name in ("tau", "u") and row.name == label.partition(" ")[0]]
        spans = [(row.start, row.end, COLOURS[row.kind]) for row in own if row.kind is not Kind.TOUCH]
        lower, upper = curve.lower[kept, i], curve.upper[kept, i]
        heading = curve.heading if i == 0 else ""
        panels.append(Panel(label, curve.t[kept], {"": curve.values[kept, i]}, lower, upper, heading, spans))
    return panels


def _kept(count: int, samples: int) -> Array:
    """Return the samples that are drawn: all, or start, middle and end of every element of a fine grid."""
    remainders = np.arange(count) % samples
    return np.flatnonzero((remainders % (samples // 2) == 0) | (count <= MOST))


def _drives(drives: Curves) -> str:
    steps = np.diff(drives.t)
    rows = []
    for i, label in enumerate(drives.labels):
        values = drives.values[:, i]
        rms = np.sqrt(np.sum(steps * (values[1:] ** 2 + values[:-1] ** 2) / 2.0) / max(drives.t[-1], 1e-300))
        finite = drives.upper[np.isfinite(drives.upper[:, i]), i]
        limit = np.max(finite) if len(finite) else np.inf
        rows.append(
            (label, float(values[np.argmax(np.abs(values))]), float(rms), float(limit), 100 * _at_limit(drives, i))
        )
    return page.table(("drive", "peak", "rms", "limit", "time at a limit [%]"), rows)


def _gains(solution: Solution | SequenceSolution) -> str:
    """Return what the limits are worth, to first order."""
    if not isinstance(solution, Solution) or solution.problem is None or not solution.ok:
        return ""
    moved = _one_limit_moved(solution.problem)
    if moved is None:
        return ""
    try:
        limits = sensitivity(solution, toward={"a limit": moved}).limits
    except (ValueError, TypeError, RuntimeError) as error:
        return page.paragraph(f"What the limits are worth is not known: {error}", "note")
    rows = []
    for one in limits:
        if one.where is Where.ALONG and one.limit != 0.0:
            change = MORE * abs(one.limit) * (-1.0 if one.side == "lower" else 1.0)
            unit = f" {one.unit}" if one.unit not in ("", "1") else ""
            rows.append((f"{one.name}, {one.side} limit {one.limit:.6g}{unit}", one.cost, -one.cost * change))
    rows.sort(key=lambda row: -row[2])
    quickest = minimised(solution) == "shortest time"
    factor, unit = (1e3, "ms") if quickest else (1.0, "of the cost")
    head = ("limit that is met", "d cost / d limit", f"{100 * MORE:.0f} % wider saves [{unit}]")
    note = page.paragraph("To first order, from the multipliers." if rows else "", "note")
    return page.table(head, [(*row[:2], factor * row[2]) for row in rows]) + note


def _one_limit_moved(problem: Problem) -> Problem | None:
    """Return the problem with one finite limit along the motion moved by one unit, which opens the table of all."""
    for number, constraint in enumerate(problem.subject_to):
        if constraint.where is Where.ALONG and np.isfinite(constraint.upper).any():
            upper = np.where(np.isfinite(constraint.upper), constraint.upper + 1.0, constraint.upper)
            others = list(problem.subject_to)
            others[number] = replace(constraint, upper=upper)
            return replace(problem, subject_to=tuple(others))
    return None


def _structure(solution: Solution | SequenceSolution, rows: Sequence[Row]) -> str:
    if not rows or not isinstance(solution, Solution) or solution.problem is None:
        return ""
    t, _, values, hamiltonian, _ = along_motion(solution, solution.problem)
    kept = _kept(len(t), len(SAMPLED))
    t, values, hamiltonian = t[kept], values[kept], hamiltonian[kept]
    labels = solution.problem.system.label("u", values.shape[1])
    panels = []
    for i, label in enumerate(labels):
        own = [
            (row.start, row.end, COLOURS[row.kind])
            for row in rows
            if row.name == label.name and row.kind is not Kind.TOUCH
        ]
        panels.append(Panel(f"dH/d{label.name} [cost/s]", t, {"": values[:, i]}, spans=own))
    panels.append(Panel("H - mean [cost/s]", t, {"": hamiltonian}))
    half = -(-len(panels) // 2)
    drawing = time_curves([column for column in (panels[:half], panels[half:]) if column])
    table = page.table(
        ("drive or limit", "what", "from [s]", "to [s]"),
        [(r.name, WORDS.get(r.kind, "at a limit of the states"), r.start, r.end) for r in rows],
    )
    caption = (
        "Switching functions, times half the range of the drive: the lower limit is optimal where one is > 0, "
        "the upper one where it is < 0."
    )
    return page.section("Switching structure", page.figure(drawing, "curves-switching", caption), table)


def _accuracy(report: Report) -> str:
    rows = [
        ("drift", str(report.drift), "re-integrated with its own controls at 1e-12, against the solution"),
        ("violation", str(report.violation), "limits, between nodes included"),
        ("Hamiltonian", f"{report.hamiltonian_value:.6g}", "its mean; -1 for the shortest time"),
        (
            "switching",
            str(report.switching) if np.isfinite(report.switching) else "not defined: limits couple the drives",
            "what the controls could still gain, to first order",
        ),
        ("energy", str(report.energy), "work of the drives less losses less change of energy"),
    ]
    return page.table(("check", "figure", "of what"), rows) + page.listed(report.failures)
