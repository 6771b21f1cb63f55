"""Problems one after the other, linked at their junctions: phases with different systems, costs and limits."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass, field
from itertools import pairwise

import casadi as ca

from ocp import checks
from ocp.problem.problem import Problem

Link = str | tuple[ca.SX, ca.SX]


@dataclass(frozen=True, eq=False)
class Sequence:
    """Problems one after the other; the cost is the sum of theirs.

    Args:
        problems: in order of time, each with a free or fixed duration of its own.
        links: what is continuous at every junction: names of signals that the systems on both sides have, or pairs
            (expression of the earlier system, expression of the later one), the same at every junction.
        closing: the same for the end of the last problem and the start of the first, for motions that repeat, such as
            laps; none by default. Where an angle goes on turning, link (angle, angle + 2 pi).

    A parameter that several problems have as an unknown, `along(p, ...)`, is one number for all of them.

    Raises:
        TypeError: a part of the wrong kind.
        ValueError: fewer than two problems, or the two sides of a link differ in size.
        KeyError: a system lacks a linked signal.
    """

    problems: tuple[Problem, ...]
    links: tuple[Link, ...] = ("q", "v")
    closing: tuple[Link, ...] = ()
    sides: tuple[tuple[ca.SX, ca.SX], ...] = field(init=False)  # of each junction: before, after
    closed: tuple[tuple[ca.SX, ca.SX], ...] = field(init=False)  # of the end and the start, if they are linked

    def __init__(
        self, problems: Several[Problem], links: Several[Link] = ("q", "v"), closing: Several[Link] = ()
    ) -> None:
        checks.instance("Sequence: problems", problems, tuple | list, "Problems in order of time")
        checks.instance("Sequence: links", links, tuple | list | str, "names of signals, or pairs of expressions")
        object.__setattr__(self, "problems", tuple(problems))
        checks.instance("Sequence: closing", closing, tuple | list | str, "names of signals, or pairs of expressions")
        object.__setattr__(self, "links", (links,) if isinstance(links, str) else tuple(links))
        object.__setattr__(self, "closing", (closing,) if isinstance(closing, str) else tuple(closing))
        for name in ("links", "closing"):
            for link in getattr(self, name):
                _check_link(name, link)
        for problem in self.problems:
            if not isinstance(problem, Problem):
                raise TypeError(f"Sequence: problems has {checks.shown(problem)}, expected Problems")
        if len(self.problems) < 2:
            raise ValueError(f"Sequence: got {len(self.problems)} problem, expected at least two")
        junctions = tuple(_junction(self.links, one, other) for one, other in pairwise(self.problems))
        object.__setattr__(self, "sides", junctions)
        last, first = self.problems[-1], self.problems[0]
        object.__setattr__(self, "closed", (_junction(self.closing, last, first),) if self.closing else ())

    @property
    def junctions(self) -> tuple[tuple[int, int, ca.SX, ca.SX], ...]:
        """Every junction: number of the problem before it and after it, linked expressions before and after."""
        inner = tuple((k, k + 1, before, after) for k, (before, after) in enumerate(self.sides))
        return inner + tuple((len(self.problems) - 1, 0, before, after) for before, after in self.closed)

    def __reduce__(self) -> tuple[object, ...]:
        if not all(isinstance(link, str) for link in (*self.links, *self.closing)):
            raise TypeError("Sequence: one with links of expressions cannot go to another process; link named signals")
        return Sequence, (self.problems, self.links, *((self.closing,) if self.closing else ()))


def _junction(links: tuple[Link, ...], one: Problem, other: Problem) -> tuple[ca.SX, ca.SX]:
    """Return the linked expressions of the problem before a junction and of the one after it."""
    pairs = [(one.system[link], other.system[link]) if isinstance(link, str) else link for link in links]
    for link, (before, after) in zip(links, pairs, strict=True):
        if before.numel() != after.numel():
            raise ValueError(f"Sequence: link {link} has {before.numel()} components before, {after.numel()} after")
        for problem, side in ((one, before), (other, after)):
            problem.system.check_symbols("Sequence: link", side)
            if ca.depends_on(side, problem.system.u):
                raise ValueError("Sequence: a link depends on the control, which may jump; link states only")
    return ca.vertcat(*(ca.vec(before) for before, _ in pairs)), ca.vertcat(*(ca.vec(after) for _, after in pairs))


def _check_link(name: str, link: object) -> None:
    pair = isinstance(link, tuple | list) and len(link) == 2 and all(isinstance(side, ca.SX) for side in link)
    if not (isinstance(link, str) or pair):
        wanted = "the name of a signal, or a pair of expressions (before, after)"
        raise TypeError(f"Sequence: {name} has {checks.shown(link)}, expected {wanted}")


def phases_of(problem: Problem | Sequence) -> tuple[Problem, ...]:
    """Return the problems of a sequence, or the problem itself as the only one."""
    checks.instance("problem", problem, Problem | Sequence, "a Problem or a Sequence")
    return problem.problems if isinstance(problem, Sequence) else (problem,)


def parameter_values(problem: Problem | Sequence, values: Mapping[str, float] | None) -> list[list[float]]:
    """Return the parameter values of every phase, nominal where `values` is silent.

    Raises:
        ValueError: no phase has a parameter that `values` names.
    """
    given = {} if values is None else values
    checks.mapping("values", given, "a dict parameter name -> number, or None")
    known = {name for phase in phases_of(problem) for name in phase.system.nominal}
    if not known.issuperset(given):
        phases_of(problem)[0].system.values({name: 0.0 for name in given if name not in known})
    return [
        phase.system.values({n: v for n, v in given.items() if n in phase.system.nominal})
        for phase in phases_of(problem)
    ]
