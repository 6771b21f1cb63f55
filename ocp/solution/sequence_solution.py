"""The solution of a sequence of problems: one solution for each phase, in order of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.sequence import Sequence
from ocp.solution.accuracy import Accuracy
from ocp.solution.solution import OUTSIDE, Solution, Status, Timings
from ocp.solution.structure import Row, Structure
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme


@dataclass(frozen=True, eq=False)
class SequenceSolution:
    """The solution of a Sequence: one Solution for each problem, in order of time, and their common status."""

    phases: tuple[Solution, ...]
    status: Status
    message: str
    solver_status: str
    cost: float
    timings: Timings
    iterations: int
    problem: Sequence
    accuracy: Accuracy | None = None  # of a step of solve_to_accuracy
    parallel: Structure | None = None  # switching structure of the phases in parallel, times are shares of durations

    @property
    def ok(self) -> bool:
        """Whether the solver met its tolerance."""
        return self.status is Status.SOLVED

    @property
    def duration(self) -> float:
        """Sum of the durations [s]."""
        return sum(phase.duration for phase in self.phases)

    @property
    def junctions(self) -> Array:
        """(P + 1,) times at which the phases begin, and the end [s]."""
        return np.concatenate([[0.0], np.cumsum([phase.duration for phase in self.phases])])

    @property
    def t(self) -> Array:
        """Times of all nodes and collocation points of all phases, increasing [s]."""
        return np.unique(np.concatenate([a + phase.t for a, phase in zip(self.junctions, self.phases, strict=False)]))

    @property
    def grid(self) -> Grid:
        """The grid of every phase."""
        return self.phases[0].grid

    @property
    def scheme(self) -> Scheme:
        """The collocation scheme of every phase."""
        return self.phases[0].scheme

    @property
    def error(self) -> Array:
        """(P N,) relative local error of the dynamics on every element, phase after phase; see `Solution.error`."""
        return np.concatenate([phase.error for phase in self.phases])

    @property
    def structure(self) -> Structure | None:
        """The switching structure of the whole motion, times from its start; None if it is not polished."""
        known = [phase.structure for phase in self.phases if phase.structure is not None]
        if len(known) < len(self.phases):
            return None
        shifted = [
            row._replace(start=float(begun + row.start), end=float(begun + row.end))
            for begun, structure in zip(self.junctions, known, strict=False)
            for row in structure.rows
        ]
        rows: list[Row] = []
        for name in dict.fromkeys(row.name for row in shifted):
            for row in (row for row in shifted if row.name == name):
                last = rows[-1] if rows else None
                goes_on = last is not None and (last.name, last.kind) == (name, row.kind) and row.start < row.end
                if last is not None and goes_on and row.start - last.end <= OUTSIDE * self.duration:
                    rows[-1] = last._replace(end=row.end)
                else:
                    rows.append(row)
        return Structure(tuple(rows), tuple(arc for structure in known for arc in structure.arcs))

    def x(self, t: Array | float) -> Array:
        """Return the state at times t [s] of the whole motion, shape (K, nx) or (nx,).

        Raises:
            ValueError: t lies outside the motion, or the systems have several numbers of states.
        """
        return self._evaluate(Solution.x, t, "states")

    def u(self, t: Array | float) -> Array:
        """Return the control at times t [s] of the whole motion, shape (K, nu) or (nu,); raises as `x`."""
        return self._evaluate(Solution.u, t, "controls")

    def costate(self, t: Array | float) -> Array:
        """Return the costate at times t [s] of the whole motion, shape (K, nx) or (nx,); raises as `x`."""
        return self._evaluate(Solution.costate, t, "states")

    def __repr__(self) -> str:
        parts = ", ".join(f"{phase.duration:.6g}" for phase in self.phases)
        return f"SequenceSolution({self.status.name.lower()}, durations {parts} s, cost {self.cost:.9g})"

    def signal(self, signal: str, t: Array | float) -> Array:
        """Return a signal that all systems have at times t [s] of the whole motion, shape (K, m) or (m,)."""
        checks.text("signal", signal, "the name of a signal that all systems have")
        return self._evaluate(lambda phase, time: phase.signal(signal, time), t)

    def _evaluate(self, of: Callable[[Solution, Array | float], Array], t: Array | float, columns: str = "") -> Array:
        """Return what a phase has at times of the whole motion; a junction belongs to the phase after it."""
        sizes = {getattr(phase, columns).shape[2] for phase in self.phases} if columns else {1}
        if len(sizes) > 1:
            raise ValueError(f"the phases have {sizes} {columns}; use signal(name, t), or the phases one by one")
        end = self.duration
        wanted, slack = f"times within the motion, 0 to {end} s", OUTSIDE * end
        times = checks.points("t", t, wanted, -slack, end + slack, least=1)
        starts = self.junctions
        number = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(self.phases) - 1)
        parts = [
            of(self.phases[k], float(np.clip(time - starts[k], 0.0, self.phases[k].duration)))
            for k, time in zip(number, times, strict=True)
        ]
        return np.array(parts) if np.ndim(t) else parts[0]


Motion = TypeVar("Motion", Solution, SequenceSolution)  # a function returns the kind that it is given
