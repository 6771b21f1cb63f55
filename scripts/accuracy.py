"""The accuracy bill: what an accuracy costs in seconds, for any forms, schemes, degrees, controls and grids.

Contenders run in turn, repeated; seconds are medians of wall-clock time on one thread and count everything from the
equations to the solution. Errors are true ones, against a reference whose own error is stated.
"""

from __future__ import annotations

from reports.command import command_parser, exit_with  # first: it decides how pictures are drawn

# isort: split

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread for everyone; libraries read it when they are loaded

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict

from accuracy_bill import dymos as accuracy_dymos
from accuracy_bill import integrators as simulated
from accuracy_bill import picture, table
from accuracy_bill.contenders import SCHEMES, Contender, of_peer, on_uniform_grids, refined, schemes, with_polish
from accuracy_bill.dymos import of_dymos
from accuracy_bill.measurement import Progress, against, curves, measure
from accuracy_bill.pareto_front import front, recommend
from accuracy_bill.reference import reference
from accuracy_bill.scene import FORMS, Scene, machine_scene, problem_scene
from benchmarks import peers
from benchmarks.problems import CASES
from reports.output import add_output, output_folder

from models.scenes.scene_template import TASKS
from ocp import Control, polish

EXAMPLES = """examples:
  python scripts/accuracy.py                                     the default task of the spherical manipulator, 95 s
  python scripts/accuracy.py --machine torus --report            another one, with an HTML report
  python scripts/accuracy.py --forms hamel --schemes radau lobatto --degrees 2 3 --grids 25 50
  python scripts/accuracy.py --parts simulation --integrators radau_5 bdf
  python scripts/accuracy.py --problem P1 P3 --peers rockit      problems of the benchmark, with another tool

Without any list of forms, schemes, degrees or controls the contenders are a star around the default, canonical
radau(3) with constant controls; with one, every combination. Angles in rad, lengths in m."""
GRIDS = (12, 25, 50, 100, 200)
METHODS = ("uniform", "polish", "refine", "refine+polish")
COARSE = (25, 50, 100)  # elements from which is polished
PARTS = ("simulation", "control")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)
STAR = (
    ("radau", 3, "constant"), ("radau", 5, "constant"), ("lobatto", 3, "constant"), ("radau", 3, "linear"),
    ("radau", 3, "collocated"),
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 for a bill, 1 if nothing could be measured, 2 for wrong usage."""
    options = command_line().parse_args(arguments)
    try:
        scenes = [problem_scene(name) for name in options.problem or ()]
        scenes = scenes or [machine_scene(options.machine, options.q0, options.q1, options.limit)]
        options.output = output_folder(options, "accuracy")
    except (ValueError, OSError, ImportError) as error:
        print(f"accuracy: {error}", file=sys.stderr)
        return 2
    bills = [bill(scene, options) for scene in scenes]
    if options.json:
        print(json.dumps(bills[0] if len(bills) == 1 else bills, indent=2))
    return 0 if all(account.get("rows") or account.get("simulation") for account in bills) else 1


def bill(scene: Scene, options: argparse.Namespace) -> dict[str, object]:
    """Measure one scene, write its files, print its tables, and return the account as plain data."""
    progress = Progress(_silent if options.quiet else sys.stderr.write)
    stem = f"accuracy_{scene.name}" if options.problem else "accuracy"
    files = {kind: options.output / f"{stem}.{kind}" for kind in ("csv", "md")}
    parts, halves = [f"# What accuracy costs: {scene.title}"], []
    account: dict[str, object] = {"scene": scene.title}
    if "simulation" in options.parts and scene.motion is not None:
        progress("simulation")
        result = simulated.table(scene.motion, options)
        files["simulation"] = options.output / f"{stem}_simulation.csv"
        table.write(files["simulation"], simulated.as_csv(result))
        halves.append(simulated.half(result))
        parts += ["## Simulation", simulated.words(result, options)]
        account["simulation"] = [finite(asdict(row)) for row in result.rows]
    if "control" in options.parts:
        quantity, unit = scene.quantity
        progress(f"{scene.title}: the reference")
        truth = reference(scene)
        rows = against(measure(contenders(scene, options), scene, options.repeats, options.budget, progress), truth)
        every = curves(rows, truth)
        best = front([point for curve in every for point in curve.points])
        optimal = [(curve.name, point.label) for curve in every for point in curve.points if point in best]
        silent = {name: missing(name) or "no solution" for name in options.peers}
        absent = {name: why for name, why in silent.items() if not any(c.name.startswith(name) for c in every)}
        words = recommend(every, options.tolerance, unit, quantity)
        parts += [
            "## Optimal control",
            f"Reference {quantity} = {truth}. {words}",
            f"Seconds to an error in {quantity}:",
            table.to_accuracy(every, TOLERANCES, unit, absent),
            "Every run; bold: on the Pareto front.",
            table.as_markdown(rows, quantity, unit, optimal, truth.error),
        ]
        table.write(files["csv"], table.as_csv(rows, unit))
        heading = f"optimal control; reference accurate to {truth.error:.0e} {unit}".rstrip()
        halves.append((every, truth.error, heading, f"error in {quantity} [{unit or '1'}]", "seconds, set-up included"))
        account |= {"reference": asdict(truth), "recommendation": words, "front": optimal}
        account["rows"] = [finite(asdict(row)) for row in rows]
    text = "\n\n".join(parts)
    table.write(files["md"], text)
    if halves:
        for suffix in options.formats:
            files[suffix] = options.output / f"{stem}.{suffix}"
            picture.write(files[suffix], halves, f"What accuracy costs: {scene.title}")
    if options.report:
        from html_reports.accuracy_page import write_accuracy_report

        files["report"] = options.output / f"{stem}.html"
        write_accuracy_report(files["report"], scene.title, halves, text)
    progress("done")
    written = [os.fspath(path) for path in files.values() if path.exists()]
    if not options.json:
        print(f"{text}\nfiles: {', '.join(written)}\n")
    return account | {"seconds": progress.elapsed, "files": written}


def contenders(scene: Scene, options: argparse.Namespace) -> list[Contender]:
    """Return the contenders that the options name: every combination, or a star around the default without any."""
    lists = options.schemes, options.degrees, options.controls
    forms = [form for form in options.forms or FORMS if form in scene.problems] or list(scene.problems)
    if options.forms is None and lists == (None, None, None):
        chosen = [(forms[0], schemes([n], [d], [c])[0]) for n, d, c in STAR]
        chosen[1:1] = [(form, chosen[0][1]) for form in forms[1:]]
    else:
        result = schemes(*(given or [default] for given, default in zip(lists, STAR[0], strict=True)))
        chosen = [(form, scheme) for form in forms for scheme in result]
    ours = [on_uniform_grids(form, scheme, options.grids) for form, scheme in chosen if "uniform" in options.methods]
    if "polish" in options.methods:
        ours += [with_polish(form, scheme, COARSE) for form, scheme in chosen[:1]]
    for method, finish in (("refine", None), ("refine+polish", polish)):
        if method in options.methods:
            ours += [refined(form, options.refine_to, options.refine_seconds, finish) for form in forms[:1]]
    grids, limit = options.grids, options.limit_seconds
    theirs = [of_dymos("hp", limit) if name == "dymos" else of_peer(name, grids, limit) for name in options.peers]
    return [*ours, *theirs]


def missing(name: str) -> str:
    """Return why another tool cannot run, or an empty string."""
    return accuracy_dymos.missing() if name == "dymos" else peers.missing(name)


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command_parser(__doc__.splitlines()[0] if __doc__ else "", EXAMPLES)
    add = parser.add_argument
    add("--machine", choices=TASKS, default="spherical", help="which manipulator (default: %(default)s)")
    add("--from", dest="q0", nargs="+", type=float, metavar="Q", help="start, at rest [rad or m]")
    add("--to", dest="q1", nargs="+", type=float, metavar="Q", help="end, at rest [rad or m]")
    add(
        "--limit",
        nargs="+",
        type=float,
        metavar="F",
        help="largest force of every drive [N m or N]",
    )
    add("--problem", nargs="+", choices=CASES, help="problems of the benchmark instead of a machine")
    add("--forms", nargs="+", choices=FORMS, help="forms of the equations")
    add("--schemes", nargs="+", choices=SCHEMES, help="collocation schemes")
    add("--degrees", nargs="+", type=int, metavar="D", help="collocation points of an element")
    add("--controls", nargs="+", choices=[c.value for c in Control], help="shapes of the control on an element")
    add("--grids", nargs="+", type=int, default=list(GRIDS), metavar="N", help="elements (default: %(default)s)")
    add("--methods", nargs="+", choices=METHODS, default=list(METHODS), help="ways to accuracy (default: %(default)s)")
    add("--peers", nargs="+", choices=[*peers.PEERS, "dymos"], default=[], help="other tools, with --problem")
    add("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="of the bill (default: %(default)s)")
    add("--integrators", nargs="+", choices=simulated.NAMES, help="for the simulation (default: all)")
    add("--tolerances", nargs="+", type=float, default=list(simulated.TOLERANCES), metavar="E", help="of integrators")
    add("--steps", nargs="+", type=int, default=list(simulated.STEPS), metavar="K", help="of those without tolerance")
    add("--refine-to", type=float, default=1e-7, metavar="E", help="tolerance of the cost (default: %(default)s)")
    add(
        "--refine-seconds",
        type=float,
        default=15.0,
        metavar="S",
        help="budget of one refinement (default: %(default)s)",
    )
    add("--tolerance", type=float, default=1e-6, metavar="E", help="error to recommend for (default: %(default)s)")
    add("--repeats", type=int, default=3, metavar="K", help="rounds (default: %(default)s)")
    add("--budget", type=float, default=95.0, metavar="S", help="nothing is repeated that would end later [s]")
    add("--limit-seconds", type=float, default=60.0, metavar="S", help="after which another tool is stopped")
    add_output(parser, "CSV, Markdown, pictures and report")
    add("--report", action="store_true", help="write an HTML report with the curves to look into, too")
    add("--json", action="store_true", help="print the account as JSON")
    add("--quiet", action="store_true", help="show no progress")
    return parser


def finite(account: dict[str, object]) -> dict[str, object]:
    """Return plain data with None for numbers that are not finite, which JSON does not have."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in account.items()}


def _silent(_: str) -> None:
    return


if __name__ == "__main__":
    exit_with(main)
