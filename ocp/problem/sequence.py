"""Problems one after the other, linked at their junctions: phases with different systems, costs and limits."""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import dataclass, field
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp import checks
from ocp.problem.problem import Problem
from ocp.solution.solution import OUTSIDE, Solution, Status, Timings
from ocp.transcription.nlp import Programme

Array = np.ndarray
Link = str | tuple[ca.SX, ca.SX]


@dataclass(frozen=True, eq=False)
class Sequence:
    """Problems one after the other; the cost is the sum of theirs.

    Args:
        problems: in order of time, each with a free or fixed duration of its own.
        links: what is continuous at every junction: names of signals that the systems on both sides have, or pairs
            (expression of the earlier system, expression of the later one), for all junctions alike.

    Raises:
        TypeError: a part of the wrong kind.
        ValueError: fewer than two problems, or the two sides of a link differ in size.
        KeyError: a system lacks a linked signal.
    """

    problems: tuple[Problem, ...]
    links: tuple[Link, ...] = ("q", "v")
    sides: tuple[tuple[ca.SX, ca.SX], ...] = field(init=False)  # of each junction: before, after

    def __init__(self, problems: Several[Problem], links: Several[Link] = ("q", "v")) -> None:
        checks.instance("Sequence: problems", problems, tuple | list, "Problems in order of time")
        checks.instance("Sequence: links", links, tuple | list | str, "names of signals, or pairs of expressions")
        object.__setattr__(self, "problems", tuple(problems))
        object.__setattr__(self, "links", (links,) if isinstance(links, str) else tuple(links))
        for link in self.links:
            _check_link(link)
        for problem in self.problems:
            if not isinstance(problem, Problem):
                raise TypeError(f"Sequence: problems has {checks.shown(problem)}, expected Problems")
        if len(self.problems) < 2:
            raise ValueError(f"Sequence: got {len(self.problems)} problem, expected at least two")
        junctions = tuple(self._junction(one, other) for one, other in pairwise(self.problems))
        object.__setattr__(self, "sides", junctions)

    def __reduce__(self) -> tuple[object, ...]:
        if not all(isinstance(link, str) for link in self.links):
            raise TypeError("Sequence: one with links of expressions cannot go to another process; link named signals")
        return Sequence, (self.problems, self.links)

    def _junction(self, one: Problem, other: Problem) -> tuple[ca.SX, ca.SX]:
        pairs = [(one.system[link], other.system[link]) if isinstance(link, str) else link for link in self.links]
        for link, (before, after) in zip(self.links, pairs, strict=True):
            if before.numel() != after.numel():
                raise ValueError(f"Sequence: link {link} has {before.numel()} components before, {after.numel()} after")
            for problem, side in ((one, before), (other, after)):
                problem.system.check_symbols("Sequence: link", side)
                if ca.depends_on(side, problem.system.u):
                    raise ValueError("Sequence: a link depends on the control, which may jump; link states only")
        return ca.vertcat(*(ca.vec(before) for before, _ in pairs)), ca.vertcat(*(ca.vec(after) for _, after in pairs))


def _check_link(link: object) -> None:
    pair = isinstance(link, tuple | list) and len(link) == 2 and all(isinstance(side, ca.SX) for side in link)
    if not (isinstance(link, str) or pair):
        wanted = "the name of a signal, or a pair of expressions (before, after)"
        raise TypeError(f"Sequence: links has {checks.shown(link)}, expected {wanted}")


@dataclass(frozen=True, eq=False)
class SequenceSolution:
    """The answer of a Sequence: one Solution for each problem, in order of time, and what they share."""

    phases: tuple[Solution, ...]
    status: Status
    message: str
    solver_status: str
    cost: float
    timings: Timings
    iterations: int
    problem: Sequence

    @property
    def ok(self) -> bool:
        """Whether the solver met its tolerance."""
        return self.status is Status.SOLVED

    @property
    def duration(self) -> float:
        """Sum of the durations [s]."""
        return sum(phase.duration for phase in self.phases)

    @property
    def junctions(self) -> Array:
        """(P + 1,) times at which the phases begin, and the end [s]."""
        return np.concatenate([[0.0], np.cumsum([phase.duration for phase in self.phases])])

    @property
    def t(self) -> Array:
        """Times of all nodes and collocation points of all phases, increasing [s]."""
        return np.unique(np.concatenate([a + phase.t for a, phase in zip(self.junctions, self.phases, strict=False)]))

    def __repr__(self) -> str:
        parts = ", ".join(f"{phase.duration:.6g}" for phase in self.phases)
        return f"SequenceSolution({self.status.name.lower()}, durations {parts} s, cost {self.cost:.9g})"

    def signal(self, signal: str, t: Array | float) -> Array:
        """Return a signal that all systems have, at times t [s] of the whole motion, shape (K, m) or (m,)."""
        checks.text("signal", signal, "the name of a signal that all systems have")
        end = self.duration
        wanted, slack = f"times within the motion, 0 to {end} s", OUTSIDE * end
        times = checks.places("t", t, wanted, -slack, end + slack, least=1)
        starts = self.junctions
        phase = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(self.phases) - 1)
        parts = [
            self.phases[k].signal(signal, np.clip(time - starts[k], 0.0, self.phases[k].duration))
            for k, time in zip(phase, times, strict=True)
        ]
        return np.array(parts) if np.ndim(t) else parts[0]


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
