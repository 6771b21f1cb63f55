"""What compiled functions of an element gain and cost, on the problems of the benchmark; prints a table."""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from statistics import median

from benchmarks.problems import CASES
from ocp import Ipopt, Prepared, Solution, prepare, uniform


def _solved(prepared: Prepared) -> Solution:
    solution = prepared()
    assert isinstance(solution, Solution)
    return solution


def measure(name: str, elements: int, repeats: int) -> str:
    """Return a row of the table: plain and compiled solves by turns, in one run.

    Args:
        name: of a problem of the benchmark.
        elements: of the grid.
        repeats: solves of each kind.
    """
    problem, grid, settings = CASES[name]().problem(), uniform(elements), Ipopt()
    with tempfile.TemporaryDirectory() as cache:
        os.environ["HAMEL_CACHE"] = cache
        new = prepare(problem, grid=grid, solver=settings, compiled=True)
        again = prepare(problem, grid=grid, solver=settings, compiled=True)
        kinds = prepare(problem, grid=grid, solver=settings), again
        made, result = new.compilations[0], again.compilations[0]
        if made.note or not result.cached:
            return f"{name:12s} {elements:8d}   {made.note or 'the library was not found again'}"
        pairs = [[_solved(kind) for kind in kinds] for _ in range(repeats)]
    plain, compiled = zip(*pairs, strict=True)
    whole = [median(s.timings.derivatives + s.timings.solver for s in kind) for kind in (plain, compiled)]
    parts = [median(s.timings.derivatives for s in kind) for kind in (plain, compiled)]
    ratio = median(
        (b.timings.derivatives + b.timings.solver) / (a.timings.derivatives + a.timings.solver) for a, b in pairs
    )
    gained = whole[0] * (1.0 - ratio)
    pays = f"{made.seconds / gained:7.0f}" if gained > 0.0 else "  never"
    return (
        f"{name:12s} {elements:8d} {whole[0]:9.4f} {whole[1]:9.4f} {ratio:7.3f} {1.0 - parts[1] / parts[0]:7.2f}"
        f" {made.seconds:9.3f} {result.seconds:8.4f} {pays}"
        f" {abs(plain[0].cost - compiled[0].cost):9.1e}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", nargs="+", choices=list(CASES), default=["P1", "P2", "P3"], metavar="P")
    parser.add_argument("--elements", nargs="+", type=int, default=[50, 200])
    parser.add_argument("--repeats", type=int, default=9)
    given = parser.parse_args(arguments)
    print("             elements   plain  compiled   ratio   saved compiling     load   pays      cost")
    print("                          [s]       [s]         deriv.       [s]      [s]   from differs")
    for name in given.problems:
        for elements in given.elements:
            print(measure(name, elements, given.repeats), flush=True)
    return 0
