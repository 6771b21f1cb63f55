"""Seconds, iterations and errors of this project beside hand-written CasADi programs and other tools.

All contenders run in turn (other tools in processes of their own), so that ratios mean something on a busy machine;
absolute figures do not. Nothing is judged by time: exit status 1 means that a solve of this project failed.
"""

from __future__ import annotations

from reports.command import exit_with  # first: it decides how pictures are drawn

# isort: split

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread for everyone; libraries read it when they are loaded

import argparse
import csv
import gc
import sys
import time
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import matplotlib
from benchmarks import hand_written as reference
from benchmarks import peers

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from benchmarks.problems import CASES, Case, RunResult, numbers
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from models.plots.style import saved
from ocp import Guess, Ipopt, smooth, solve, straight_line, uniform, verify
from ocp.numerics.files import written_whole
from ocp.solving.prepared_nlp import forget_structures

GRIDS = (25, 50, 100, 200, 400, 800)
SCALING_GRIDS = (25, 35, 50, 70, 100, 140)
UNLIKE = ("P2", "cylindrical", "torus")  # problems whose controls have unlike scales
VARIANTS = {"element": reference.by_elements, "map": reference.by_map, "sx": reference.by_graph}
SOLVED_UP_TO = {"map": 200, "sx": 200}  # elements; on larger grids only the set-up is of interest
CONTENDERS = {
    "hamel": "this project with every default, the first problem of its structure in a process",
    "again": "this project with every default, the next problem of the same structure",
    "given": "this project, handed the guess that the others are handed",
    "element": "by hand: an SX function of one element, differentiated once, mapped, gathered; same NLP",
    "map": "by hand: that function mapped, CasADi derives; same NLP",
    "sx": "by hand: everything in one SX graph, CasADi derives; same NLP",
    "rockit": "same scheme, guess and scaling",
    "pyomo": "pyomo.dae, same scheme and guess, set-up ends with the NL file",
    "drake": "Hermite-Simpson, linear control, SNOPT, same guess and scaling",
}
COLOURS = {name: f"C{k}" for k, name in enumerate(CONTENDERS)}
COLUMNS = ("setup", "derivatives", "solver", "total", "cpu", "iterations", "cost", "error", "drift")
UNITS = {"iterations": "1", "cost": "s or 1", "error": "as cost", "drift": "share of the largest state"}

