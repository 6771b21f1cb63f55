"""Warm start: multipliers of a solution converted to another grid or scheme."""

from __future__ import annotations

import numpy as np

from ocp.checks import Array
from ocp.solution.solution import Solution
from ocp.transcription.nlp import Nlp


def multipliers(nlp: Nlp, solution: Solution) -> tuple[Array, Array]:
    """Return multipliers of the bounds (nz,) and of the rows (ng,) of an NLP, from a solution of its problem.

    Costates are interpolated to the collocation points. Multipliers of bounds and of constrained expressions are
    integrals over an element; they are distributed over the new elements in proportion to the overlap in time. Those
    of constrained expressions start at zero if the schemes have different numbers of points.

    Args:
        nlp: to be solved.
        solution: of the same problem, on any grid, with any scheme.
    """
    layout, scaling, scheme, grid = nlp.layout, nlp.scaling, nlp.scheme, nlp.grid
    limits, rows = np.zeros(layout.size), np.zeros(nlp.rows)
    inside = np.append(np.clip(scheme.points, 1e-9, 1.0 - 1e-9), 1.0 - 1e-9)
    shares = grid.ends[:-1, None] + grid.widths[:, None] * inside
    costates = solution.costate((shares * solution.duration).ravel()).reshape(*shares.shape, -1)
    # At the points rate^T y = -weight lambda, with the multipliers y of the defects; the costate at the end belongs to
    # rows without rates, which define the state there.
    loads = -scheme.weights[:, None] * costates[:, :-1] * scaling.x
    y = np.einsum("ij,kja->kia", np.linalg.pinv(scheme.rate.T), loads)
    without_rates = ~scheme.rate.any(axis=1)
    y[:, without_rates] = -costates[:, -1:] * scaling.x
    rows[nlp.defects] = y
    held = solution.multipliers
    if held is None:
        return limits, rows
    common = np.minimum(grid.ends[1:, None], solution.grid.ends[1:]) - np.maximum(
        grid.ends[:-1, None], solution.grid.ends[:-1]
    )
    shared = np.maximum(common, 0.0) / solution.grid.widths
    for indices, scale, own, old in (
        (layout.control, scaling.u, nlp.scheme.control_nodes, held.u),
        (layout.state[:, 1:], scaling.x, nlp.scheme.nodes[1:], held.x[:, 1:]),
    ):
        load = np.einsum("kl,la->ka", shared, old.sum(axis=1)) * scale
        np.add.at(limits, indices, np.repeat(load[:, None] / len(own), len(own), axis=1))
    limits[layout.state[0, 0]] = held.x[0, 0] * scaling.x
    limits[layout.state[-1, -1]] = held.x[-1, -1] * scaling.x
    if held.ends.shape == nlp.ends.shape:
        rows[nlp.ends] = held.ends
    if held.path.shape[1] == sum(r.shape[1] for r in nlp.path):
        same, column = len(grid) == len(solution.grid), 0
        for indices in nlp.path:
            own = held.path[:, column : column + indices.shape[1]]
            spread = np.repeat((shared @ own.sum(axis=1))[:, None] / indices.shape[1], indices.shape[1], axis=1)
            rows[indices] = own if same else spread
            column += indices.shape[1]
    return limits, rows
