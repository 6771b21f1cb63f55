"""Measurement of contenders: repeated in turn, verified once, medians taken, errors against a reference."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from accuracy_bill.contenders import Contender, Run
from accuracy_bill.pareto_front import Curve, Point
from accuracy_bill.reference import Reference
from accuracy_bill.scene import Scene
from ocp import Solution, estimate, verify

BROKEN = 2e-3  # share of its range by which a limit may be exceeded between nodes, as in `Report.failures`


@dataclass(frozen=True)
class Row:
    """One setting of one contender: errors, and medians of seconds; nan for what is not known."""

    contender: str
    label: str
    continuous: bool
    cost: float
    error: float = float("nan")  # |cost - reference|
    estimate: float = float("nan")  # of that error, made without the reference
    drift: float = float("nan")  # distance of the re-simulated motion at its end, share of the size of each state
    violation: float = float("nan")  # of limits between nodes, share of their range
    setup: float = float("nan")  # [s]
    derivatives: float = float("nan")  # [s]
    solver: float = float("nan")  # [s]
    total: float = float("nan")  # [s]
    runs: int = 0
    note: str = ""

    @property
    def keeps(self) -> bool:
        """Whether the motion keeps its limits also between nodes, as far as known."""
        return not self.violation > BROKEN


@dataclass(frozen=True)
class Progress:
    """Shows on one line what is being measured: elapsed seconds, cases done."""

    write: Callable[[str], object]
    begun: float = field(default_factory=time.perf_counter)

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return time.perf_counter() - self.begun

    def __call__(self, what: str) -> None:
        """Write a line."""
        self.write(f"[{self.elapsed:6.1f} s] {what}\n")


def measure(
    contenders: Sequence[Contender], scene: Scene, repeats: int, budget: float, progress: Progress
) -> list[Row]:
    """Run every contender in turn, A B C A B C ..., and return the medians of all its settings, without errors.

    Args:
        contenders: to run.
        scene: they run on.
        repeats: number of rounds.
        budget: seconds; no contender is repeated that would probably end later. The first round is complete.
        progress: called with the name of every contender and round.
    """
    runs: dict[tuple[str, str], list[Run]] = {}
    rows: dict[tuple[str, str], Row] = {}
    lasted: dict[str, float] = {}
    for k in range(repeats):
        left_out = []
        for c, contender in enumerate(contenders, 1):
            begun = progress.elapsed
            if k and begun + lasted[contender.name] > budget:
                left_out.append(contender.name)
                continue
            gc.collect()
            for run in contender.runs(scene):
                key = contender.name, run.label
                runs.setdefault(key, []).append(replace(run, solution=None))
                if key not in rows:
                    row = Row(contender.name, run.label, contender.continuous, run.cost, note=run.note)
                    rows[key] = verified(row, run.solution) if run.solution is not None else row
                gc.collect()
            lasted[contender.name] = progress.elapsed - begun
            progress(f"round {k + 1} of {repeats}, contender {c} of {len(contenders)}: {contender.name}")
        if left_out:
            progress(f"round {k + 1} of {repeats} would exceed {budget:g} s with {'; '.join(left_out)}")
    return [_with_medians(row, runs[key]) for key, row in rows.items()]


def verified(row: Row, solution: Solution) -> Row:
    """Return the row with what an independent look at the solution finds."""
    report = verify(solution)
    return replace(
        row, estimate=estimate(solution).cost, drift=float(report.drift_end), violation=float(report.violation)
    )


def against(rows: Sequence[Row], reference: Reference) -> list[Row]:
    """Return the rows with their true errors, as far as the reference allows."""
    return [replace(row, error=abs(row.cost - reference.cost)) for row in rows]


def curves(rows: Sequence[Row], reference: Reference) -> list[Curve]:
    """Return the curve of every contender with a solution; errors below that of the reference count as that."""
    results = []
    for name in dict.fromkeys(row.contender for row in rows if not row.note):
        own = [row for row in rows if row.contender == name and not row.note]
        points = tuple(Point(row.label, max(row.error, reference.error), row.total, row.keeps) for row in own)
        results.append(Curve(name, points, own[0].continuous))
    return results


def _with_medians(row: Row, runs: Sequence[Run]) -> Row:
    def median(name: str) -> float:
        return float(np.median([getattr(run, name) for run in runs]))

    failed = next((run.note for run in runs if run.note), "")
    return replace(
        row, setup=median("setup"), derivatives=median("derivatives"), solver=median("solver"), total=median("total"),
        runs=len(runs), note=row.note or failed,
    )  # fmt: skip
