"""The report of a verification: figures with their units, what is allowed of them, and the cure of what is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from ocp import checks
from ocp.solution.figure import Figure


@dataclass(frozen=True)
class Allowed:
    """What `verify` accepts; every figure is a share of something physical.

    Args:
        drift: of the re-integrated motion from the one found, share of the range of each state.
        violation: of a limit between the nodes, share of the range of a bounded quantity or the depth of an obstacle.
        energy: error of the energy balance, share of the energy turned over.
        hamiltonian: distance of the mean Hamiltonian from its optimal value, share of its terms.
        switching: gain of the cost that the controls leave, share of the cost.

    Raises:
        ValueError: a number that is not > 0; infinity accepts everything.
    """

    drift: float = 1e-6
    violation: float = 2e-3
    energy: float = 1e-6
    hamiltonian: float = 1e-2
    switching: float = 2e-2

    def __post_init__(self) -> None:
        for part in fields(self):
            checks.number(f"Allowed: {part.name}", getattr(self, part.name), "a share > 0", above=0.0, finite=False)


WORDS = {
    "drift": "the re-integrated motion drifts away by",
    "violation": "a limit is exceeded by",
    "energy": "the energy balance is open by",
    "hamiltonian": "the Hamiltonian is away from its value by",
    "switching": "the switching functions leave a gain of",
}


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
    switching: Figure  # decrease of the Hamiltonian, to second order, that the controls leave, over the whole motion
    energy: Figure  # supplied energy minus losses minus the change of the stored energy
    excess: tuple[Figure, ...]  # violation of every limited component in its own unit
    allowed: Allowed = field(default_factory=Allowed)
    amounts: Mapping[str, str] = field(default_factory=dict)  # of drift, violation and switching, in physical units
    elements: int = 0  # of the grid
    order: int = 1  # of the scheme

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Sentences on what is not verified, each with its cure; empty for a verified solution."""
        result = [] if self.status == "SOLVED" else [f"the solver ended with {self.status}"]
        for name in self._failed:
            amount = f", that is {self.amounts[name]}" if self.amounts.get(name) else ""
            limit = getattr(self.allowed, name)
            result.append(f"{WORDS[name]} {self._figure(name)}{amount}, allowed are {limit:g}: {self.cures[name]}")
        return tuple(result)

    @cached_property
    def cures(self) -> dict[str, str]:
        """For the name of each figure that is not accepted, what to do."""
        results = {}
        for name in self._failed:
            more = self.more_elements(name)
            count = f" (or about {more} elements more)" if more else ""
            results[name] = {
                "drift": f"resolved(solution) splits the elements where it drifts{count}",
                "energy": f"resolved(solution) splits the elements where it drifts{count}",
                "violation": f"a finer grid{f', about {more} elements more' if more else ''}, or solve_to_accuracy",
            }.get(name, "solve_to_accuracy or polish(solution) finds the rest")
        return results

    def more_elements(self, name: str) -> int:
        """Return about how many elements more bring a figure within what is allowed; 0 if that cannot be said.

        Drift and energy fall with the order of the scheme where rates are smooth, the excess over a limit between the
        nodes with the square of the width.

        Args:
            name: drift, violation, energy, hamiltonian or switching; 0 for the last two.

        Raises:
            ValueError: no such figure.
        """
        if not isinstance(name, str) or name not in WORDS:
            raise checks.refused("name", name, f"one of {', '.join(WORDS)}")
        powers = {"drift": self.order, "energy": self.order, "violation": 2}
        if name not in powers:
            return 0
        figure = float(self._figure(name))
        if not self.elements or not np.isfinite(figure) or figure <= 0.0:
            return 0
        factor = min((figure / getattr(self.allowed, name)) ** (1.0 / powers[name]), 20.0)
        return max(int(np.ceil(self.elements * (factor - 1.0) / 10.0)) * 10, 0)

    def _figure(self, name: str) -> Figure:
        figure: Figure = self.hamiltonian_offset if name == "hamiltonian" else getattr(self, name)
        return figure

    @cached_property
    def _failed(self) -> tuple[str, ...]:
        figures = {name: self._figure(name) for name in WORDS}
        return tuple(
            name
            for name, figure in figures.items()
            if figure > getattr(self.allowed, name) or (np.isnan(figure) and figure.what != "undefined")
        )

    @property
    def ok(self) -> bool:
        """Whether the solution is verified."""
        return not self.failures

    def __str__(self) -> str:
        names = ("drift", "drift_end", "violation", "hamiltonian", "switching", "energy")
        lines = [f"{name:12s} {getattr(self, name)}" for name in names]
        lines.insert(4, f"{'H':12s} {self.hamiltonian_value:.6g} (mean)")
        return "\n".join([*lines, "verified" if self.ok else "not verified: " + "; ".join(self.failures)])
