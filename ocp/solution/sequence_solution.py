"""The solution of a sequence of problems: one solution for each phase, in order of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.sequence import Sequence
from ocp.solution.solution import OUTSIDE, Solution, Status, Timings


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

    def __repr__(self) -> str:
        parts = ", ".join(f"{phase.duration:.6g}" for phase in self.phases)
        return f"SequenceSolution({self.status.name.lower()}, durations {parts} s, cost {self.cost:.9g})"

    def signal(self, signal: str, t: Array | float) -> Array:
        """Return a signal that all systems have at times t [s] of the whole motion, shape (K, m) or (m,)."""
        checks.text("signal", signal, "the name of a signal that all systems have")
        end = self.duration
        wanted, slack = f"times within the motion, 0 to {end} s", OUTSIDE * end
        times = checks.points("t", t, wanted, -slack, end + slack, least=1)
        starts = self.junctions
        phase = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(self.phases) - 1)
        parts = [
            self.phases[k].signal(signal, np.clip(time - starts[k], 0.0, self.phases[k].duration))
            for k, time in zip(phase, times, strict=True)
        ]
        return np.array(parts) if np.ndim(t) else parts[0]
