"""Time-optimal motion of a manipulator: solve, verify, recover the drive torques, write a picture.

The default is the spherical manipulator under gravity in canonical form, rest to rest. Angles are in rad, lengths in
m, torques in N m and forces in N, in the order of the coordinates. A scene file says it all; see --template.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pictures import solution as picture
from pictures import structure as picture_structure
from reports import effect_budget as budget
from reports.motion_table import at_points, finite, tabulate, write_csv

from models import Scene
from models.effects import Gravity
from models.mechanics.terms import name_of
from models.scenes import catalogue
from models.scenes.scene_template import TASKS, scene_text
from models.scenes.task import Task
from models.scenes.task_file import of_document
from models.scenes.toml_document import SceneError, Table, parse, read_document
from ocp import Report, SequenceSolution, Solution, polish, radau, save, solve, uniform, verify

AGREEMENT = 1e-8  # recovered torques against those of the solution, share of the limit


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 for a verified solution, 1 for none, 2 for wrong usage."""
    parser = command_line()
    options = parser.parse_args(arguments)
    if options.template:
        print(scene_text(options.template), end="")
        return 0
    try:
        scene, task = chosen(parser, options)
    except SceneError as error:
        print(f"time_optimal: {error}", file=sys.stderr)
        return 2
    task = task if options.nodes is None else replace(task, elements=options.nodes)
    if options.card:
        print(f"{scene.card()}\n{task.card(scene.system)}")
        return 0
    say = _silent if options.quiet or options.json else print
    if options.budget:
        table = budget.effect_budget(scene, task, uniform(task.elements), progress=_note if say is print else _silent)
        print(json.dumps(table.plain(), indent=2) if options.json else table)
        return 0 if table.rows[0].ok else 1
    try:
        options.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--output: {error}")
    return find_motion(scene, task, options, say)


