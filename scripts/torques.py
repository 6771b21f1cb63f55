"""Drive torques of a given motion: summary, table, pictures; gear ratios; files for controllers.

MOTION is a table (.csv, .txt, .tsv: t,q1,...; maybe v1,... and a1,...; t,x,y,z: points of the tool; without t:
waypoints, run through as fast as the limits allow), an OpenSim file (.mot, .sto), ROS messages JointTrajectory or
JointState (.json, .jsonl, .yaml), a solution (.npz), or arrays t, q (.npz).
"""

from __future__ import annotations

from reports.command import command_parser, exit_with  # first: it decides how pictures are drawn

# isort: split

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from reports.controller_files import write_at_rate
from reports.fastest_path import Limits
from reports.gear_report import plain_rows, ratios_of, sweep, tell
from reports.motion_clearance import Clearances, kept, lines_of, measured
from reports.motion_clearance import plain as clearances
from reports.motion_file import Reading, read_motion
from reports.output import add_output, output_folder, working
from reports.own_models import add_own_models, include_own_models
from reports.torque_account import Account, describe, exceeded, exceeds, plain, raw_torques

from models import Envelope, Manipulator, Motion, Scene, TorqueTable, inverse_dynamics, write_code, write_function
from models.effects import Gravity, Payload, Viscous
from models.mechanics.terms import Effect
from models.motions.ros_trajectory import as_trajectory
from models.plots.tables import torques as draw_torques
from models.scenes import catalogue
from models.scenes.motor_file import GearedMotor, motors_of_drives, read_motors
from models.scenes.scene_file import read_scene
from models.scenes.task import Task
from models.scenes.task_file import read_limits, read_task
from models.scenes.toml_document import Table, parse, read_document
from models.torques.table_text import PROGRAMS, SPREADSHEETS, columns_of, write_table

