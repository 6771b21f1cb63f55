"""Seconds per case of a study of the spherical manipulator against single solves from nothing, in one run.

200 cases, payload x torque limit, as in `scripts/scenes/study.toml`: from nothing, from neighbours, with the structure
of neighbours carried over, in one and in two processes; what was found is compared case by case.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from reports import study_file

from ocp import Ipopt, Solution, Study, StudyTable, radau, solve, uniform
from ocp.studies.case_call import call

FILE = Path(__file__).resolve().parents[1] / "scenes" / "study.toml"
ROUNDS = 5  # single solves before, and as many after


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if all kinds of study find the same."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("study", nargs="?", type=Path, default=FILE, help="scene file with a table [study]")
    options = parser.parse_args(arguments)
    study, _ = study_file.load(options.study, None)
    kinds = {
        "from nothing, 1 process": (_variant(study, polished=False, neighbours=False), None),
        "from neighbours, 1 process": (_variant(study, polished=False, neighbours=True), None),
        "from neighbours, 2 processes": (_variant(study, polished=False, neighbours=True), 2),
        "structure carried over, 1 process": (_variant(study, polished=True, neighbours=True), None),
        "structure carried over, 2 processes": (_variant(study, polished=True, neighbours=True), 2),
    }
    single, tables = [_single(study) for _ in range(ROUNDS)], {}
    print(f"{len(study.cases)} cases; seconds are of this run, only ratios mean something")
    for name, (variant, jobs) in kinds.items():
        single += [_single(study) for _ in range(2)]
        begun = time.perf_counter()
        table = variant.run(partial(ProcessPoolExecutor, jobs) if jobs else None)
        tables[name] = table, time.perf_counter() - begun
    single += [_single(study) for _ in range(ROUNDS)]
    cold = statistics.median(single)
    print(f"one solve from nothing, system given: {cold:.4f} s (median of {len(single)}, spread over the run)\n")
    print("| study | seconds | per case / one solve | failed |\n|---|---:|---:|---:|")
    for name, (table, seconds) in tables.items():
        print(f"| {name} | {seconds:.2f} | {seconds / len(table) / cold:.3f} | {len(table.failures)} |")
    for name, (table, _) in tables.items():
        print(f"\n{name}\n{_shares(table, cold)}")
    return _compared({name: table for name, (table, _) in tables.items()})


def _variant(study: Study, polished: bool, neighbours: bool) -> Study:
    return Study(study.function, study.over, scheme=study.scheme, grid=study.grid, polished=polished,
                 neighbours=neighbours, checked=study.checked, measure=study.measure)  # fmt: skip


def _single(study: Study) -> float:
    """Return the seconds of one solve from nothing, problem and NLP included, the system given."""
    case = study.cases[len(study.cases) // 2]
    begun = time.perf_counter()
    problem, values = call(study.function, case)
    result = solve(problem, study.scheme or radau(3), study.grid or uniform(50), Ipopt(progress=False), values=values)
    assert isinstance(result, Solution)
    return time.perf_counter() - begun


def _shares(table: StudyTable, cold: float) -> str:
    ways, seconds = table["way"], table["seconds"]
    lines = ["| way | cases | share of the seconds | median / one solve |", "|---|---:|---:|---:|"]
    for way in sorted(set(ways), key=lambda w: -int(np.sum(ways == w))):
        own = ways == way
        share, median = seconds[own].sum() / seconds.sum(), np.median(seconds[own]) / cold
        lines.append(f"| {way} | {own.sum()} | {share:.3f} | {median:.3f} |")
    return "\n".join(lines)


def _compared(tables: dict[str, StudyTable]) -> int:
    """Print how much the kinds of study differ; 1 if processes do."""
    names, wrong = list(tables), 0
    print()
    for one, other in ((names[1], names[2]), (names[3], names[4])):
        same = [(r.way, dict(r.results)) for r in tables[one].records if r] == [
            (r.way, dict(r.results)) for r in tables[other].records if r
        ]
        wrong |= not same
        print(f"{one} and {other}: {'identical in every digit' if same else 'NOT identical'}")
    for one, other in ((names[0], names[1]), (names[1], names[3])):
        away = tables[other]["cost"] / tables[one]["cost"] - 1.0
        worst, best = int(np.nanargmax(away)), int(np.nanargmin(away))
        print(f"cost {other} against {one}: {away[best]:+.2e} (case {best}) to {away[worst]:+.2e} (case {worst}), "
              f"median {np.nanmedian(away):+.2e}, above 1e-5 in {int(np.sum(away > 1e-5))} cases")  # fmt: skip
    return wrong
