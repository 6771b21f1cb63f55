"""The NLP as a solver sees it: cost and rows divided by their scales, and the way back to physical units.

The unknowns are scaled already: the transcription states them divided by `Scaling.x`, `Scaling.u` and so on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array

Bounds = tuple[Array, Array, Array, Array]  # of the unknowns (nz,), (nz,), of the rows (ng,), (ng,): lower and upper


@dataclass(frozen=True, eq=False)
class ScaledNlp:
    """min f(z, s) / cost subject to bounds on z and on g(z, s) / rows.

    Args:
        expressions: "x" the unknowns z (nz,), "p" the parameters s, "f" the scaled cost, "g" the scaled rows (ng,).
        derivatives: functions "grad_f", "jac_g" and "hess_lag" of the scaled NLP, with the signatures of `nlpsol`.
        cost: scale of the cost.
        rows: (ng,) scales of the rows.
    """

    expressions: Mapping[str, ca.MX]
    derivatives: Mapping[str, ca.Function]
    cost: float
    rows: Array

    @property
    def unknowns(self) -> int:
        """Number of unknowns, nz."""
        return int(self.expressions["x"].numel())

    def scaled_bounds(self, bounds: Bounds) -> Bounds:
        """Return bounds with those of the rows divided by their scales."""
        return bounds[0], bounds[1], bounds[2] / self.rows, bounds[3] / self.rows

    def scaled_multipliers(self, multipliers: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return the multipliers of bounds (nz,) and rows (ng,) that the solver knows, from physical ones."""
        return multipliers[0] / self.cost, multipliers[1] * self.rows / self.cost

    def physical_multipliers(self, multipliers: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return physical multipliers of bounds (nz,) and rows (ng,) from those that the solver found."""
        return self.cost * multipliers[0], self.cost * multipliers[1] / self.rows


def scale_nlp(
    expressions: Mapping[str, ca.MX], derivatives: Mapping[str, ca.Function], cost: float, rows: Array
) -> ScaledNlp:
    """Return an NLP and its derivatives with the cost and the rows divided by their scales.

    Args:
        expressions: "x", "p", "f", "g" of the unscaled cost and rows.
        derivatives: "grad_f", "jac_g", "hess_lag".
        cost: scale of the cost.
        rows: (ng,) scales of the rows.
    """
    if cost == 1.0 and np.all(rows == 1.0):
        return ScaledNlp(expressions, derivatives, cost, rows)
    z, s, by = expressions["x"], expressions["p"], ca.DM(1.0 / rows)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(rows))
    f, gradient = derivatives["grad_f"](z, s)
    g, jacobian = derivatives["jac_g"](z, s)
    row_of_entry = np.array(jacobian.sparsity().row(), dtype=int)
    entries = ca.vec(jacobian.nz[:]) * ca.DM(1.0 / rows[row_of_entry])
    jacobian = ca.sparsity_cast(entries, jacobian.sparsity())
    hessian = derivatives["hess_lag"](z, s, lam_f / cost, lam_g * by)
    divided = {
        "grad_f": ca.Function("nlp_grad_f", [z, s], [f / cost, gradient / cost], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [z, s], [g * by, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [z, s, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
    return ScaledNlp({**expressions, "f": expressions["f"] / cost, "g": expressions["g"] * by}, divided, cost, rows)