EXAMPLES = """examples:
  python scripts/torques.py recording.csv arm.toml --report      torques with their parts, an HTML report
  python scripts/torques.py waypoints.csv arm.toml               run through as fast as the limits of the scene allow
  python scripts/torques.py recording.csv --machine torus --payload 5 --limit 250 600 220
  python scripts/torques.py recording.csv arm.toml --ratios 60:140 --motors motors.toml
  python scripts/torques.py results/time_optimal.npz arm.toml --rate 1000 --code    files for a controller

Angles in rad, lengths in m, torques in N m, forces in N, in the order of the coordinates.
Exit status: 0, 1 a limit is exceeded, 2 wrong usage or input (one sentence, no file written)."""
LONG = 100_000  # rows from which progress is shown
Say = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0, 1 if a limit is exceeded, 2 for wrong usage or input."""
    options = command_line().parse_args(arguments)
    shown = not (options.quiet or options.json)
    say: Say = print if shown else lambda _: None
    assumed = "" if options.scene or options.machine else "assumed, as neither a scene nor --machine was given"
    try:
        include_own_models(options)
        scene, document = chosen(options)
        options.output = output_folder(options, "torques")
        limits, signals = envelopes(options, scene.machine), scene_limits(document, scene)
        say(f"{scene.machine.name} manipulator{f' ({assumed})' if assumed else ''}, "
            f"{', '.join(repr(e) for e in scene.effects) or 'no effects'}")  # fmt: skip
        with working("reading the motion", shown, own_line=True):
            motion = read_motion(options.motion, scene, reading(options, limits, signals, say))
        say(repr(motion))
        times = None if options.times is None else np.linspace(motion.start, motion.end, options.times)
        with working("inverse dynamics", shown, own_line=True):
            table = motion.torques(
                scene.machine, scene.effects, times=times, limits=limits, progress=progress("inverse dynamics")
            )
        account = describe(say, motion, table, scene, signals, options.compare)
        task = read_task(document, scene) if {"task", "collisions"} <= set(document.entries) else None
        clear = () if task is None or task.clearance is None else measured(task.clearance, table.t, table.q)
        for number, line in enumerate(lines_of(clear)):
            say(f"{'' if number else 'clearance':<13}{line}")
        account["clearances"] = clearances(clear)
        with working("gear ratios", shown and options.ratios is not None):
            gears(options, document, scene, table, account, say)
        files = write(options, motion, table, scene, (limits, signals), account, say, (task, clear))
    except BrokenPipeError:
        raise
    except (ValueError, TypeError, ImportError, OSError, MemoryError) as error:
        sentence = " ".join(str(error).split()) or type(error).__name__
        assumption = f" (the machine is {options_machine(options)}, {assumed})" if isinstance(error, ValueError) else ""
        print(f"torques: {sentence}{assumption if assumed else ''}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(plain(account), indent=2, allow_nan=False))
    say(f"files        {', '.join(os.fspath(path) for path in files)}")
    return 1 if exceeds(account) or not kept(clear) else 0


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command_parser(__doc__ or "", EXAMPLES)
    add = parser.add_argument
    add("motion", type=Path, metavar="MOTION", help="file with the motion")
    add("scene", type=Path, nargs="?", metavar="SCENE", help="scene file (TOML): machine, effects, limits, motors")
    add("--machine", choices=catalogue.machines(), help="without a scene (default: spherical)")
    add("--gravity", type=float, metavar="G", help="[m/s^2], 0: none (default: 9.81)")
    add("--payload", type=float, metavar="M", help="load at the tool [kg]")
    add("--viscous", nargs="+", type=float, metavar="C", help="viscous friction of every joint")
    add("--noise", nargs="+", type=float, metavar="S", help="standard deviation of the samples [rad, m]; 0: none")
    add("--joints", nargs="+", metavar="FILE=NAME", help="names of the file and of the machine, as shoulder=q1")
    add("--branch", metavar="NAME", help="of the inverse kinematics, for points of the tool")
    add("--compare", action="store_true", help="show what raw differences of the samples would do")
    add("--times", type=_rows, metavar="N", help="rows of the table, at equal times")
    add("--rate", type=float, metavar="HZ", help="write the motion at this rate too, as CSV and JointTrajectory")
    add("--limit", nargs="+", type=float, metavar="F", help="largest torque of every drive")
    add("--speed", nargs="+", type=float, metavar="V", help="no-load speed of every drive")
    add("--corner", nargs="+", type=float, metavar="V", help="speed up to which --limit is available")
    add("--continuous", nargs="+", type=float, metavar="F", help="continuous torque of every drive")
    add("--ratios", metavar="A:B", help="rank gear ratios, as 60:140, 60:140:10 or 50,80,100, for the motors of the "
        "scene or of --motors")  # fmt: skip
    add("--motors", type=Path, metavar="FILE", help="catalogue of motors (TOML, tables [motors.NAME])")
    add_own_models(parser)
    add_output(parser, "table, pictures and report")
    add("--report", action="store_true", help="write an HTML report with the motion in 3D, too")
    add("--excel", choices=SPREADSHEETS, help="write tables for spreadsheets of a country (de: ; and decimal comma)")
    add("--export", action="store_true", help="write a JointTrajectory too")
    add("--code", action="store_true", help="write the inverse dynamics as C code and CasADi function")
    add("--no-picture", action="store_true", help="write no picture")
    add("--quiet", action="store_true", help="print nothing but errors")
    add("--json", action="store_true", help="print the account as JSON")
    return parser


def chosen(options: argparse.Namespace) -> tuple[Scene, Table]:
    """Return the scene of a file and its document, or the machine and the effects that the options ask for."""
    if options.scene is not None:
        for name in ("machine", "gravity", "payload", "viscous"):
            if getattr(options, name) is not None:
                raise ValueError(f"--{name}: the scene file says which machine and effects; leave one of them out")
        document = read_document(options.scene)
        return read_scene(document), document
    machine = catalogue.machines()[options_machine(options)]()
    effects: list[Effect] = []
    if options.gravity != 0.0:
        effects.append(Gravity(9.81 if options.gravity is None else options.gravity))
    if options.payload is not None:
        effects.append(Payload(options.payload))
    if options.viscous is not None:
        effects.append(Viscous(options.viscous[0] if len(options.viscous) == 1 else tuple(options.viscous)))
    return Scene(machine, tuple(effects)), parse("", "no scene")


def options_machine(options: argparse.Namespace) -> str:
    """Return the name of the machine without a scene."""
    return str(options.machine or "spherical")


def reading(options: argparse.Namespace, limits: list[Envelope], signals: Limits, say: Say) -> Reading:
    """Return how the file of the motion is read."""
    noise = options.noise[0] if options.noise and len(options.noise) == 1 else options.noise
    joints = {}
    for pair in options.joints or ():
        name, equals, coordinate = pair.partition("=")
        if not (name and equals and coordinate):
            raise ValueError(f"--joints: got {pair!r}, expected pairs such as shoulder=q1")
        joints[name] = coordinate
    return Reading(noise, limits, signals, joints, options.branch, say)


def scene_limits(document: Table, scene: Scene) -> Limits:
    """Return the limits of a scene on its signals."""
    return {interval.signal: (interval.lower, interval.upper) for interval in read_limits(document, scene)}


def envelopes(options: argparse.Namespace, machine: Manipulator) -> list[Envelope]:
    """Return one envelope for each drive, or none without limits."""
    n = len(machine.coordinates)
    given = {"peak": options.limit, "speed": options.speed, "corner": options.corner, "continuous": options.continuous}
    given = {name: values for name, values in given.items() if values is not None}
    for name, values in given.items():
        if len(values) != n:
            option = "--limit" if name == "peak" else f"--{name}"
            names = ", ".join(c.name for c in machine.coordinates)
            raise ValueError(f"{option}: got {len(values)} numbers, {machine.name} has {n} drives ({names})")
    return [Envelope(**{name: values[i] for name, values in given.items()}) for i in range(n)] if given else []


def gears(
    options: argparse.Namespace, document: Table, scene: Scene, table: TorqueTable, account: Account, say: Say
) -> None:
    """Rank gear ratios and motors if the options ask for it."""
    own = motors_of_drives(document, scene)
    if options.motors is not None and options.ratios is None:
        raise ValueError("--motors: needs --ratios, such as --ratios 60:140")
    if options.ratios is None:
        return
    candidates: list[GearedMotor] = []
    if options.motors is not None:
        candidates = list(read_motors(read_document(options.motors)).values())
    choices = sweep(table, own, candidates, ratios_of(options.ratios))
    tell(say, choices)
    account["gears"] = plain_rows(choices)


def write(
    options: argparse.Namespace,
    motion: Motion,
    table: TorqueTable,
    scene: Scene,
    limited: tuple[list[Envelope], Limits],
    account: Account,
    say: Say,
    near: tuple[Task | None, Clearances],
) -> list[Path]:
    """Write all files, or none."""
    style = SPREADSHEETS[options.excel] if options.excel else PROGRAMS
    with tempfile.TemporaryDirectory(dir=options.output) as folder:
        part = Path(folder)
        write_table(part / "torques.csv", *columns_of(table), style, progress("writing"))
        if options.rate is not None:
            for note in write_at_rate(part, "motion", motion, scene, options.rate, limited, style):
                say(f"note: {note}")
                account["notes"] = [*account["notes"], note]  # type: ignore[misc]
        (part / "torques.json").write_text(json.dumps(plain(account), indent=2, allow_nan=False), encoding="utf-8")
        if not options.no_picture:
            raw = raw_torques(motion, table) if options.compare else None
            for suffix in options.formats:
                draw_torques(table, raw, part / f"torques.{suffix}", limited[1])
        if options.report:
            from html_reports.torque_page import write_torque_report

            document = None if options.scene is None else read_document(options.scene)
            with working("writing the report", not (options.quiet or options.json)):
                lines = exceeded(table, limited[1])
                write_torque_report(part / "torques.html", motion, table, scene, document, lines, limited[1],
                                    () if near[0] is None else near[0].drawn, near[1])  # fmt: skip
        if options.export:
            names = [c.name for c in table.machine.coordinates]
            message = as_trajectory(table.t, table.q, table.v, table.a, names)
            (part / "trajectory.json").write_text(json.dumps(message), encoding="utf-8")
        if options.code:
            function = inverse_dynamics(table.machine, table.effects)
            write_code([function], part / "inverse_dynamics.c")
            write_function(function, part / "inverse_dynamics.casadi")
        files = sorted(part.iterdir())
        for file in files:
            shutil.move(file, options.output / file.name)
    return [options.output / file.name for file in files]


def progress(what: str) -> Callable[[int, int], None] | None:
    """Return a function that shows how far long work is, on a terminal only."""
    if not sys.stderr.isatty():
        return None

    def show(done: int, total: int) -> None:
        if total >= LONG:
            print(f"\r{what}: {100 * done // total} %", end="\n" if done == total else "", file=sys.stderr, flush=True)

    return show


def _rows(text: str) -> int:
    value = int(text)
    if value < 2:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 2")
    return value


if __name__ == "__main__":
    exit_with(main)
