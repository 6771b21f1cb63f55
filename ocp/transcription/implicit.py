"""Derivatives of functions v(z, y(z)) whose inner unknowns y solve G(z, y) = 0, by the implicit function theorem.

Only v and G are differentiated, never the solution of G: dy/dz = -R dG/dz with R = (dG/dy)^-1, symmetric. With the
multipliers mu of v, nu = R (dv/dy)' mu and the Hessian H of mu . v - nu . G by (z, y), the second derivative of
mu . v is N' H N with N = [I; dy/dz]. Where a part of v is the gradient by z of the function whose gradient by y is G,
its derivative by y is (dG/dz)', which is there already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Inner:
    """Unknowns y of a local function, with symmetric dG/dy.

    Args:
        y: (ny,) symbols.
        values: (nv,) expressions v in the arguments z and y.
        residual: (ny,) G.
        explicit: (ny,) y in terms of z.
        solve: right side (ny, 1) in terms of z -> (dG/dy)^-1 right.
        mirror: (nv, nz) matrix W in terms of z, where dv/dy = d(rest)/dy + W (dG/dz)'; None: no such part.
        rest: (nv,) the values without that part.
    """

    y: ca.SX
    values: ca.SX
    residual: ca.SX
    explicit: ca.SX
    solve: Callable[[ca.SX], ca.SX]
    mirror: ca.SX | None = None
    rest: ca.SX | None = None

    def derivatives(self, arguments: ca.SX, multipliers: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return v, dv/dz and the Hessian of multipliers . v by z.

        Args:
            arguments: (nz,) symbols z.
            multipliers: (nv,) symbols of the multipliers.
        """
        z, y, v, g = arguments, self.y, self.values, self.residual
        ny, nu = y.numel(), ca.SX.sym("nu", y.numel())

        def put(expression: ca.SX) -> ca.SX:
            return ca.sparsify(ca.substitute(expression, y, self.explicit))

        # Forward mode on small blocks: the columns of dG/dz are dense for few z only, which colouring does not see.
        g_z, v_z = (put(ca.jacobian(part, z, {"allow_reverse": False})) for part in (g, v))
        v_y = put(ca.jacobian(v if self.rest is None else self.rest, y))
        inverse = self._inverse()
        y_z = -(inverse @ g_z)
        jacobian = v_z + v_y @ y_z
        if self.mirror is not None:
            jacobian += self.mirror @ _symmetric_product(g_z, y_z)
            v_y = ca.sparsify(v_y + self.mirror @ g_z.T)

        hessian = ca.hessian(ca.dot(multipliers, v) - ca.dot(nu, g), ca.vertcat(y, z))[0]  # y first is shorter
        inner = self.solve(ca.densify(v_y.T @ multipliers))
        hessian = ca.sparsify(ca.substitute(hessian, ca.vertcat(y, nu), ca.vertcat(self.explicit, inner)))
        # N' H N with dy/dz = -R G: H_zz - (H_zy R) G - G' (H_zy R)' + G' (R H_yy R) G, without forming dy/dz.
        mixed, curved = hessian[ny:, :ny] @ inverse, _mirrored(inverse @ hessian[:ny, :ny] @ inverse)
        curvature = hessian[ny:, ny:] - (mixed - g_z.T @ curved) @ g_z - (mixed @ g_z).T
        return put(v), jacobian, _mirrored(curvature)

    def _inverse(self) -> ca.SX:
        """Return (dG/dy)^-1 from one triangle, the one with fewer instructions."""
        n = self.y.numel()
        columns = ca.horzcat(*(self.solve(ca.densify(ca.SX.eye(n)[:, k])) for k in range(n)))
        return min((_mirrored(columns), _mirrored(columns.T)), key=_instructions)


def _instructions(matrix: ca.SX) -> int:
    return int(ca.Function("m", [ca.vertcat(*ca.symvar(matrix))], [ca.cse(matrix)]).n_instructions())


def _mirrored(matrix: ca.SX) -> ca.SX:
    """Return a symmetric matrix from its upper triangle, so that the lower one costs nothing."""
    return ca.triu2symm(ca.triu(ca.sparsify(matrix)))


def _symmetric_product(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return a' b, known to be symmetric; entries that a column of a with one entry selects from b cost nothing."""
    product = ca.sparsify(a.T @ b)
    n = product.shape[0]
    counts = [a[:, k].nnz() for k in range(n)]
    result = ca.SX(n, n)
    for i in range(n):
        for j in range(i, n):
            first = counts[i] <= counts[j]
            entry = product[i, j] if first else product[j, i]
            if product.has_nz(*((i, j) if first else (j, i))):
                result[i, j] = result[j, i] = entry
    return result


def inner_of(
    problem: Problem,
    path: Sequence[ca.SX],
    arguments: ca.SX,
    physical: tuple[ca.SX, ca.SX, ca.SX],
    step: ca.SX,
    scale: Array,
) -> Inner | None:
    """Return rate, running cost and path constraints of an element in terms of the inner unknowns of its system.

    Args:
        problem: with the system; None is returned if its rate has no inner unknowns.
        path: scalar path constraints.
        arguments: (nz,) symbols z, the scaled state first.
        physical: state, control and parameters in terms of the arguments.
        step: duration of the element.
        scale: (nx,) of the states.
    """
    system, implicit = problem.system, problem.system.implicit
    if implicit is None:
        return None
    y, limited = ca.SX.sym("y", implicit.y.numel()), ca.vertcat(*(system.short(one) for one in path))
    weights, rest = implicit.mirror or (None, implicit.rate)
    outputs = [implicit.rate, rest, implicit.residual, problem.minimise.running, limited]
    function = ca.Function("inner", [system.x, system.u, system.p, implicit.y], outputs)
    rate, rest, residual, running, limits = function(*physical, y)
    explicit = ca.Function("explicit", [system.x, system.u, system.p], [implicit.value])(*physical)
    values, plain = (ca.vertcat(step * part / scale, step * running, limits) for part in (rate, rest))
    mirror = None
    if weights is not None:
        nx, factors = system.x.numel(), ca.DM(np.outer(1.0 / scale, 1.0 / scale).tolist())
        if isinstance(weights, ca.SX):
            weights = ca.Function("weights", [system.p], [weights])(physical[2])
        mirror = ca.SX(values.numel(), arguments.numel())
        mirror[:nx, :nx] = step * (weights * factors)
    return Inner(y, values, residual, explicit, lambda right: implicit.solve(*physical, right), mirror, plain)
