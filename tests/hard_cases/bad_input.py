"""Stability suite: bad input to everything public, and broken files, each lead to an error of one sentence."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path

from hard_cases import input_files, input_models, input_ocp, input_pairs, input_stores, input_studies, input_trees
from hard_cases.case import Case, Figure
from hard_cases.input_call import BAD, Call, Fault, extremes, refusals

Refusals = Iterable[tuple[str, str, Fault | None]]


def figure(result: Refusals) -> Figure:
    """Return the number of bad values that do not lead to one sentence naming the argument; none is tolerated."""
    faults = [fault for _, _, fault in result]
    wrong = [fault for fault in faults if fault is not None]
    note = f"{len(faults)} bad values" + (f"; {wrong[0]}" if wrong else "")
    return Figure(float(len(wrong)), 0.0, note=note)


def _refused(package: Callable[[], tuple[Call, ...]]) -> Callable[[], Iterator[Figure]]:
    def measure() -> Iterator[Figure]:
        for call in package():
            if call.needs and importlib.util.find_spec(call.needs) is None:
                continue
            call()  # the valid call is one
            if call.arguments:
                yield figure((*refusals(call), *extremes(call)))

    return measure


def _pairs() -> Iterator[Figure]:
    for _, result in groupby(input_pairs.refusals(), key=lambda results: results[0]):
        yield figure(result)


def _files() -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        every = (*input_files.refusals(Path(folder)), *input_stores.refusals(Path(folder)))
        for _, result in groupby(every, key=lambda results: results[0]):
            yield figure(result)


QUANTITY = f"errors for {len(BAD)} bad values of each argument that are not one sentence naming it"
PARTS: tuple[tuple[str, Callable[[], tuple[Call, ...]]], ...] = (
    ("systems, constraints and problems", input_ocp.systems),
    ("regions", input_ocp.regions),
    ("grids, schemes, guesses, settings, tolerances", input_ocp.grids),
    ("integrators and simulation", input_ocp.methods),
    ("solving, refining, verifying, solutions", input_ocp.solves),
    ("designs and sweeps", input_studies.designs),
    ("studies and their tables", input_studies.studies),
    ("stores of studies", input_studies.stores),
    ("sensitivities, structures carried over, compilation", input_studies.optima),
    ("machines, forms, scenes", input_models.machines),
    ("effects", input_models.acting),
    ("joints, links, trees", input_trees.trees),
    ("motions, paths, drives", input_models.motions),
)
LONG = ("solving, refining, verifying, solutions", "motions, paths, drives")
CASES: tuple[Case, ...] = (
    *(Case("input", name, QUANTITY, "", _refused(package), name not in LONG) for name, package in PARTS),
    Case("input", "parts that do not belong together", "errors that are not one sentence naming one", "", _pairs),
    Case("input", "broken files and stores", "errors that are not one sentence naming the file", "", _files),
)
