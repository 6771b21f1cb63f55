"""Integral constraints: each integral becomes a state y with y' = expression and y(0) = 0, constrained at the end."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import casadi as ca

from ocp.problem.constraints import Constraint, Where, end, start
from ocp.system import Label, System


@dataclass(frozen=True, eq=False)
class _Integrals:
    """A system with integrals as states; the expressions are kept, so that their hashes stay theirs."""

    system: System
    states: ca.SX  # (k,)
    expressions: ca.SX  # (k,)


# Problems on one system with the same integrals share the extended system: a prepared NLP fits all of them.
_KNOWN: WeakKeyDictionary[System, dict[tuple[object, ...], _Integrals]] = WeakKeyDictionary()


def with_integrals(system: System, constraints: tuple[Constraint, ...]) -> tuple[System, tuple[Constraint, ...]]:
    """Return a system and constraints at both ends that replace integral constraints.

    Args:
        system: x' = f(x, u, p).
        constraints: of a problem; those that are no integrals stay as they are.

    Raises:
        ValueError: an integrand has symbols that the system does not have.
    """
    wanted = [c for c in constraints if c.where is Where.INTEGRAL]
    if not wanted:
        return system, constraints
    expressions = ca.vertcat(*(c.expression for c in wanted))
    names = [c.name or "integral" for c in wanted]
    labels = [
        Label(name if c.expression.numel() == 1 else f"{name}_{i + 1}")
        for name, c in zip(names, wanted, strict=True)
        for i in range(c.expression.numel())
    ]
    system.check_symbols("Problem: integral(...)", expressions)
    key = (*(part.element_hash() for part in ca.vertsplit(expressions)), *(label.name for label in labels))
    known = _KNOWN.setdefault(system, {})
    if key not in known:
        known[key] = _extended(system, expressions, labels)
    here, row = known[key], 0
    ends: list[Constraint] = []
    for constraint, name in zip(wanted, names, strict=True):
        y = here.states[row : row + constraint.expression.numel()]
        row += constraint.expression.numel()
        ends += [start(y, 0.0, name=name), end(y, constraint.lower, constraint.upper, name=name)]
    return here.system, (*(c for c in constraints if c.where is not Where.INTEGRAL), *ends)


def _extended(system: System, expressions: ca.SX, labels: list[Label]) -> _Integrals:
    y, implicit = ca.SX.sym("y", expressions.numel()), system.implicit
    x = ca.vertcat(system.x, y)
    if implicit is not None:
        implicit = implicit.extended((system.x, system.u), (x, system.u), system.p, ca.densify(expressions))
    extended = replace(
        system,
        x=x,
        rate=ca.vertcat(system.rate, expressions),
        labels={**system.labels, "x": (*system.label("x", system.x.numel()), *labels)},
        integrals=system.integrals + y.numel(),
        implicit=implicit,
    )
    return _Integrals(extended, y, expressions)


@functools.lru_cache(maxsize=32)
def integrands(system: System) -> ca.Function:
    """Return the function (x, u, p) -> integrands (k,) of a system; x without its last k states, the integrals.

    Args:
        system: with integrals as its last states.
    """
    count = system.x.numel() - system.integrals
    rate = ca.densify(system.rate[count:])
    return ca.Function("integrands", [system.x[:count], system.u, system.p], [rate])


@functools.lru_cache(maxsize=32)
def without_integrals(system: System) -> System:
    """Return the system without the states that are integrals of others.

    Args:
        system: with integrals as its last states.
    """
    count = system.x.numel() - system.integrals
    labels = {name: own for name, own in system.labels.items() if name != "x"}
    x, implicit = system.x[:count], system.implicit
    if implicit is not None:
        right, rest = ca.SX.sym("b", implicit.y.numel()), ca.SX.zeros(system.integrals)
        solved = implicit.solve(ca.vertcat(x, rest), system.u, system.p, right)
        solve, mirror = ca.Function("solve", [x, system.u, system.p, right], [solved]), implicit.mirror
        kept = None if mirror is None else (mirror[0][:count, :count], mirror[1][:count])
        implicit = replace(implicit, rate=implicit.rate[:count], solve=solve, mirror=kept)
    return replace(
        system, x=x, rate=system.rate[:count], integrals=0, implicit=implicit,
        labels={**labels, "x": system.label("x", system.x.numel())[:count]},
    )  # fmt: skip
