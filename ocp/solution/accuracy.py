"""Errors of a solution as values: estimated errors, and the accuracy of one step of a refinement."""

from __future__ import annotations

from dataclasses import dataclass

from ocp.checks import Array
from ocp.system import Label


@dataclass(frozen=True, eq=False)
class Accuracy:
    """How good a rung of a refinement is, what it has cost so far, and why the refinement ended there if it did."""

    error: float  # estimated, in `unit`
    tol: float  # asked for
    unit: str
    what: str  # is wrong by `error`
    seconds: float  # since the refinement began [s]
    errors: Errors
    reason: str = ""  # why this is the last rung; empty if it is not

    @property
    def met(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return self.error <= self.tol

    def __str__(self) -> str:
        ending = f": {self.reason}" if self.reason else ""
        return f"{self.what} to {self.error:.1e} {self.unit}, asked {self.tol:g}, after {self.seconds:.2f} s{ending}"


@dataclass(frozen=True, eq=False)
class Errors:
    """Estimated errors of a solution; each is an amount, zero for an exact solution.

    The cost of the solution differs from the optimal one by at most about `cost`. It is the sum of five parts, each
    the integral of what the motion does wrong, priced by its costates or multipliers, times a factor of safety of 2.
    """

    cost: float  # of the optimal cost [unit of the cost]; inf for a solution that did not converge
    duration: float  # of the optimal duration [s]; zero if it is fixed
    states: Array  # (nx,) largest distance of each state from where its controls bring it [unit of the state]
    dynamics: float  # cost of what the motion violates x' = f(x, u) and of the quadrature; signed
    optimality: float  # cost that the controls leave on the table: integral of H(u) - min H, multipliers spread evenly
    overshoot: float  # cost gained by controls beyond their limits between the points
    violation: float  # cost gained by states beyond their limits between the nodes
    convergence: float  # cost that the solver left at limits of states: multipliers times distances
    hamiltonian: float  # standard deviation of H from its constant value, share of the mean size of its terms
    elements: Array  # (N,) parts of the elements in `cost`
    local: Array  # (N, nx) distance of each state at the end of an element if integrated from its start
    drift: Array  # (N + 1, nx) distance from the motion integrated from x(0), at the ends of elements; signed
    labels: tuple[Label, ...]  # of the states

    def __str__(self) -> str:
        parts = [
            f"cost        {self.cost:.2e}",
            f"  dynamics    {self.dynamics:+.2e}   optimality {self.optimality:.2e}",
            f"  overshoot   {self.overshoot:.2e}   violation  {self.violation:.2e}",
            f"duration    {self.duration:.2e} s",
            *(
                f"{label.name:11s} {error:.2e} {label.unit}"
                for label, error in zip(self.labels, self.states, strict=True)
            ),
            f"Hamiltonian {self.hamiltonian:.2e} share of the mean size of its terms",
        ]
        return "\n".join(parts)