Results = dict[tuple[str, int, str], list[RunResult]]  # by problem, elements, contender


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if this project solved everything, else 1."""
    options = command_line().parse_args(arguments)
    if options.quick:
        options.problems, options.grids, options.repeats = options.problems[:2], options.grids[:2], 2
    options.grids.sort()
    absent = {name: peers.missing(name) for name in options.contenders if name in peers.PEERS}
    for name in options.contenders:
        print(f"{name:8s} {absent.get(name) or CONTENDERS[name]}")
    print(f"Wall-clock seconds, medians of {options.repeats} runs in turn, one thread; error: cost less known optimum.")
    results: Results = {}
    for problem in options.problems:
        print(f"\n{CASES[problem]().title}\n{'N':>4s} contender  {' '.join(f'{name:>11s}' for name in COLUMNS)}  note")
        for n in options.grids:
            measure(results, problem, n, absent, options)
            for name in options.contenders:
                if absent.get(name) and n != options.grids[0]:
                    continue
                row = medians(problem, results[problem, n, name])
                figures = " ".join(f"{row[column]:11.5g}" for column in COLUMNS).replace("nan", "  -")
                print(f"{n:4d} {name:9s}  {figures}  {results[problem, n, name][-1].note}".rstrip(), flush=True)
    print("\nRatios of this run: medians over the rounds")
    for text in (*totals(results), *setups(results), *(() if options.quick else scaled(options.problems))):
        print(text, flush=True)
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        write_csv(results, options.output / "benchmark.csv")
        draw(results, options.output / "benchmark.png")
        print(f"\nfiles: {options.output / 'benchmark.csv'}, {options.output / 'benchmark.png'}")
    failed = [
        key for key, runs in results.items() if key[2] in ("hamel", "again", "given") and any(run.note for run in runs)
    ]
    for key in failed:
        print(f"benchmark: {key} is not solved: {results[key][-1].note}", file=sys.stderr)
    return 1 if failed else 0


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None,
        epilog="Example: python scripts/benchmark.py --problems P2 --grids 50 --repeats 3. P2 is the spherical "
        "manipulator. Other tools take part where they are installed (extra bench).",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("--problems", nargs="+", choices=CASES, default=list(CASES), help="which problems")
    add("--grids", nargs="+", type=int, default=list(GRIDS), metavar="N", help="numbers of elements")
    add("--contenders", nargs="+", choices=CONTENDERS, default=list(CONTENDERS), help="who takes part")
    add("--repeats", type=int, default=5, help="runs of each contender on each problem and grid")
    add("--limit", type=float, default=60.0, metavar="S", help="seconds after which a run is stopped")
    add("--budget", type=float, default=30.0, metavar="S", help="seconds of runs after which no more are repeated")
    add(
        "--output", type=Path, metavar="DIR", help="write benchmark.csv and benchmark.png there, in place of older ones"
    )
    add("--quick", action="store_true", help="two problems, two grids, two runs, no scaling study")
    return parser


def measure(results: Results, problem: str, n: int, absent: dict[str, str], options: argparse.Namespace) -> None:
    """Run every contender on a problem and grid in turn, A B C A B C ..., in fresh objects."""
    settings = Ipopt(progress=False, max_seconds=options.limit)
    for _ in range(options.repeats):
        for name in options.contenders:
            runs = results.setdefault((problem, n, name), [])
            stopped = [m for m in options.grids if m < n and results[problem, m, name][-1].note.startswith("stopped")]
            if absent.get(name) or stopped:
                runs[:] = [RunResult(note=absent.get(name) or f"left out, stopped at N = {stopped[0]}")]
            elif not runs or not (runs[-1].note or sum(run.busy for run in runs) > options.budget):
                case = CASES[problem]()
                gc.collect()
                if name in VARIANTS:
                    given, whole = numbers(case, n, settings), n <= SOLVED_UP_TO.get(name, n)
                    runs.append(reference.solve(VARIANTS[name], case, given, whole))
                elif name in peers.PEERS:
                    runs.append(peers.run(name, problem, n, options.limit))
                else:
                    handed = numbers(case, n, settings).guess if name == "given" else None
                    if name != "again":
                        forget_structures()
                    runs.append(own(case, n, settings, handed, first=not runs))


def own(case: Case, n: int, settings: Ipopt, guess: Guess | None, first: bool) -> RunResult:
    """Run this project; what `solve` does besides derivatives and solver counts as set-up, its own guess included."""
    problem = case.problem()
    cpu, begun = time.process_time(), time.perf_counter()
    solution = solve(problem, grid=uniform(n), solver=settings, guess=guess)
    spent, cpu = time.perf_counter() - begun, time.process_time() - cpu
    inside, solver = solution.timings.derivatives, solution.timings.solver
    return RunResult(
        spent - inside - solver, inside, solver, cpu, solution.iterations, solution.cost,
        float(verify(solution).drift) if first else float("nan"), "" if solution.ok else solution.message,
    )  # fmt: skip


def medians(problem: str, runs: Sequence[RunResult]) -> dict[str, float]:
    """Return the medians of the runs of a contender, by column."""
    known = CASES[problem]().known
    row = {}
    for name in COLUMNS:
        values = [run.cost - known if name == "error" else getattr(run, name) for run in runs]
        row[name] = float(np.median([v for v in values if np.isfinite(v)] or [np.nan]))
    return row


def ratio(results: Results, problem: str, one: tuple[int, str], other: tuple[int, str], column: str) -> float:
    """Return the median over the rounds of the ratio of two contenders (elements, name); nan if one is missing."""
    pairs = zip(*(results.get((problem, *who), []) for who in (one, other)), strict=False)
    shares = [getattr(a, column) / getattr(b, column) for a, b in pairs]
    return float(np.median([share for share in shares if np.isfinite(share)] or [np.nan]))


def totals(results: Results) -> list[str]:
    """Return the ratios of totals on grids of 50 and 200 elements, and of their parts."""
    lines = []
    for problem in dict.fromkeys(key[0] for key in results):
        for n in (50, 200):
            for name in ("hamel", "again", "given"):
                shares = {c: ratio(results, problem, (n, name), (n, "element"), c) for c in COLUMNS[:6]}
                if np.isfinite(shares["total"]):
                    parts = ", ".join(f"{c} {shares[c]:.2f}" for c in COLUMNS[:6] if c != "total")
                    lines.append(f"{problem} N = {n}: {name} / element in total {shares['total']:.2f} ({parts})")
            others = [(name, ratio(results, problem, (n, name), (n, "hamel"), "total")) for name in CONTENDERS]
            result = [f"{name} {share:.3g}" for name, share in others if np.isfinite(share) and name != "hamel"]
            lines += [f"{problem} N = {n}: in total, times hamel: {', '.join(result)}"] if result else []
    return lines


def setups(results: Results) -> list[str]:
    """Return how the set-up grows with the grid, and what it is beside that of one graph."""
    lines = []
    for problem in dict.fromkeys(key[0] for key in results):
        for name in ("hamel", "given", "element"):
            seconds = {
                n: medians(problem, runs)["setup"]
                for (p, n, who), runs in results.items()
                if (p, who) == (problem, name)
            }
            if len(seconds) < 3:
                continue
            grids = sorted(seconds)
            low, high = grids[0], grids[-1]
            # The median of all slopes does not depend on one grid that was measured at a bad moment.
            slope = np.median([(seconds[n] - seconds[m]) / (n - m) for m, n in combinations(grids, 2)])
            rest = (seconds[high] - slope * (high - low)) / seconds[low]
            graph = ratio(results, problem, (high, name), (high, "sx"), "setup")
            beside = f"; N = {high}, {name} / sx: {graph:.3f}, goal 0.2" if np.isfinite(graph) else ""
            lines.append(
                f"{problem}: set-up of {name}, N = {high} / N = {low}: {seconds[high] / seconds[low]:.2f}; without the "
                f"linear part, {1e3 * slope:.3f} ms per element: {rest:.2f}, goal 3{beside}"
            )
    return lines


def scaled(problems: Sequence[str]) -> list[str]:
    """Return iterations with scaled unknowns beside those without, over six grids and from two guesses."""
    lines = []
    for problem in (problem for problem in problems if problem in UNLIKE):
        for make in (straight_line, smooth):
            iterations, seconds, unsolved = [], [], []
            for flag in (True, False):
                results = []
                for n in SCALING_GRIDS:
                    task = CASES[problem]().problem()
                    settings = Ipopt(progress=False, scaled=flag)
                    results.append(solve(task, grid=uniform(n), solver=settings, guess=make(task, [])))
                iterations.append([solution.iterations for solution in results])
                seconds.append(sum(solution.timings.total for solution in results))
                unsolved.append(sum(not solution.ok for solution in results))
            one, other = iterations
            lines.append(
                f"{problem} from {make.__name__}: iterations scaled / unscaled over N = {SCALING_GRIDS}: {sum(one)} / "
                f"{sum(other)} = {sum(one) / sum(other):.2f}, goal 0.60 ({one}, {other}); not solved {unsolved[0]}, "
                f"{unsolved[1]}; seconds {seconds[0]:.2f}, {seconds[1]:.2f}"
            )
    return lines


def write_csv(results: Results, path: Path) -> None:
    """Write the medians of every contender; the header has names and units."""
    with written_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        head = ["problem", "elements", "contender", "runs"]
        writer.writerow([*head, *(f"{name} [{UNITS.get(name, 's')}]" for name in COLUMNS), "note"])
        for (problem, n, name), runs in results.items():
            row = medians(problem, runs)
            done = sum(not run.note for run in runs)
            writer.writerow([problem, n, name, done, *(repr(row[column]) for column in COLUMNS), runs[-1].note])


def draw(results: Results, path: Path) -> None:
    """Draw total seconds (lines) and set-up (dots) against the number of elements, one small picture per problem."""
    problems = list(dict.fromkeys(key[0] for key in results))
    columns = min(3, len(problems))
    shape = -(-len(problems) // columns), columns
    figure, axes = plt.subplots(
        *shape, figsize=(4.2 * shape[1] + 0.6, 3.2 * shape[0] + 0.9), sharex=True, squeeze=False, layout="constrained"
    )
    for number, axis in enumerate(axes.ravel()):
        if number >= len(problems):
            axis.set_axis_off()
            continue
        curve(axis, results, problems[number], "total", "-o")
        curve(axis, results, problems[number], "setup", ":")
        axis.set(xscale="log", yscale="log", xlabel="elements", ylabel="seconds")
        grids = sorted({key[1] for key in results})
        axis.set_xticks(grids, [str(n) for n in grids])
        axis.minorticks_off()
        axis.set_title(CASES[problems[number]]().title, fontsize=9)
        axis.grid(visible=True, color="#e5e8eb", linewidth=0.6)
    shown = [name for name in CONTENDERS if any(key[2] == name for key in results)]
    handles = [Line2D([], [], color=COLOURS[name], marker="o", markersize=3, label=name) for name in shown]
    handles.append(Line2D([], [], color="#555555", linestyle=":", label="set-up alone"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8, frameon=False)
    saved(figure, path, dpi=130)


def curve(axis: Axes, results: Results, problem: str, column: str, style: str) -> None:
    """Draw one column of every contender that has it."""
    for name in CONTENDERS:
        rows = [
            (key[1], medians(problem, runs)[column]) for key, runs in results.items() if key[::2] == (problem, name)
        ]
        points = [row for row in rows if np.isfinite(row[1])]
        if points:
            axis.plot(*zip(*points, strict=True), style, color=COLOURS[name], markersize=3, linewidth=1.2)


if __name__ == "__main__":
    exit_with(main)
