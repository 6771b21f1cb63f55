"""Contenders of the accuracy bill: ways to a solution, each a series of runs that cost more and err less."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

from benchmarks import peers

from accuracy_bill.scene import Scene
from ocp import (
    Control,
    Ipopt,
    Scheme,
    Solution,
    Timings,
    polish,
    solve,
    solve_to_accuracy,
    uniform,
)
from ocp.transcription.schemes.families import FAMILIES

SCHEMES = dict(FAMILIES)
SETTINGS = Ipopt(progress=False)


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a contender; seconds count everything from the equations to the solution."""

    label: str
    cost: float
    setup: float  # [s]; equations, transcription, derivatives of the graph, guess
    derivatives: float  # evaluation of cost, constraints and their derivatives [s]; nan if not reported
    solver: float  # the rest [s]
    solution: Solution | None = None  # None for other tools
    note: str = ""  # why there is no solution

    @property
    def total(self) -> float:
        """All seconds."""
        return self.setup + (self.derivatives if self.derivatives == self.derivatives else 0.0) + self.solver


@dataclass(frozen=True, eq=False)
class Contender:
    """A named series of runs on a scene."""

    name: str
    runs: Callable[[Scene], Iterator[Run]]
    continuous: bool = False  # settings between two runs exist


def on_uniform_grids(form: str, scheme: Scheme, grids: Sequence[int]) -> Contender:
    """Return the contender that solves on uniform grids of so many elements, each from nothing."""

    def runs(scene: Scene) -> Iterator[Run]:
        for n in sorted(grids):
            begun = time.perf_counter()
            problem = scene.problems[form]()
            solution = solve(problem, scheme=scheme, grid=uniform(n), solver=SETTINGS)
            yield counted(f"{n} elements", solution, time.perf_counter() - begun)

    return Contender(f"{_prefix(form)}{described(scheme)}, uniform", runs, continuous=True)


def with_polish(form: str, scheme: Scheme, grids: Sequence[int]) -> Contender:
    """Return the contender that polishes the solution on a uniform grid: switching times become unknowns.

    What cannot be polished is no run of it; the seconds of the grid are counted.
    """

    def runs(scene: Scene) -> Iterator[Run]:
        for n in sorted(grids):
            begun = time.perf_counter()
            first = solve(scene.problems[form](), scheme=scheme, grid=uniform(n), solver=SETTINGS)
            second = polish(first)
            spent = Timings(0.0, *(getattr(first.timings, part) + getattr(second.timings, part)
                                   for part in ("derivatives", "solver", "total")))  # fmt: skip
            run = counted(f"{n} elements", replace(second, timings=spent), time.perf_counter() - begun)
            yield run if second.structure is not None else replace(run, solution=None, note=second.message)

    return Contender(f"{_prefix(form)}{described(scheme)}, uniform, then polish", runs)


def refined(form: str, tol: float, seconds: float, finish: Callable[[Solution], Solution] | None = None) -> Contender:
    """Return the contender that refines until the estimated error is within `tol`, with every rung of its ladder.

    Args:
        form: of the equations.
        tol: of the cost, in its unit.
        seconds: no rung is begun that would probably end later [s].
        finish: a last stage that is tried on every rung, such as `polish`.
    """

    def runs(scene: Scene) -> Iterator[Run]:
        begun = time.perf_counter()
        problem = scene.problems[form]()
        before = time.perf_counter() - begun
        # All rungs first: what is done with one between two of them must not count.
        rungs = list(solve_to_accuracy(problem, tol, seconds=seconds, finish=finish))
        inside = solver = 0.0
        for k, rung in enumerate(rungs, 1):
            inside, solver = inside + rung.timings.derivatives, solver + rung.timings.solver
            spent = Timings(0.0, inside, solver, inside + solver)
            elapsed = before + (rung.accuracy.seconds if rung.accuracy else float("nan"))
            label = f"rung {k}, {len(rung.grid)} elements{', polished' if rung.structure is not None else ''}"
            yield counted(label, replace(rung, timings=spent), elapsed)

    words = f"refined to {tol:.0e}" + (f", then {finish.__name__}" if finish else "")
    return Contender(f"{_prefix(form)}{words}", runs)


def of_peer(name: str, grids: Sequence[int], limit: float) -> Contender:
    """Return another tool of the benchmark on uniform grids, each run a process of its own of at most `limit` s."""

    def runs(scene: Scene) -> Iterator[Run]:
        absent = peers.missing(name)
        for n in () if absent or not scene.peer else sorted(grids):
            done = peers.run(name, scene.peer, n, limit)
            yield Run(f"{n} elements", done.cost, done.setup, done.derivatives, done.solver, note=done.note)
            if done.note.startswith("stopped"):
                return

    return Contender(name, runs, continuous=True)


def counted(label: str, solution: Solution, elapsed: float) -> Run:
    """Return the run that led to a solution in `elapsed` seconds; what the solver does not report counts as set-up."""
    inside, solver = solution.timings.derivatives, solution.timings.solver
    note = "" if solution.ok else solution.message
    return Run(label, solution.cost, max(elapsed - inside - solver, 0.0), inside, solver, solution, note)


def described(scheme: Scheme) -> str:
    """Return the name of a scheme and of the shape of its control."""
    return f"{scheme.name}({scheme.degree}) {scheme.control.value}"


def schemes(names: Sequence[str], degrees: Sequence[int], controls: Sequence[str]) -> tuple[Scheme, ...]:
    """Return every combination; combinations that do not exist (Lobatto of degree 1) are left out."""
    every = product(names, degrees, controls)
    return tuple(SCHEMES[n](d, Control(c)) for n, d, c in every if not (n == "lobatto" and d < 2))


def _prefix(form: str) -> str:
    return "" if form == "ode" else f"{form}, "
