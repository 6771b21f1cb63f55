"""Drive torques of a given motion: summary, table, pictures.

MOTION is a CSV table (t,q1,...; maybe v1,... and a1,...; t,x,y,z: points of the tool; without t: waypoints, run
through as fast as --limit allows), a ROS JointTrajectory (.json, .yaml), a solution (.npz), or arrays t, q (.npz).
"""

from __future__ import annotations

from reports.command import exit_with  # first: it decides how pictures are drawn

# isort: split

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from reports.motion_file import read_motion
from reports.output import add_output, output_folder, working
from reports.own_models import add_own_models, include_own_models

from models import Envelope, Manipulator, Motion, Scene, TorqueTable, inverse_dynamics, write_code, write_function
from models.effects import Gravity, Payload, Viscous
from models.mechanics.terms import Effect
from models.motions.ros_trajectory import as_trajectory
from models.plots.tables import torques as draw_torques
from models.scenes import catalogue
from models.scenes.scene_file import read_scene
from models.scenes.toml_document import read_document
from models.torques.limit_check import broken_limits

JOINT = ("motor_q", "motor_v")  # of the drives, that are no loads
LONG = 100_000  # rows from which progress is shown
ROWS = 50_000  # written at once
Say = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0, 1 if a limit is exceeded, 2 for wrong usage or input."""
    options = command_line().parse_args(arguments)
    say: Say = print if not (options.quiet or options.json) else lambda _: None
    try:
        include_own_models(options)
        scene = chosen(options)
        machine, effects = scene.machine, scene.effects
        limits = envelopes(options, machine)
        noise = options.noise[0] if options.noise and len(options.noise) == 1 else options.noise
        motion = read_motion(options.motion, scene, noise, options.limit, options.speed, say)
        times = None if options.times is None else np.linspace(motion.start, motion.end, options.times)
        table = motion.torques(machine, effects, times=times, limits=limits, progress=progress("inverse dynamics"))
        say(f"{machine.name} manipulator, {', '.join(repr(e) for e in effects) or 'no effects'}")
        say(repr(motion))
        account = describe(say, motion, table, scene, options)
        options.output = output_folder(options, "torques")
        files = write(options, scene, motion, table, account)
    except (ValueError, TypeError, ImportError, OSError, MemoryError) as error:
        sentence = " ".join(str(error).split()) or type(error).__name__
        print(f"torques: {sentence}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(_finite(account), indent=2, allow_nan=False))
    say(f"files        {', '.join(os.fspath(path) for path in files)}")
    return 1 if account["broken_limits"] or any(load.exceeded or load.overheated for load in table.loads) else 0


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Angles in rad, lengths in m, torques in N m, forces in N, in the order of the coordinates. "
        "Exit status: 0, 1 a limit is exceeded, 2 wrong usage or input (one sentence, no file written).",
    )
    parser.add_argument("motion", type=Path, metavar="MOTION", help="file with the motion")
    parser.add_argument("scene", type=Path, nargs="?", metavar="SCENE", help="scene file (TOML): machine and effects")
    parser.add_argument("--machine", choices=catalogue.machines(), help="without a scene (default: spherical)")
    parser.add_argument("--gravity", type=float, metavar="G", help="[m/s^2], 0: none (default: 9.81)")
    parser.add_argument("--payload", type=float, metavar="M", help="load at the tool [kg]")
    parser.add_argument("--viscous", nargs="+", type=float, metavar="C", help="viscous friction of every joint")
    parser.add_argument(
        "--noise", nargs="+", type=float, metavar="S", help="standard deviation of the samples [rad, m]"
    )
    parser.add_argument("--compare", action="store_true", help="show what raw differences of the samples would do")
    parser.add_argument("--times", type=_rows, metavar="N", help="rows of the table, at equal times")
    parser.add_argument("--limit", nargs="+", type=float, metavar="F", help="largest torque of every drive")
    parser.add_argument("--speed", nargs="+", type=float, metavar="V", help="no-load speed of every drive")
    parser.add_argument("--corner", nargs="+", type=float, metavar="V", help="speed up to which --limit is available")
    parser.add_argument("--continuous", nargs="+", type=float, metavar="F", help="continuous torque of every drive")
    add_own_models(parser)
    add_output(parser, "table, pictures and report")
    parser.add_argument("--report", action="store_true", help="write an HTML report with the motion in 3D, too")
    parser.add_argument("--export", action="store_true", help="write a JointTrajectory too")
    parser.add_argument("--code", action="store_true", help="write the inverse dynamics as C code and CasADi function")
    parser.add_argument("--no-picture", action="store_true", help="write no picture")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--json", action="store_true", help="print the account as JSON")
    return parser


def chosen(options: argparse.Namespace) -> Scene:
    """Return the scene of a file, or the machine and the effects that the options ask for."""
    if options.scene is not None:
        for name in ("machine", "gravity", "payload", "viscous"):
            if getattr(options, name) is not None:
                raise ValueError(f"--{name}: the scene file says which machine and effects; leave one of them out")
        return read_scene(read_document(options.scene))
    machine = catalogue.machines()[options.machine or "spherical"]()
    effects: list[Effect] = []
    if options.gravity != 0.0:
        effects.append(Gravity(9.81 if options.gravity is None else options.gravity))
    if options.payload is not None:
        effects.append(Payload(options.payload))
    if options.viscous is not None:
        effects.append(Viscous(options.viscous[0] if len(options.viscous) == 1 else tuple(options.viscous)))
    return Scene(machine, tuple(effects))


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


def describe(
    say: Say, motion: Motion, table: TorqueTable, scene: Scene, options: argparse.Namespace
) -> dict[str, object]:
    """Print the summary and return it as plain data."""
    for note in motion.notes:
        say(f"note: {note}")
    say(str(table))
    account: dict[str, object] = {
        "machine": table.machine.name,
        "effects": [repr(effect) for effect in table.effects],
        "start": motion.start,
        "end": motion.end,
        "rows": len(table.t),
        "smoothness": motion.smoothness if np.isfinite(motion.smoothness) else None,
        "notes": list(motion.notes),
        "drives": [asdict(drive) for drive in table.loads],
        "split_rms": {name: _rms(part).tolist() for name, part in table.split.items()},
    }
    shares = "   ".join(f"{name} {', '.join(f'{x:.4g}' for x in _rms(part))}" for name, part in table.split.items())
    say(f"split (rms)  {shares}")
    try:
        needs = {name: part for name, part in table.drives.items() if name not in JOINT}
    except ValueError as error:
        needs = {}
        say(f"note: {error}")
    sizes = {name: {"peak": _peak(part).tolist(), "rms": _rms(part).tolist()} for name, part in needs.items()}
    account["drive_side"] = sizes
    if any(name != "motor_tau" or not np.array_equal(part, table.tau) for name, part in needs.items()):
        for name, part in needs.items():
            unit = scene.system.label(name, part.shape[1])[0].unit or "N m or N"
            say(f"{name:<12} peak {_row(_peak(part))}, rms {_row(_rms(part))} [{unit}]")
    smoothed, uncertainty = motion.smoothed, table.uncertainty
    if smoothed is not None and uncertainty is not None:
        say(f"noise        {_row(smoothed.noise)} (rad or m), residual {_row(smoothed.residual)}")
        say(f"uncertainty  of the torques {_row(_rms(uncertainty))} (rms of the standard deviation)")
        account["noise"], account["residual"] = smoothed.noise.tolist(), smoothed.residual.tolist()
        account["uncertainty_rms"] = _rms(uncertainty).tolist()
    if options.compare:
        raw = raw_torques(motion, table)
        say(f"raw          differences of the samples would be off by {_row(_rms(raw - table.tau))} (rms)")
        account["raw_difference_rms"] = _rms(raw - table.tau).tolist()
    for sentence in exceeded(table):
        say(f"exceeded     {sentence}")
    account["broken_limits"] = [asdict(span) for span in broken_limits(table)]
    return account


def exceeded(table: TorqueTable) -> list[str]:
    """Return a sentence for every limit of a drive or an effect that the motion exceeds."""
    sentences = []
    for drive in table.loads:
        for span in drive.exceeded:
            sentences.append(f"{drive.name} from {span.start:.6g} to {span.end:.6g} s, up to {span.ratio:.4g} times")
        if drive.overheated:
            sentences.append(f"{drive.name}: the root mean square {drive.rms:.5g} {drive.unit} is beyond its limit")
    for where in broken_limits(table):
        when = f"from {where.start:.6g} to {where.end:.6g} s"
        sentences.append(f"{where.name} {when}: {where.value:.4g}, the limit is {where.limit:.4g}")
    return sentences


def raw_torques(motion: Motion, table: TorqueTable) -> np.ndarray:
    """Return the torques (K, n) that raw second differences of the samples would give."""
    return motion.differenced().torques(table.machine, table.effects, times=table.t).tau


def write(
    options: argparse.Namespace, scene: Scene, motion: Motion, table: TorqueTable, account: dict[str, object]
) -> list[Path]:
    """Write all files, or none."""
    with tempfile.TemporaryDirectory(dir=options.output) as folder:
        part = Path(folder)
        write_csv(part / "torques.csv", table)
        (part / "torques.json").write_text(json.dumps(_finite(account), indent=2, allow_nan=False), encoding="utf-8")
        if not options.no_picture:
            raw = raw_torques(motion, table) if options.compare else None
            for suffix in options.formats:
                draw_torques(table, raw, part / f"torques.{suffix}")
        if options.report:
            from html_reports.torque_page import write_torque_report

            document = None if options.scene is None else read_document(options.scene)
            with working("writing the report", not (options.quiet or options.json)):
                write_torque_report(part / "torques.html", motion, table, scene, document, exceeded(table))
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


def write_csv(path: Path, table: TorqueTable) -> None:
    """Write t, q, v, a, tau and the split with names and units in the header."""
    coordinates = table.machine.coordinates
    header = [*table.header, *(f"{name} of tau_{c.name} [{c.force_unit}]" for name in table.split for c in coordinates)]
    columns = [table.rows, *table.split.values()]
    shown = progress("writing")
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(header) + "\n")
        for start in range(0, len(table.t), ROWS):
            rows = np.hstack([column[start : start + ROWS] for column in columns])
            np.savetxt(file, rows, fmt="%.15g", delimiter=",")
            if shown is not None:
                shown(min(start + ROWS, len(table.t)), len(table.t))


def progress(what: str) -> Callable[[int, int], None] | None:
    """Return a function that shows how far long work is, on a terminal only."""
    if not sys.stderr.isatty():
        return None

    def show(done: int, total: int) -> None:
        if total >= LONG:
            print(f"\r{what}: {100 * done // total} %", end="\n" if done == total else "", file=sys.stderr, flush=True)

    return show


def _rms(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _peak(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(values), axis=0))


def _row(values: np.ndarray) -> str:
    return ", ".join(f"{x:.3g}" for x in values)


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _rows(text: str) -> int:
    value = int(text)
    if value < 2:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 2")
    return value


if __name__ == "__main__":
    exit_with(main)
