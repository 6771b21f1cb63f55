"""What a solved programme does not say by itself: whether its grid resolves the motion."""

from __future__ import annotations

import numpy as np

from ocp.accuracy.error_estimate import drift
from ocp.solution.solution import Solution

RESOLVED = 1e-6  # share of the largest value of each state, as `verify` allows
LEAST = 1e-3  # of the largest state of the same unit: smaller states are held against that


def unresolved(solution: Solution) -> list[str]:
    """Return a sentence if the motion, integrated with its own controls, would leave the one found; else nothing.

    The programme holds x' = f(x, u) at the collocation points only. On a grid that is too coarse, or where the motion
    is unstable, a solution that meets every tolerance is then no motion of the system; see `ocp.error.drift`.

    Args:
        solution: that met its tolerance.
    """
    problem = solution.problem
    if problem is None or solution.duration <= 0.0 or not np.all(np.isfinite(solution.data)):
        return []
    with np.errstate(all="ignore"):
        try:
            away = np.abs(drift(solution, problem))
        except np.linalg.LinAlgError:
            away = np.full((len(solution.grid) + 1, solution.states.shape[2]), np.inf)
        span = np.max(np.abs(solution.states), axis=(0, 1))
        labels = problem.system.label("x", len(span))
        alike = [LEAST * max(s for s, other in zip(span, labels, strict=True) if other.unit == one.unit)
                 for one in labels]  # fmt: skip
        size = np.maximum(span, alike)
        share = away / np.where(size > 0.0, size, 1.0)
    share[~np.isfinite(share)] = np.inf
    k, i = np.unravel_index(np.argmax(share), share.shape)
    if not share[k, i] > RESOLVED:
        return []
    return [
        f"the grid does not resolve the motion: integrated with these controls, {labels[i].name} leaves it by about "
        f"{share[k, i]:.1e} of its size at t = {solution.nodes[k]:.4g} s; a finer grid or solve_to_accuracy cures it, "
        "and a motion that is unstable without feedback needs one most"
    ]
