"""The report of a verification: figures with their units, and the sentences on what is not verified."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp.solution.figure import Figure


@dataclass(frozen=True, eq=False)
class Report:
    """Result of an independent check of a solution; every figure is zero for an exact one, NaN if undefined."""

    status: str  # of the solver
    drift: Figure  # largest distance between the re-integrated motion and the solution, over all times
    drift_end: Figure  # the same at the end
    violation: Figure  # largest excess over a limit, also between the nodes
    hamiltonian: Figure  # largest deviation of the Hamiltonian from its constant value
    hamiltonian_value: float  # its mean; minus the weight of time for a free duration [cost/s]
    hamiltonian_offset: Figure  # distance of the mean from that value
    switching: Figure  # gain that the controls leave, to first order: integral of H(u) - min H
    energy: Figure  # supplied energy minus losses minus the change of the stored energy
    excess: tuple[Figure, ...]  # violation of every limited component in its own unit

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Sentences on what is not verified; empty for a verified solution."""
        result = [] if self.status == "SOLVED" else [f"the solver ended with {self.status}"]
        checks = (
            ("the re-integrated motion drifts away by", self.drift, 1e-6),
            ("a limit is exceeded by", self.violation, 2e-3),
            ("the energy balance is open by", self.energy, 1e-6),
            ("the Hamiltonian is away from its value by", self.hamiltonian_offset, 1e-2),
            ("the switching functions leave a gain of", self.switching, 2e-2),
        )
        for words, figure, allowed in checks:
            if figure > allowed or (np.isnan(figure) and figure.what != "undefined"):
                result.append(f"{words} {figure}, allowed are {allowed:g}")
        return tuple(result)

    @property
    def ok(self) -> bool:
        """Whether the solution is verified."""
        return not self.failures

    def __str__(self) -> str:
        names = ("drift", "drift_end", "violation", "hamiltonian", "switching", "energy")
        lines = [f"{name:12s} {getattr(self, name)}" for name in names]
        lines.insert(4, f"{'H':12s} {self.hamiltonian_value:.6g} (mean)")
        return "\n".join([*lines, "verified" if self.ok else "not verified: " + "; ".join(self.failures)])
