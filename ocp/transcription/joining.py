"""NLPs of several phases joined to one by the equations of their links."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.problem.sequence import Sequence
from ocp.transcription.nlp import Nlp
from ocp.transcription.scaled_nlp import ScaledNlp, derivative_functions


@dataclass(frozen=True, eq=False)
class JoinedNlp:
    """The NLPs of one or more phases as one NLP."""

    nlps: tuple[Nlp, ...]
    scaled: ScaledNlp
    links: int  # number of rows that tie the phases, after those of the phases; their scales are one


def join(nlps: tuple[Nlp, ...], sequence: Sequence | None, scales: Several[Array]) -> JoinedNlp:
    """Return the NLPs of a sequence as one NLP, with equations for its links and shared parameters.

    Args:
        nlps: of the phases, with the same scale of the cost.
        sequence: that they belong to; None for a single phase, whose NLP stays as it is.
        scales: of the linked expressions, for every junction of the sequence.
    """
    if sequence is None:
        return JoinedNlp(nlps, nlps[0].scaled, 0)
    every = [p.scaled for p in nlps]
    sizes = [[one.expressions[name].numel() for one in every] for name in ("x", "p")]
    z, s = (ca.MX.sym(name, sum(size)) for name, size in zip(("z", "s"), sizes, strict=True))
    zs, ss = (ca.vertsplit(v, np.cumsum([0, *size]).tolist()) for v, size in zip((z, s), sizes, strict=True))
    linked = [
        (_at_junction(nlps[j], after, zs[j], ss[j], 0) - _at_junction(nlps[i], before, zs[i], ss[i], -1)) / ca.DM(scale)
        for (i, j, before, after), scale in zip(sequence.junctions, scales, strict=True)
    ]
    tied = ca.vertcat(*linked, *_shared(nlps, zs))
    first = [p.derivatives["jac_g"](z_, s_) for p, z_, s_ in zip(every, zs, ss, strict=True)]
    slopes = [p.derivatives["grad_f"](z_, s_) for p, z_, s_ in zip(every, zs, ss, strict=True)]
    f, g = sum((slope[0] for slope in slopes), ca.MX(0)), ca.vertcat(*(part[0] for part in first), tied)
    jacobian = ca.vertcat(ca.diagcat(*(part[1] for part in first)), ca.jacobian(tied, z))
    gradient = ca.vertcat(*(slope[1] for slope in slopes))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    parts = ca.vertsplit(lam_g, np.cumsum([0, *(p.rows for p in nlps), tied.numel()]).tolist())
    blocks = [
        p.derivatives["hess_lag"](z_, s_, lam_f, lam) for p, z_, s_, lam in zip(every, zs, ss, parts[:-1], strict=True)
    ]
    hessian = ca.diagcat(*blocks) + ca.triu(ca.hessian(ca.dot(parts[-1], tied), z)[0])
    derivatives = derivative_functions((z, s, lam_f, lam_g), (f, gradient), (g, jacobian), hessian)
    of_rows = np.concatenate([*(one.rows for one in every), np.ones(tied.numel())])
    scaled = ScaledNlp({"x": z, "p": s, "f": f, "g": g}, derivatives, every[0].cost, of_rows)
    return JoinedNlp(nlps, scaled, tied.numel())


def _shared(nlps: tuple[Nlp, ...], zs: list[ca.MX]) -> list[ca.MX]:
    """Return the differences of unknown parameters that several phases have, divided by their scales."""
    first: dict[str, tuple[ca.MX, float]] = {}
    rows = []
    for nlp, z in zip(nlps, zs, strict=True):
        names = list(nlp.problem.system.nominal)
        for k, number in enumerate(nlp.free):
            own = z[int(nlp.layout.free[k])], float(nlp.scaling.free[k])
            other, scale = first.setdefault(names[int(number)], own)
            if other is not own[0]:
                rows.append(own[0] * (own[1] / scale) - other)
    return rows


def _at_junction(nlp: Nlp, expression: ca.SX, z: ca.MX, s: ca.MX, end: int) -> ca.MX:
    """Return an expression at the first (0) or last (-1) node of an NLP, from its scaled unknowns."""
    system, layout, scaling = nlp.problem.system, nlp.layout, nlp.scaling
    function = ca.Function("link", [system.x, system.p], [expression])
    p = [s[i] for i in range(system.p.numel())]
    for k, number in enumerate(nlp.free):
        p[int(number)] = z[int(layout.free[k])] * scaling.free[k]
    x = z[layout.state[end, end].tolist()] * ca.DM(scaling.x)
    return function(x, ca.vertcat(*p) if p else ca.MX(0, 1))
