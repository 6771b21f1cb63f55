"""Runge-Kutta methods from their tableaux: explicit ones, implicit ones, and Radau IIA with its error estimate."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.integrators.contracts import symbols
from ocp.integrators.tableaux import Tableau, radau_iia
from ocp.numerics.newton import root
from ocp.numerics.rate_functions import rates
from ocp.system import System


@dataclass(frozen=True)
class RungeKutta:
    """The Runge-Kutta method of a tableau; the equations of an implicit one are solved by Newton's iteration.

    Args:
        tableau: such as `ocp.integrators.tableaux.KUTTA` or `ocp.integrators.tableaux.gauss(2)`.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1, and II, IV.8 (increments as
        unknowns).
    """

    tableau: Tableau

    @property
    def order(self) -> int:
        """Order of convergence."""
        return self.tableau.order

    @property
    def nodes(self) -> Array:
        """(s,) points of the stages in the step."""
        return self.tableau.c

    @property
    def error_order(self) -> int:
        """Order in h of the error estimate; 0 without one."""
        return self.tableau.error_order

    def step(self, system: System) -> ca.Function:
        """Return the function of one step; see `ocp.integrators.contracts.Rule`."""
        if self.tableau.explicit:
            return _explicit_step(system, self.tableau)
        stages = _implicit_step(system, self.tableau)
        given = stages.mx_in()
        new, _, change, evaluations = stages.call(given)
        return ca.Function("step", given, [new, ca.MX(system.x.numel(), 0), change, evaluations])

    def error(self, norms: Array) -> float:
        """Return the error of a step from the norms of its estimates."""
        if len(norms) == 1:
            return float(norms[0])
        size = np.hypot(norms[0], 0.1 * norms[1])
        return float(norms[0] ** 2 / size) if size > 0.0 else float(size)


@dataclass(frozen=True)
class RadauWithEstimate:
    """Radau IIA of order 5 (3 stages, L-stable) with its error estimate of order 3, for stiff systems.

    e = (I - h g J)^-1 (h g f(x) + e_1 Z_1 + e_2 Z_2 + e_3 Z_3), 1/g the real eigenvalue of A^-1; if it is too large
    the filter is applied again, with f(x + e), which removes what a stiff component adds on a rough start.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.8 (RADAU5; here with a full Newton
        iteration, and the second filter whenever the first estimate is too large).
    """

    order: int = 5
    error_order: int = 4

    @property
    def nodes(self) -> Array:
        """(4,) the start of the step and its stages."""
        return np.concatenate([[0.0], radau_iia(3).c])

    def step(self, system: System) -> ca.Function:
        """Return the function of one step; see `ocp.integrators.contracts.Rule`."""
        tableau = radau_iia(3)
        x, h, u, p = symbols(system, 4)
        f = rates(system)
        stages = _implicit_step(system, tableau)
        roots = np.linalg.eigvals(np.linalg.inv(tableau.a))
        gamma = 1.0 / float(np.real(roots[np.argmin(np.abs(np.imag(roots)))]))
        slope = ca.Function("slope", [x, u, p], [f(x, u[:, 0], p), ca.jacobian(f(x, u[:, 0], p), x)], {"cse": True})
        # sqrt(6) is that of the stages (4 -+ sqrt 6) / 10.
        weights = gamma / 3.0 * np.array([-13.0 - 7.0 * np.sqrt(6.0), -13.0 + 7.0 * np.sqrt(6.0), -1.0])
        given = [ca.MX.sym(name, *part.shape) for name, part in zip("xhup", (x, h, u, p), strict=True)]
        xm, hm, um, pm = given
        new, increments, change, evaluations = stages(xm, hm, um[:, 1:], pm)
        start, jacobian = slope(xm, um, pm)
        combined = increments @ ca.DM(weights)
        matrix = ca.MX.eye(x.numel()) - hm * gamma * jacobian
        first = ca.solve(matrix, hm * gamma * start + combined, "qr")
        again = f(xm + first, um[:, 0], pm)
        second = ca.solve(matrix, hm * gamma * again + combined, "qr")
        return ca.Function("step", given, [new, ca.horzcat(first, second), change, evaluations + 2])

    def error(self, norms: Array) -> float:
        """Return the first estimate, or the second one where the first is too large."""
        return float(norms[0] if norms[0] <= 1.0 else norms[1])


def _explicit_step(system: System, tableau: Tableau) -> ca.Function:
    x, h, u, p = symbols(system, len(tableau.b))
    f = rates(system)
    slopes: list[ca.SX] = []
    for i in range(len(tableau.b)):
        moved = sum((h * a * k for a, k in zip(tableau.a[i], slopes, strict=False) if a != 0.0), x)
        slopes.append(f(moved, u[:, i], p))
    new = sum((h * b * k for b, k in zip(tableau.b, slopes, strict=True) if b != 0.0), x)
    errors = [
        sum((h * e * k for e, k in zip(row, slopes, strict=True) if e != 0.0), ca.SX(0)) for row in tableau.errors
    ]
    result = ca.horzcat(*errors) if errors else ca.SX(x.numel(), 0)
    return ca.Function("step", [x, h, u, p], [new, result, 0, len(slopes)], {"cse": True})


def _implicit_step(system: System, tableau: Tableau) -> ca.Function:
    """Return the step of an implicit method, (x, h, u, p) -> (x_next, Z, change, evaluations), Z_i = X_i - x (nx, s).

    x_next is formed from the increments, with b' A^-1, so that a stiff f does not magnify their rounding.
    """
    s = len(tableau.b)
    x, h, u, p = symbols(system, s)
    nx = x.numel()
    f = rates(system)
    z = ca.SX.sym("z", nx * s)
    increments = ca.reshape(z, nx, s)
    slopes = ca.horzcat(*(f(x + increments[:, i], u[:, i], p) for i in range(s)))
    solve = root(z, ca.vec(increments - h * slopes @ ca.DM(tableau.a).T), [x, h, u, p])
    given = [ca.MX.sym("x", nx), ca.MX.sym("h"), ca.MX.sym("u", *u.shape), ca.MX.sym("p", *p.shape)]
    # The first guess is on the tangent at the start, with the control of the first stage.
    slope = f(given[0], given[2][:, 0], given[3])
    guess = ca.horzcat(*(given[1] * c * slope for c in tableau.c))
    result, change, iterations = solve(ca.vec(guess), *given)
    result = ca.reshape(result, nx, s)
    new = given[0] + result @ ca.DM(np.linalg.solve(tableau.a.T, tableau.b))
    return ca.Function("step", given, [new, result, change, s * iterations + 1])
