"""Derivatives of functions v(z, y(z)) whose inner unknowns y solve G(z, y) = 0, by the implicit function theorem.

Only v and G are differentiated, never the solution of G: dy/dz = -M^-1 dG/dz with M = dG/dy. With the multipliers mu of
v and nu = M^-1 (dv/dy)' mu, the second derivative of mu . v is N' H N with N = [I; dy/dz] and the Hessian H of
mu . v - nu . G by (z, y).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from ocp.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Inner:
    """Unknowns y of a local function, with symmetric M = dG/dy.

    Args:
        y: (ny,) symbols.
        values: (nv,) expressions v in the arguments z and y.
        residual: (ny,) G.
        explicit: (ny,) y in terms of z.
        solve: right side (ny, 1) in terms of z -> M^-1 right.
    """

    y: ca.SX
    values: ca.SX
    residual: ca.SX
    explicit: ca.SX
    solve: Callable[[ca.SX], ca.SX]

    def derivatives(self, arguments: ca.SX, multipliers: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return dv/dz and the Hessian of multipliers . v by z.

        Args:
            arguments: (nz,) symbols z.
            multipliers: (nv,) symbols of the multipliers.
        """
        z, y, v, g = arguments, self.y, self.values, self.residual
        nu = ca.SX.sym("nu", y.numel())

        def put(expression: ca.SX) -> ca.SX:
            return ca.sparsify(ca.substitute(expression, y, self.explicit))

        g_z, v_z, v_y = (put(ca.jacobian(*pair)) for pair in ((g, z), (v, z), (v, y)))
        y_z = -ca.horzcat(*(self._solved(g_z[:, k]) for k in range(z.numel())))
        hessian = ca.hessian(ca.dot(multipliers, v) - ca.dot(nu, g), ca.vertcat(z, y))[0]
        result = self.solve(ca.densify(v_y.T @ multipliers))
        hessian = ca.sparsify(ca.substitute(hessian, ca.vertcat(y, nu), ca.vertcat(self.explicit, result)))
        frame = ca.sparsify(ca.vertcat(ca.SX.eye(z.numel()), y_z))
        return v_z + v_y @ y_z, frame.T @ hessian @ frame

    def _solved(self, right: ca.SX) -> ca.SX:
        return ca.sparsify(self.solve(ca.densify(right))) if right.nnz() else ca.SX(self.y.numel(), 1)


def inner_of(
    problem: Problem, path: Sequence[ca.SX], physical: tuple[ca.SX, ca.SX, ca.SX], steps: tuple[ca.SX, ca.SX]
) -> Inner | None:
    """Return rate, running cost and path constraints of an element in terms of the inner unknowns of its system.

    Args:
        problem: with the system; None is returned if its rate has no inner unknowns.
        path: scalar path constraints.
        physical: state, control and parameters in terms of the arguments of the element.
        steps: duration of the element, and (nx,) this over the scales of the states.
    """
    system, implicit = problem.system, problem.system.implicit
    if implicit is None:
        return None
    y, limited = ca.SX.sym("y", implicit.y.numel()), ca.vertcat(*(system.short(one) for one in path))
    outputs = [implicit.rate, implicit.residual, problem.minimise.running, limited]
    function = ca.Function("inner", [system.x, system.u, system.p, implicit.y], outputs)
    rate, residual, running, limits = function(*physical, y)
    explicit = ca.Function("explicit", [system.x, system.u, system.p], [implicit.value])(*physical)
    values = ca.vertcat(steps[1] * rate, steps[0] * running, limits)
    return Inner(y, values, residual, explicit, lambda right: implicit.solve(*physical, right))
