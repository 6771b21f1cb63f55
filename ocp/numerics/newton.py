"""Newton's iteration as one CasADi function, so that implicit steps run in compiled code."""

from __future__ import annotations

import casadi as ca

ENOUGH = 1e-10  # relative correction after which the next one would be rounding (convergence is quadratic)
ACCEPTED = 1e-8  # relative correction that still counts as converged when the iterations are used up
MOST_ITERATIONS = 15


def root(unknowns: ca.SX, residual: ca.SX, data: list[ca.SX]) -> ca.Function:
    """Return the function (z, *data) -> (z, change, iterations) that solves residual(z, *data) = 0.

    z <- z - (dr/dz)^-1 r until |correction| <= 1e-10 (|z| + |data_0|) in the maximum norm, at most 15 times.

    Args:
        unknowns: (n,) symbols z.
        residual: (n,) r in z and data.
        data: symbols; the size of the first one enters the convergence test.
    """
    shapes = [part.shape for part in data]
    linearised = ca.Function(
        "linearised", [unknowns, *data], [residual, ca.jacobian(residual, unknowns)], {"cse": True}
    )
    z, change, count = ca.MX.sym("z", unknowns.numel()), ca.MX.sym("change"), ca.MX.sym("count")
    given = [ca.MX.sym(f"d{i}", *shape) for i, shape in enumerate(shapes)]
    value, slope = linearised(z, *given)
    correction = ca.solve(slope, value, "qr")
    size = ca.norm_inf(given[0]) + ca.norm_inf(z) + 1e-300
    improved = [z - correction, ca.norm_inf(correction) / size, count + 1]
    signature = [z, change, count, *given]
    # CasADi has no loop that ends early: nested branches, of which only the one taken is evaluated.
    done = ca.Function("done", signature, signature[:3])
    loop = done
    for _ in range(MOST_ITERATIONS):
        branch = ca.Function.if_else("branch", loop, done)
        loop = ca.Function("loop", signature, list(branch.call([improved[1] > ENOUGH, *improved, *given])))
    return ca.Function("root", [z, *given], list(loop.call([z, ca.MX(1), ca.MX(0), *given])))
