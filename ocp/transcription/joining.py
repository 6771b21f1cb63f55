"""NLPs of several phases joined to one by the equations of their links."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.sequence import Sequence
from ocp.transcription.nlp import Programme


@dataclass(frozen=True, eq=False)
class Compound:
    """The programmes of one or more phases as one programme."""

    programmes: tuple[Programme, ...]
    nlp: dict[str, ca.MX]
    derivatives: dict[str, ca.Function]
    links: int  # number of rows that tie the phases, after those of the phases

    @property
    def sizes(self) -> tuple[float, Array]:
        """What the solver divides cost and rows by; the rows that tie the phases are divided already."""
        return self.programmes[0].scaling.cost, np.concatenate(
            [*(p.sizes for p in self.programmes), np.ones(self.links)]
        )


def join(programmes: tuple[Programme, ...], sequence: Sequence | None, sizes: Several[Array]) -> Compound:
    """Return the programmes of a sequence tied by its links; one alone stays as it is.

    Args:
        programmes: of the phases, with the same size of the cost.
        sequence: that they belong to; None for one alone.
        sizes: magnitudes of what the links make continuous, of every junction.
    """
    if sequence is None:
        only = programmes[0]
        return Compound(programmes, dict(only.nlp), dict(only.derivatives), 0)
    z = ca.MX.sym("z", sum(p.layout.size for p in programmes))
    s = ca.MX.sym("s", sum(p.nlp["p"].numel() for p in programmes))
    zs = ca.vertsplit(z, np.cumsum([0, *(p.layout.size for p in programmes)]).tolist())
    ss = ca.vertsplit(s, np.cumsum([0, *(p.nlp["p"].numel() for p in programmes)]).tolist())
    tied = ca.vertcat(
        *(
            (
                _at_junction(after, sequence.sides[k][1], zs[k + 1], ss[k + 1], 0)
                - _at_junction(before, sequence.sides[k][0], zs[k], ss[k], -1)
            )
            / ca.DM(sizes[k])
            for k, (before, after) in enumerate(pairwise(programmes))
        )
    )
    first = [p.derivatives["jac_g"](z_, s_) for p, z_, s_ in zip(programmes, zs, ss, strict=True)]
    slopes = [p.derivatives["grad_f"](z_, s_) for p, z_, s_ in zip(programmes, zs, ss, strict=True)]
    f, g = sum((slope[0] for slope in slopes), ca.MX(0)), ca.vertcat(*(part[0] for part in first), tied)
    jacobian = ca.vertcat(ca.diagcat(*(part[1] for part in first)), ca.jacobian(tied, z))
    gradient = ca.vertcat(*(slope[1] for slope in slopes))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    parts = ca.vertsplit(lam_g, np.cumsum([0, *(p.rows for p in programmes), tied.numel()]).tolist())
    blocks = [
        p.derivatives["hess_lag"](z_, s_, lam_f, lam)
        for p, z_, s_, lam in zip(programmes, zs, ss, parts[:-1], strict=True)
    ]
    hessian = ca.diagcat(*blocks) + ca.triu(ca.hessian(ca.dot(parts[-1], tied), z)[0])
    derivatives = {
        "jac_g": ca.Function("nlp_jac_g", [z, s], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "grad_f": ca.Function("nlp_grad_f", [z, s], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [z, s, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
    return Compound(programmes, {"x": z, "p": s, "f": f, "g": g}, derivatives, tied.numel())


def _at_junction(programme: Programme, expression: ca.SX, z: ca.MX, s: ca.MX, end: int) -> ca.MX:
    """Return an expression at the first (0) or last (-1) node of a programme, from its scaled unknowns."""
    system, layout, scaling = programme.problem.system, programme.layout, programme.scaling
    function = ca.Function("link", [system.x, system.p], [expression])
    p = [s[i] for i in range(system.p.numel())]
    for place, number in enumerate(programme.free):
        p[int(number)] = z[int(layout.free[place])] * scaling.free[place]
    x = z[layout.state[end, end].tolist()] * ca.DM(scaling.x)
    return function(x, ca.vertcat(*p) if p else ca.MX(0, 1))
