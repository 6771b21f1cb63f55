"""Time-optimal motion of a manipulator: solve, verify, recover the drive torques, write a picture.

The default is the spherical manipulator under gravity in canonical form, rest to rest. Angles are in rad, lengths in
m, torques in N m and forces in N, in the order of the coordinates.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import picture

from models import Manipulator, cylindrical, recover, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from ocp import Report, Solution, point_to_point, radau, save, solve, uniform, verify

FORMS = {"canonical": canonical, "hamel": hamel, "lagrange": lagrange}
AGREEMENT = 1e-8  # recovered torques against controls, share of the limit


@dataclass(frozen=True)
class Task:
    """A default task of a machine: rest to rest within limits."""

    machine: Callable[[], Manipulator]
    q0: tuple[float, ...]  # [rad or m]
    q1: tuple[float, ...]
    q_min: tuple[float, ...]
    q_max: tuple[float, ...]
    limit: tuple[float, ...]  # magnitude of every drive [N m or N]


TASKS = {
    "spherical": Task(
        spherical, (0.9, 0.0, 0.0, 0.85), (1.6, 2.0, 0.5, 0.9),
        (0.15, -3.0, -3.0, 0.6), (2.8, 3.0, 3.0, 1.1), (260.0, 160.0, 3.0, 400.0),
    ),
    "cylindrical": Task(
        cylindrical, (0.0, 0.2, 0.6), (2.0, 0.8, 0.8),
        (-3.0, 0.0, 0.3), (3.0, 1.2, 1.0), (150.0, 1000.0, 300.0),
    ),
    "torus": Task(
        torus, (0.0, 0.4, -0.9), (2.0, 0.8, -1.3),
        (-3.0, -0.3, -2.6), (3.0, 2.0, 2.6), (250.0, 600.0, 220.0),
    ),
}  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 for a verified solution, 1 for none, 2 for wrong usage."""
    parser = command_line()
    options = parser.parse_args(arguments)
    task = TASKS[options.machine]
    q0, q1 = options.q0 or task.q0, options.q1 or task.q1
    limit = options.limit or task.limit
    machine, effects = task.machine(), [Gravity()]
    n = len(machine.coordinates)
    for name, given in (("--from", q0), ("--to", q1), ("--limit", limit)):
        if len(given) != n:
            parser.error(f"{name}: got {len(given)} numbers, {options.machine} has {n} coordinates "
                         f"({', '.join(str(c.name) for c in machine.coordinates)})")  # fmt: skip
    if min(limit) <= 0.0 or not np.all(np.isfinite([*q0, *q1, *limit])):
        parser.error("--from, --to, --limit: expected finite numbers, limits > 0")
    try:
        options.output.mkdir(parents=True, exist_ok=True)
        arm = FORMS[options.form](machine, effects, options.frame)
    except ValueError as error:
        parser.error(str(error))
    except OSError as error:
        parser.error(f"--output: {error}")

    say = _silent if options.quiet or options.json else print
    say(f"{machine.name} manipulator, {options.form} form, frame {options.frame or 'regular'}, gravity 9.81 m/s^2")
    say(f"{options.nodes} elements of radau(3), one control value for each; solving ...")
    for note in arm.notes:
        say(f"note: {note}")
    problem = point_to_point(arm, q0, q1, q=(task.q_min, task.q_max), tau=limit)
    solution = solve(problem, scheme=radau(3), grid=uniform(options.nodes))
    report = verify(solution)
    times, table = motion_table(solution, recover(arm, machine, effects), n)
    _, _, _, controls = solution.samples(solution.scheme.points)
    difference = float(np.max(np.abs(table[:, -n:] - controls) / np.array(limit)))
    faults = list(report.failures)
    if not difference <= AGREEMENT:
        faults.append(f"the recovered torques differ from the controls by {difference:.1e} of the limit")

    files = {kind: options.output / f"time_optimal.{kind}" for kind in ("csv", "npz", "png")}
    try:
        write_csv(files["csv"], machine, times, table)
        save(solution, files["npz"])
        title = (
            f"Time-optimal motion of the {machine.name} manipulator ({options.form} form): "
            f"$t_f$ = {solution.duration:.5g} s{'' if not faults else '  - NOT VERIFIED'}"
        )
        picture.time_optimal(solution, machine, table[:, -n:], title, files["png"])
    except OSError as error:
        print(f"time_optimal: cannot write to {options.output}: {error}", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps(account(solution, report, difference, files), indent=2))
    else:
        describe(say, solution, report, difference, files)
    if faults:
        reasons = "; ".join([solution.message, *faults] if not solution.ok else faults)
        print(f"time_optimal: no verified solution: {reasons}", file=sys.stderr)
        return 1
    return 0


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None,
        epilog="Angles in rad, lengths in m, torques in N m, forces in N, in the order of the coordinates: "
        "spherical (theta, psi, phi, r), cylindrical (phi, xi, r), torus (q1, q2, q3). theta = 0 is the vertical. "
        "Exit status: 0 verified, 1 no verified solution, 2 wrong usage.",
    )
    parser.add_argument(
        "--machine", choices=TASKS, default="spherical", help="which manipulator (default: %(default)s)"
    )
    parser.add_argument(
        "--form", choices=FORMS, default="canonical", help="form of the equations (default: %(default)s)"
    )
    parser.add_argument("--frame", help="frame of the quasi-velocities: regular (default), paper, ldl, udu; torus more")
    parser.add_argument("--from", dest="q0", nargs="+", type=float, metavar="Q", help="start, at rest [rad or m]")
    parser.add_argument("--to", dest="q1", nargs="+", type=float, metavar="Q", help="end, at rest [rad or m]")
    parser.add_argument("--limit", nargs="+", type=float, metavar="F", help="magnitude of every drive [N m or N]")
    parser.add_argument(
        "--nodes", type=_elements, default=50, metavar="N", help="elements of the grid (default: %(default)s)"
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="for CSV, NPZ and PNG (default: %(default)s)",
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--json", action="store_true", help="print the account as JSON")
    return parser


def motion_table(solution: Solution, recovered: ca.Function, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (K,) and q, v, a, tau (K, 4 n) at the collocation points, each from inside its element."""
    t, x, rate, _ = solution.samples(solution.scheme.points)
    p = np.array(list(solution.values.values()))[:, None]
    found = recovered.map(len(t))(x.T, rate.T, np.tile(p, len(t)))
    return t, np.vstack([np.array(part) for part in found]).T.reshape(len(t), 4 * n)


def write_csv(path: Path, machine: Manipulator, times: np.ndarray, table: np.ndarray) -> None:
    """Write t, q, v, a, tau with names and units in the header; the file appears when it is complete."""
    names, units = [c.name for c in machine.coordinates], [c.unit for c in machine.coordinates]
    header = ["t [s]"]
    header += [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    header += [f"d{name}/dt [{unit}/s]" for name, unit in zip(names, units, strict=True)]
    header += [f"d2{name}/dt2 [{unit}/s^2]" for name, unit in zip(names, units, strict=True)]
    header += [f"tau_{c.name} [{c.force_unit}]" for c in machine.coordinates]
    part = path.with_suffix(".csv.part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([repr(float(t)), *map(repr, map(float, row))] for t, row in zip(times, table, strict=True))
    part.replace(path)


def account(solution: Solution, report: Report, difference: float, files: dict[str, Path]) -> dict[str, object]:
    """Return everything that the command prints as plain data."""
    figures = ("drift", "drift_end", "violation", "hamiltonian", "hamiltonian_value", "switching", "energy")
    return {
        "status": solution.status.name,
        "message": solution.message,
        "verified": report.ok and difference <= AGREEMENT,
        "t_f": solution.duration,
        "iterations": solution.iterations,
        "elements": len(solution.grid),
        **{name: float(getattr(report, name)) for name in figures},
        "torque_difference": difference,
        "seconds": vars(solution.timings),
        "files": {kind: os.fspath(path) for kind, path in files.items()},
    }


def describe(
    say: Callable[[str], None], solution: Solution, report: Report, difference: float, files: dict[str, Path]
) -> None:
    """Print the compact account."""
    spent = solution.timings
    say(f"t_f          {solution.duration:.6f} s ({solution.status.name.lower()}, {solution.iterations} iterations)")
    say(f"above best   about {report.switching * solution.cost:.1e} s, by the switching functions (first order)")
    say(f"drift        {report.drift:.1e} of the largest state, re-integrated at 1e-12")
    where = f" ({report.violation.what})" if report.violation > 0.0 else ""
    say(f"limits       exceeded by {report.violation:.1e} of their range between nodes{where}")
    say(f"Hamiltonian  {report.hamiltonian_value:.4f} in the mean (-1 is optimal), deviation {report.hamiltonian:.1e}")
    say(f"energy       balance open by {report.energy:.1e}")
    say(f"torques      recovered by Lagrange inverse dynamics, {difference:.1e} of the limit from the controls")
    say(f"seconds      set-up {spent.setup:.3f}, derivatives {spent.derivatives:.3f}, solver {spent.solver:.3f}")
    say(f"files        {', '.join(os.fspath(path) for path in files.values())}")


def _elements(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 1")
    return value


def _silent(_: str) -> None:
    return


if __name__ == "__main__":
    sys.exit(main())
