"""Sensitivities of the solution of a sequence: derivatives of durations, cost and signals of all its phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.parallel_phases import ParallelPhases
from ocp.sensitivities.sensitivity import Sensitivity
from ocp.solution.sequence_solution import SequenceSolution


@dataclass(frozen=True, eq=False)
class SequenceSensitivity:
    """Derivatives of the optimum of a Sequence with respect to numbers, per unit of the number.

    Args:
        solution: that was differentiated.
        parallel: the phases of its sequence, as one problem.
        whole: derivatives of the solution of that problem; times in it are shares of the durations.
    """

    solution: SequenceSolution
    parallel: ParallelPhases
    whole: Sensitivity

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers: parameters, and the keys of `toward`."""
        return self.whole.names

    @property
    def cost(self) -> Mapping[str, float]:
        """Name -> derivative of the cost [cost/unit]."""
        return self.whole.cost

    @property
    def durations(self) -> dict[str, Array]:
        """Name -> derivatives of the durations of all phases, (P,) [s/unit]."""
        return {
            name: np.array([free[part.duration] for part in self.parallel.parts])
            for name, free in self.whole.free.items()
        }

    @property
    def duration(self) -> dict[str, float]:
        """Name -> derivative of the duration of the whole motion [s/unit]."""
        return {name: float(np.sum(each)) for name, each in self.durations.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about derivatives that are one-sided, not determined or not accurate."""
        return self.whole.notes

    @property
    def valid(self) -> Mapping[str, tuple[bool, bool]]:
        """Name -> (for a smaller number, for a larger one), whether the derivative holds on that side."""
        return self.whole.valid

    def signal(self, signal: str, share: Array | float, phase: int) -> dict[str, Array]:
        """Return name -> derivative of a signal at shares of the duration of one phase, (K, m) or (m,).

        Args:
            signal: name of a signal of the phase, also "x" and "u".
            share: of the duration of the phase, 0 to 1, (K,) or scalar.
            phase: number of the phase, from 0.

        Raises:
            KeyError: no such signal.
            ValueError: no such phase, or a share outside of 0 to 1.
        """
        checks.text("signal: signal", signal, "the name of a signal")
        checks.whole("signal: phase", phase, 0)
        if phase >= len(self.parallel.parts):
            raise ValueError(f"signal: phase is {phase}, expected a number below {len(self.parallel.parts)}")
        part = self.parallel.parts[phase]
        known = {"x": part.system.x, "u": part.system.u}
        checks.points("share", share, "shares of the duration of the phase, 0 to 1", 0.0, 1.0, least=1)
        return self.whole.signal(part.put(known[signal] if signal in known else part.system[signal]), share)

    def __str__(self) -> str:
        width = max(11, *(len(name) for name in self.names))
        lines = [f"{'per unit of':{width}s}  duration [s]  cost"]
        lines += [f"{n:{width}s}  {self.duration[n]:<12.6g}  {self.cost[n]:<.6g}" for n in self.names]
        return "\n".join([*lines, *self.notes])
