"""Estimated errors of a solution, and the accuracy reached by one step of a refinement."""

from __future__ import annotations

from dataclasses import dataclass

from ocp.checks import Array
from ocp.system import Label


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Estimated error of one step of a refinement, the time spent so far, and the reason if it is the last step."""

    error: float  # estimated, in `unit`
    tol: float  # asked for
    unit: str
    what: str  # is wrong by `error`
    seconds: float  # since the refinement began [s]
    errors: Errors
    reason: str = ""  # why this is the last step; empty if it is not

    @property
    def met(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return self.error <= self.tol

    def __str__(self) -> str:
        ending = f": {self.reason}" if self.reason else ""
        return f"{self.what} to {self.error:.1e} {self.unit}, asked {self.tol:g}, after {self.seconds:.2f} s{ending}"


@dataclass(frozen=True, eq=False)
class Errors:
    """Estimated errors of a solution; each is zero for an exact solution.

    The cost of the solution differs from the optimum by at most about `cost`, the sum of five parts times a safety
    factor of 2. Each part is the integral of an error of the motion times its costate or multiplier.
    """

    cost: float  # of the optimal cost [unit of the cost]; inf for a solution that did not converge
    duration: float  # of the optimal duration [s]; zero if it is fixed
    states: Array  # (nx,) largest drift of each state [unit of the state]
    dynamics: float  # cost of the error in x' = f(x, u) and of the quadrature; signed
    optimality: float  # gain left by the controls: integral of H(u) - min H, with redistributed multipliers
    overshoot: float  # cost saved by controls beyond their limits between the collocation points
    violation: float  # cost saved by states beyond their limits between the nodes
    convergence: float  # complementarity error of state limits: multipliers times distances
    hamiltonian: float  # standard deviation of H from its constant value, share of the mean size of its terms
    elements: Array  # (N,) parts of the elements in `cost`
    local: Array  # (N, nx) error of each state at the end of an element, integrated from its start
    drift: Array  # (N + 1, nx) integrated from x(0) minus the solution, at the ends of elements; signed
    labels: tuple[Label, ...]  # of the states
    cost_scale: float = 1.0  # with which errors of the cost are compared as shares [unit of the cost]

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