def find_motion(scene: Scene, task: Task, options: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Solve, verify, write the files and say what was found; 0 for a verified solution, else 1."""
    machine, n = scene.machine, len(scene.machine.coordinates)
    effects = ", ".join(_named(scene)) or "no effects"
    say(f"{machine.name} manipulator, {scene.form_name} form, frame {scene.frame_name}, {effects}")
    say(f"{task.elements} elements of radau(3), one control value for each; solving ...")
    for note in scene.system.notes:
        say(f"note: {note}")
    solution = solve(task.problem(scene.system), scheme=radau(3), grid=uniform(task.elements))
    if options.polish and isinstance(solution, Solution):
        solution = polish(solution)
    elif options.polish:
        say("polish: a motion through points is several phases, which are not polished; left as solved")
    report = verify(solution)
    times, table, unrecovered = tabulate(solution, scene)
    legs, _ = picture.phases(solution)
    solved = np.vstack([at_points(leg, scene.system, "tau", leg.scheme.points) for leg in legs])
    limits = picture.limits(legs[0].problem, "tau")[1] if legs[0].problem is not None else np.full(n, np.inf)
    sizes = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.maximum(np.max(np.abs(solved), axis=0), 1e-300))
    difference = float(np.max(np.abs(table[:, -n:] - solved) / sizes))
    faults = list(report.failures)
    if not difference <= AGREEMENT:
        faults.append(f"the recovered torques differ from the controls by {difference:.1e} of the limit")

    files = {kind: options.output / f"time_optimal.{kind}" for kind in ("csv", "npz", "png")}
    try:
        write_csv(files["csv"], machine, times, table)
        if len(legs) > 1:
            del files["npz"]
            files |= {f"npz {k}": options.output / f"time_optimal_{k}.npz" for k in range(1, len(legs) + 1)}
        for leg, path in zip(legs, (path for kind, path in files.items() if kind.startswith("npz")), strict=True):
            save(leg, path)
        title = (
            f"Time-optimal motion of the {machine.name} manipulator ({scene.form_name} form): "
            f"$t_f$ = {solution.duration:.5g} s{'' if not faults else '  - NOT VERIFIED'}"
        )
        picture.time_optimal(solution, machine, table[:, -n:], title, files["png"])
        if isinstance(solution, Solution) and solution.structure is not None:
            files["structure"] = options.output / "time_optimal_structure.png"
            picture_structure.structure(solution, files["structure"])
    except OSError as error:
        print(f"time_optimal: cannot write to {options.output}: {error}", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps(account(solution, report, difference, files), indent=2))
    else:
        describe(say, solution, report, unrecovered or difference, files)
    if faults:
        reasons = "; ".join([solution.message, *faults] if not solution.ok else faults)
        print(f"time_optimal: no verified solution: {reasons}", file=sys.stderr)
        return 1
    return 0


def chosen(parser: argparse.ArgumentParser, options: argparse.Namespace) -> tuple[Scene, Task]:
    """Return the scene and the task of a file, or the default ones of a machine, with what the options change."""
    if options.scene is not None and options.machine is not None:
        parser.error("--machine: the scene file says which machine; leave one of them out")
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
    return of_document(_changed(document, {key: value for key, value in changes.items() if value is not None}))


def _changed(document: Table, changes: dict[str, object]) -> Table:
    lines = {key: line for key, line in document.lines.items() if key not in ("form", "frame") or key not in changes}
    return Table(document.file, lines, document.key, {**document.entries, **changes})


def _named(scene: Scene) -> list[str]:
    return [
        f"gravity {e.g:g} m/s^2" if isinstance(e, Gravity) and isinstance(e.g, float) else name_of(e)
        for e in scene.effects
    ]


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None,
        epilog="Angles in rad, lengths in m, torques in N m, forces in N, in the order of the coordinates: "
        "spherical (theta, psi, phi, r), cylindrical (phi, xi, r), torus (q1, q2, q3). theta = 0 is the vertical. "
        "Exit status: 0 verified, 1 no verified solution, 2 wrong usage.",
    )
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="scene file (TOML); options below change it")
    parser.add_argument("--machine", choices=TASKS, help="default scene of a manipulator (default: spherical)")
    parser.add_argument("--form", choices=catalogue.forms(), help="form of the equations (default: canonical)")
    parser.add_argument("--frame", help="frame of the quasi-velocities: regular (default), paper, ldl, udu; torus more")
    parser.add_argument("--from", dest="q0", nargs="+", type=float, metavar="Q", help="start, at rest [rad or m]")
    parser.add_argument("--to", dest="q1", nargs="+", type=float, metavar="Q", help="end, at rest [rad or m]")
    parser.add_argument("--limit", nargs="+", type=float, metavar="F", help="magnitude of every drive [N m or N]")
    parser.add_argument("--nodes", type=_elements, metavar="N", help="elements of the grid (default: of the scene, 50)")
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="for CSV, NPZ and PNG (default: %(default)s)",
    )
    parser.add_argument("--template", choices=TASKS, metavar="MACHINE", help="print a commented scene file and stop")
    parser.add_argument("--card", action="store_true", help="print the card of the scene and the task, and stop")
    parser.add_argument("--budget", action="store_true", help="solve again with each effect left out; what each costs")
    parser.add_argument(
        "--polish", action="store_true", help="make the switching times unknowns; t_f to about nine digits"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--json", action="store_true", help="print the account as JSON")
    return parser


def account(
    solution: Solution | SequenceSolution, report: Report, difference: float, files: dict[str, Path]
) -> dict[str, object]:
    """Return everything that the command prints as plain data."""
    figures = ("drift", "drift_end", "violation", "hamiltonian", "hamiltonian_value", "switching", "energy")
    return {
        "status": solution.status.name,
        "message": solution.message,
        "verified": report.ok and difference <= AGREEMENT,
        "t_f": solution.duration,
        "iterations": solution.iterations,
        "elements": sum(len(leg.grid) for leg in picture.phases(solution)[0]),
        "legs": [leg.duration for leg in picture.phases(solution)[0]],
        **{name: finite(float(getattr(report, name))) for name in figures},
        "torque_difference": finite(difference),
        "seconds": vars(solution.timings),
        "files": {kind: os.fspath(path) for kind, path in files.items()},
    }


def describe(
    say: Callable[[str], None],
    solution: Solution | SequenceSolution,
    report: Report,
    difference: float | str,
    files: dict[str, Path],
) -> None:
    """Print the compact account."""
    spent = solution.timings
    structure = solution.structure if isinstance(solution, Solution) else None
    digits = 6 if structure is None else 10
    result = f"{solution.duration:.{digits}f} s"
    say(f"t_f          {result} ({solution.status.name.lower()}, {solution.iterations} iterations)")
    if "polished" in solution.message:
        say(f"polish       {solution.message.partition('; ')[2]}")
    if np.isfinite(report.switching):
        say(f"above best   about {report.switching * solution.cost:.1e} s, by the switching functions (first order)")
    else:
        say(
            "above best   not estimated: limits that couple the drives (torque-speed, power) have no switching function"
        )
    if isinstance(solution, SequenceSolution):
        say(f"legs         {', '.join(f'{leg.duration:.6f}' for leg in solution.phases)} s")
    say(f"drift        {report.drift:.1e} of the range of its state, re-integrated at 1e-12")
    where = f" ({report.violation.what})" if report.violation > 0.0 else ""
    say(f"limits       exceeded by {report.violation:.1e} of their range between nodes{where}")
    say(f"Hamiltonian  {report.hamiltonian_value:.4f} in the mean (-1 is optimal), deviation {report.hamiltonian:.1e}")
    if structure is not None:
        say(f"structure\n{structure}")
    say(f"energy       balance open by {report.energy:.1e}")
    if isinstance(difference, str):
        say(f"torques      those of the solution: {difference}")
    else:
        say(f"torques      recovered by Lagrange inverse dynamics, {difference:.1e} of the limit from the controls")
    say(f"seconds      set-up {spent.setup:.3f}, derivatives {spent.derivatives:.3f}, solver {spent.solver:.3f}")
    say(f"files        {', '.join(os.fspath(path) for path in files.values())}")


def _elements(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 1")
    return value


def _note(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _silent(_: str) -> None:
    return


if __name__ == "__main__":
    sys.exit(main())
