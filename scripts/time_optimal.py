"""Time-optimal motion of a manipulator: solve, verify, recover the drive torques, draw pictures, write a report.

The default is the spherical manipulator under gravity in canonical form, rest to rest. Angles are in rad, lengths in
m, torques in N m and forces in N, in the order of the coordinates. A scene file holds everything; see --template.
"""

from __future__ import annotations

from reports.command import command_parser, exit_with  # first: it decides how pictures are drawn

# isort: split

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from reports import effect_budget as budget
from reports.arm_template import template
from reports.controller_files import write_at_rate
from reports.motion_account import Files, account, describe, named
from reports.motion_clearance import clearances, unkept
from reports.motion_solving import add_solving, checks_of, find
from reports.motion_table import at_points, tabulate, write_csv
from reports.output import add_output, output_folder, working
from reports.own_models import add_own_models, include_own_models
from reports.verdict import verdict

from models import Motion, Scene, plots
from models.forms import inverse
from models.plots.signals import curve, minimised, phases
from models.scenes import catalogue
from models.scenes.scene_template import TASKS, scene_text
from models.scenes.task import Task
from models.scenes.task_file import of_document
from models.scenes.toml_document import SceneError, Table, parse, read_document
from ocp import SequenceSolution, Solution, save, uniform, verify

EXAMPLES = """examples:
  python scripts/time_optimal.py                                 the default task of the spherical manipulator
  python scripts/time_optimal.py --machine torus --polish        exact switching times, with their table
  python scripts/time_optimal.py --template torus > arm.toml     a commented scene file to start from
  python scripts/time_optimal.py --template ur5.urdf > arm.toml  of a robot description, or of a robot by name: ur5
  python scripts/time_optimal.py arm.toml --card                 what it is, before it is solved
  python scripts/time_optimal.py arm.toml --report               an HTML report with the motion in 3D
  python scripts/time_optimal.py arm.toml --budget               what each effect costs

Angles in rad, lengths in m, torques in N m, forces in N, in the order of the coordinates: spherical (theta, psi, phi,
r), cylindrical (phi, xi, r), torus (q1, q2, q3). theta = 0 is the vertical.
Exit status: 0 verified, 1 no verified solution, 2 wrong usage."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 for a verified solution, 1 for none, 2 for wrong usage."""
    parser = command_line()
    options = parser.parse_args(arguments)
    try:
        include_own_models(options)
        if options.template:
            print(template(options.template), end="")
            return 0
        scene, task, document = chosen(parser, options)
    except (SceneError, ValueError) as error:
        print(f"time_optimal: {error}", file=sys.stderr)
        return 2
    task = task if options.nodes is None else replace(task, elements=options.nodes)
    if options.card:
        print(f"{scene.card()}\n{task.card(scene.system)}")
        return 0
    quiet = options.quiet or options.json
    try:
        if options.report or not options.budget:
            options.output = output_folder(options, "budget" if options.budget else "time_optimal")
    except (OSError, ImportError) as error:
        print(f"time_optimal: {error}", file=sys.stderr)
        return 2
    if options.budget:
        return print_budget(scene, task, document, options)
    return find_motion(scene, task, document, options, _silent if quiet else print)


def print_budget(scene: Scene, task: Task, document: Table, options: argparse.Namespace) -> int:
    """Solve the scene with each effect left out, print what each costs, and write the report if asked for."""
    quiet, begun = options.quiet or options.json, time.perf_counter()

    def note(text: str) -> None:
        print(f"[{time.perf_counter() - begun:6.1f} s] {text}", file=sys.stderr, flush=True)

    table = budget.effect_budget(scene, task, uniform(task.elements), _silent if quiet else note, options.starts)
    if options.report:
        from html_reports.budget_page import write_budget_report

        with working("writing the report", not quiet):
            write_budget_report(options.output / "budget.html", table, scene, task, document)
    if options.json:
        print(json.dumps(table.plain(), indent=2))
    else:
        print(table)
    if options.report and not options.json:
        print(f"files        {options.output / 'budget.html'}")
    return 0 if table.rows[0].ok else 1


