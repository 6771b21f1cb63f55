"""The NLP as a solver sees it: unknowns, cost and rows divided by their scales, and the way back to physical units."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array

Bounds = tuple[Array, Array, Array, Array]  # of the unknowns (nz,), (nz,), of the rows (ng,), (ng,): lower and upper


@dataclass(frozen=True, eq=False)
class ScaledNlp:
    """min f(z, s) / cost subject to bounds on z and on g(z, s) / rows, for scaled unknowns z.

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

    @functools.cached_property
    def physical(self) -> tuple[Mapping[str, ca.MX], Mapping[str, ca.Function]]:
        """Expressions and derivatives of f(z, s) and g(z, s), cost and rows in physical units; made when asked for."""
        if self.cost == 1.0 and np.all(self.rows == 1.0):
            return self.expressions, self.derivatives
        z, s, by = self.expressions["x"], self.expressions["p"], ca.DM(self.rows.tolist())
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(self.rows))
        f, gradient = self.derivatives["grad_f"](z, s)
        g, jacobian = self.derivatives["jac_g"](z, s)
        pattern = jacobian.sparsity()
        entries = ca.vec(jacobian.nz[:]) * ca.DM(self.rows[np.array(pattern.row(), dtype=int)].tolist())
        hessian = self.derivatives["hess_lag"](z, s, self.cost * lam_f, by * lam_g)
        cost, rows = (self.cost * f, self.cost * gradient), (by * g, ca.sparsity_cast(entries, pattern))
        expressions = {"f": self.cost * self.expressions["f"], "g": by * self.expressions["g"]}
        return {**self.expressions, **expressions}, derivative_functions((z, s, lam_f, lam_g), cost, rows, hessian)

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


def derivative_functions(
    symbols: tuple[ca.MX, ca.MX, ca.MX, ca.MX], cost: tuple[ca.MX, ca.MX], rows: tuple[ca.MX, ca.MX], curvature: ca.MX
) -> dict[str, ca.Function]:
    """Return the functions "grad_f", "jac_g" and "hess_lag" of an NLP, with the signatures of `nlpsol`.

    Args:
        symbols: unknowns z, parameters s, multipliers of the cost and of the rows.
        cost: f and its gradient by z.
        rows: g and its Jacobian by z.
        curvature: upper triangle of the Hessian of lam_f f + lam_g . g by z.
    """
    given, inputs = list(symbols[:2]), ["x", "p"]
    return {
        "grad_f": ca.Function("nlp_grad_f", given, list(cost), inputs, ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", given, list(rows), inputs, ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", list(symbols), [curvature], [*inputs, "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
