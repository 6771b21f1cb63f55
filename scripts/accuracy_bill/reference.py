"""The reference of an accuracy bill: an optimum far more accurate than what is judged by it, with its own error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from accuracy_bill.scene import Scene
from ocp import Control, Ipopt, legendre, polish, radau, solve, uniform
from ocp.arcs.polishing import SETTINGS

DIGITS = 1e-12  # relative error of the known optima: shooting with the same structure differs by 7.5e-13
POLISHED_FROM = (100, 200)  # elements of the grids that are polished, until one succeeds
FINEST = (200, 400)  # elements of the two grids of the extrapolation


@dataclass(frozen=True)
class Reference:
    """An optimal cost, how far it may be off, and where it is from."""

    cost: float
    error: float  # in the unit of the cost
    source: str

    def __str__(self) -> str:
        return f"{self.cost:.15g}, itself accurate to {self.error:.1e} ({self.source})"


def reference(scene: Scene) -> Reference:
    """Return the reference of a scene: its known optimum, or the best that can be computed.

    Raises:
        RuntimeError: a solve that it needs fails.
    """
    if np.isfinite(scene.known):
        return Reference(scene.known, DIGITS * max(abs(scene.known), 1.0), "known optimum")
    return polished(scene) or extrapolated(scene, FINEST)


def polished(scene: Scene) -> Reference | None:
    """Return the cost of a polished solution; None if it cannot be polished.

    Two polishes with other schemes on the arcs and tolerances a hundred times apart give the error.
    """
    form = next(iter(scene.problems))
    for n in POLISHED_FROM:
        first = solve(scene.problems[form](), radau(3), uniform(n), Ipopt(progress=False))
        costs = []
        for scheme, tol in ((legendre(6, Control.COLLOCATED), 1e-10), (radau(7, Control.COLLOCATED), 1e-12)):
            result = polish(first, scheme=scheme, solver=replace(SETTINGS, tol=tol))
            if result.structure is None:
                break
            costs.append(result.cost)
        if len(costs) == 2:
            error = max(abs(costs[1] - costs[0]), DIGITS * abs(costs[1]))
            return Reference(costs[1], error, "switching times as unknowns, with two schemes and tolerances")
    return None


def extrapolated(scene: Scene, grids: tuple[int, int]) -> Reference:
    """Return the cost on the finer grid less what the step from the coarser one implies for the rest.

    With one control value for each element the cost converges as h^2 from above, irregularly where switches move
    within elements: a third of the last step is left. The stated error is the whole step.

    Source: L. F. Richardson, The approximate arithmetical solution by finite differences, 1911.
    """
    form = next(iter(scene.problems))
    results = [solve(scene.problems[form](), radau(3), uniform(n), Ipopt(progress=False)) for n in grids]
    for solution in results:
        if not solution.ok:
            raise RuntimeError(f"reference: {solution.message}")
    coarse, fine = (solution.cost for solution in results)
    step = (fine - coarse) / ((grids[1] / grids[0]) ** 2 - 1.0)
    source = f"extrapolated from {grids[0]} and {grids[1]} elements of radau(3)"
    return Reference(fine + step, max(abs(fine - coarse), DIGITS * abs(fine)), source)