def find_motion(
    scene: Scene, task: Task, document: Table, options: argparse.Namespace, show: Callable[[str], None]
) -> int:
    """Solve, verify, write the files and print the account; 0 for a verified solution, else 1."""
    shown = show is print
    show(f"{scene.machine.name} manipulator, {scene.form_name} form, frame {scene.frame_name}, "
         f"{', '.join(named(scene)) or 'no effects'}")  # fmt: skip
    show(f"{task.elements} elements of radau(3), one control value for each; solving ...")
    for note in (*scene.system.notes, *passed_at_once(task, document), *unkept(task)):
        show(f"note: {note}")
    solution, asked = find(task, scene.system, options, show, shown), checks_of(options)
    with working("verifying", shown):
        report = verify(solution, allowed=asked.allowed)
    times, table, unrecovered = tabulate(solution, scene)
    difference = torque_difference(solution, scene, table)
    clear = clearances(solution, task)
    result = verdict(solution, report, difference, asked.torques, clear)
    try:
        with working("drawing", shown):
            files = write(solution, scene, task, (times, table), result.ok, options)
        if options.rate is not None:
            for note in write_rate(solution, scene, task, options, files):
                show(f"note: {note}")
        if options.report:
            from html_reports.motion_page import write_motion_report

            files["report"] = options.output / "time_optimal.html"
            with working("writing the report", shown):
                write_motion_report(files["report"], solution, scene, task, document, report, result, clear)
    except (OSError, ImportError, ValueError) as error:
        print(f"time_optimal: {f'cannot write: {error}' if isinstance(error, OSError) else error}", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps(account(solution, report, difference, result, files, clear), indent=2))
    else:
        describe(show, solution, report, unrecovered or difference, result, files, clear)
    if not result.ok:
        print(f"time_optimal: no verified solution: {result.cause}", file=sys.stderr)
        return 1
    return 0


def passed_at_once(task: Task, document: Table) -> list[str]:
    """Return a note if via points of a document are passed where a leg begins or ends, and are no legs of the task."""
    named = document.entries.get("task", {})
    given = named.get("via", []) if isinstance(named, dict) else []
    count = len(given) - len(task.via)
    which = "a via point is" if count == 1 else f"{count} via points are"
    return [f"{which} passed where the motion, or a leg of it, begins or ends: no leg of its own"] if count > 0 else []


def torque_difference(solution: Solution | SequenceSolution, scene: Scene, table: np.ndarray) -> float:
    """Return the largest difference of recovered from solved torques, as a share of the limit of each drive."""
    n = len(scene.machine.coordinates)
    solved = np.vstack([at_points(leg, scene.system, "tau", leg.scheme.points) for leg in phases(solution)[0]])
    limit = np.max(curve(solution, "tau").upper, axis=0)
    scales = np.where(np.isfinite(limit) & (limit > 0.0), limit, np.maximum(np.max(np.abs(solved), axis=0), 1e-300))
    return float(np.max(np.abs(table[:, -n:] - solved) / scales))


def write(
    solution: Solution | SequenceSolution, scene: Scene, task: Task, rows: tuple[np.ndarray, np.ndarray],
    verified: bool, options: argparse.Namespace,
) -> Files:  # fmt: skip
    """Write table, solutions and pictures; return the files by kind.

    Args:
        solution: of any status.
        scene: of the motion.
        task: with its obstacles.
        rows: times (K,) and q, v, a, tau (K, 4 n).
        verified: False adds to the title that it is not.
        options: with output and formats.
    """
    machine, legs, folder = scene.machine, phases(solution)[0], options.output
    files = {"csv": folder / "time_optimal.csv"}
    write_csv(files["csv"], machine, *rows)
    for k, leg in enumerate(legs, 1):
        kind, stem = ("npz", "time_optimal") if len(legs) == 1 else (f"npz {k}", f"time_optimal_{k}")
        files[kind] = folder / f"{stem}.npz"
        save(leg, files[kind])
    title = (
        f"{minimised(solution).capitalize()} of the {machine.name} manipulator ({scene.form_name} form): "
        f"$t_f$ = {solution.duration:.5g} s{'' if verified else '  - NOT VERIFIED'}"
    )
    for suffix in options.formats:
        files[suffix] = folder / f"time_optimal.{suffix}"
        n = len(machine.coordinates)
        plots.motion(solution, machine, rows[1][:, -n:], task.drawn, title, files[suffix])
        if isinstance(solution, Solution) and solution.structure is not None:
            kind = "structure" if suffix == options.formats[0] else f"structure {suffix}"
            files[kind] = folder / f"time_optimal_structure.{suffix}"
            plots.structure(solution, files[kind])
    return files


def write_rate(
    solution: Solution | SequenceSolution, scene: Scene, task: Task, options: argparse.Namespace, files: Files
) -> list[str]:
    """Write all legs of a motion at a fixed rate, as CSV and JointTrajectory; return notes about it."""
    limits = {interval.signal: (interval.lower, interval.upper) for interval in task.limits}
    motion = Motion.of(solution, scene.system)  # type: ignore[arg-type]  # a sequence has phases
    notes = write_at_rate(options.output, "time_optimal", motion, scene, options.rate, ([], limits))
    for kind, suffix in (("rate", "csv"), ("trajectory", "json")):
        files[kind] = options.output / f"time_optimal_{options.rate:g}Hz.{suffix}"
    return notes


def chosen(parser: argparse.ArgumentParser, options: argparse.Namespace) -> tuple[Scene, Task, Table]:
    """Return scene, task and document of a file, or the default ones of a machine, with what the options change."""
    if options.scene is not None and options.machine is not None:
        parser.error("--machine: the scene file names the machine; leave one of them out")
    name = options.machine or "spherical"
    document = (
        parse(scene_text(name), f"default scene, {name}") if options.scene is None else read_document(options.scene)
    )
    changes = {"form": options.form, "frame": options.frame}
    for table, key, flag, given in (
        ("task", "from", "--from", options.q0), ("task", "to", "--to", options.q1),
        ("limits", "tau", "--limit", options.limit),
    ):  # fmt: skip
        if given is None:
            continue
        kind = catalogue.machines().get(str(document.entries.get("machine")))
        coordinates = kind().coordinates if kind is not None else ()
        if kind is not None and len(given) != len(coordinates):
            parser.error(f"{flag}: got {len(given)} numbers, {document.entries['machine']} has {len(coordinates)} "
                         f"coordinates ({', '.join(c.name for c in coordinates)})")  # fmt: skip
        if not np.all(np.isfinite(given)) or (flag == "--limit" and min(given) <= 0.0):
            parser.error("--from, --to, --limit: expected finite numbers, limits > 0")
        changes[table] = {k: v for k, v in document.table(table).entries.items() if k not in (key, f"{key}_deg")}
        changes[table] = {**(changes[table]), key: given}
        document = _changed(document, {table: changes.pop(table)})
    document = _changed(document, {key: value for key, value in changes.items() if value is not None})
    if options.form == inverse.__name__ and options.frame is None:  # a frame of the file is that of its own form
        document = _without(document, "frame")
    return *of_document(document), document


def _changed(document: Table, changes: dict[str, object]) -> Table:
    lines = {key: line for key, line in document.lines.items() if key not in ("form", "frame") or key not in changes}
    return Table(document.file, lines, document.key, {**document.entries, **changes})


def _without(document: Table, name: str) -> Table:
    entries = {key: value for key, value in document.entries.items() if key != name}
    return Table(document.file, document.lines, document.key, entries)


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command_parser(__doc__.splitlines()[0] if __doc__ else "", EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="scene file (TOML); options below change it")
    parser.add_argument("--machine", choices=TASKS, help="default scene of a manipulator (default: spherical)")
    parser.add_argument("--form", choices=catalogue.forms(), help="form of the equations (default: canonical)")
    parser.add_argument("--frame", help="frame of the quasi-velocities: regular (default), paper, ldl, udu; torus more")
    parser.add_argument("--from", dest="q0", nargs="+", type=float, metavar="Q", help="start, at rest [rad or m]")
    parser.add_argument("--to", dest="q1", nargs="+", type=float, metavar="Q", help="end, at rest [rad or m]")
    parser.add_argument(
        "--limit",
        nargs="+",
        type=float,
        metavar="F",
        help="largest force of every drive [N m or N]",
    )
    add_solving(parser)
    add_own_models(parser)
    parser.add_argument("--rate", type=float, metavar="HZ", help="write CSV and JointTrajectory at this rate, too")
    add_output(parser, "CSV, NPZ, pictures and report")
    parser.add_argument("--report", action="store_true", help="write an HTML report with the motion in 3D, too")
    parser.add_argument(
        "--template", metavar="MACHINE", help="print a commented scene file of a machine, a robot (ur5, panda, ...) or "
        "a URDF file, and stop",
    )  # fmt: skip
    parser.add_argument("--card", action="store_true", help="print the card of the scene and the task, and stop")
    parser.add_argument("--budget", action="store_true", help="solve again with each effect left out; what each costs")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--json", action="store_true", help="print the account as JSON")
    return parser


def _silent(_: str) -> None:
    return


if __name__ == "__main__":
    exit_with(main)
