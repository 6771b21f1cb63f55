"""An optimal-control problem as a value: system, horizon, cost, constraints."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ocp import checks
from ocp.problem.constraints import Constraint, Where, along, row_components, simple, single_symbols, start
from ocp.problem.integral_constraints import with_integrals
from ocp.system import Label, System


@dataclass(frozen=True)
class Fixed:
    """A horizon of given duration [s]."""

    duration: float

    def __post_init__(self) -> None:
        checks.number("Fixed: duration", self.duration, "a finite number of seconds > 0", above=0.0)


@dataclass(frozen=True)
class Free:
    """A horizon whose duration is an unknown.

    Args:
        guess: starting value of the duration [s].
        lower, upper: its limits [s].
    """

    guess: float = 1.0
    lower: float = 0.0
    upper: float = float("inf")

    def __post_init__(self) -> None:
        checks.number("Free: guess", self.guess, "a finite number of seconds > 0", above=0.0)
        for name in ("lower", "upper"):
            checks.number(f"Free: {name}", getattr(self, name), "a number of seconds", finite=False)
        if not 0.0 <= self.lower <= self.upper or self.lower == np.inf:
            raise ValueError(f"Free: limits {self.lower} .. {self.upper} s, expected 0 <= lower <= upper")


@dataclass(frozen=True, eq=False)
class Bolza:
    """A cost J = time * T + integral of running dt + final + initial.

    Args:
        time: weight of the duration T [1/s for a cost without unit].
        running: expression in x, u, p; integrated over the motion.
        final: expression in x, p; its value at the end.
        initial: expression in x, p; its value at the start.
    """

    time: float = 0.0
    running: ca.SX = field(default_factory=lambda: ca.SX(0))
    final: ca.SX = field(default_factory=lambda: ca.SX(0))
    initial: ca.SX = field(default_factory=lambda: ca.SX(0))

    def __post_init__(self) -> None:
        checks.number("Bolza: time weight", self.time, "a finite number")
        for name in ("running", "final", "initial"):
            given = getattr(self, name)
            wanted = "an expression in x, u, p, or a finite number"
            if not isinstance(given, int | float | np.number):
                checks.expression(f"Bolza: {name}", given, wanted)
            expression = given if isinstance(given, ca.SX) else ca.SX(checks.number(f"Bolza: {name}", given, wanted))
            if expression.numel() != 1:
                raise ValueError(f"Bolza: {name} has {expression.numel()} components, expected one expression")
            object.__setattr__(self, name, expression)


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise a Bolza cost over a horizon, subject to constraints.

    Args:
        system: x' = f(x, u, p).
        horizon: Free or Fixed.
        minimise: the cost.
        subject_to: made by start, end, along, periodic, integral, inside, outside. An integral becomes a state of the
            system of the problem, after the others. The limits of the system itself are added;
            along(..., name=) with the name of such a limit takes its place.

    Raises:
        TypeError: a part of the wrong kind.
        ValueError: an expression with symbols that the system does not have, or a constraint that needs u at an end
            of a cost.
    """

    system: System
    horizon: Free | Fixed = field(default_factory=Free)
    minimise: Bolza = field(default_factory=lambda: Bolza(time=1.0))
    subject_to: tuple[Constraint, ...] = ()

    def __post_init__(self) -> None:
        for name, kind in (("system", System), ("horizon", Free | Fixed), ("minimise", Bolza)):
            if not isinstance(getattr(self, name), kind):
                raise TypeError(f"Problem: {name} is {checks.shown(getattr(self, name))}, expected {kind}")
        wanted = "a tuple of start(...), along(...) ..."
        checks.instance("Problem: subject_to", self.subject_to, Constraint | tuple | list, wanted)
        constraints = (self.subject_to,) if isinstance(self.subject_to, Constraint) else tuple(self.subject_to)
        for constraint in constraints:
            if not isinstance(constraint, Constraint):
                raise TypeError(
                    f"Problem: subject_to has {checks.shown(constraint)}, expected start(...), end(...) or along(...)"
                )
            self.system.check_symbols(f"Problem: {constraint.where.value}(...)", constraint.expression)
        system, constraints = with_integrals(self.system, constraints)
        object.__setattr__(self, "system", system)
        own = {name: sides for name, sides in self.system.limits.items() if name not in {c.name for c in constraints}}
        constraints += tuple(along(self.system[name], *sides, name=name) for name, sides in own.items())
        clock = self.system.t
        if clock is not None and not any(
            c.where is Where.START and ca.depends_on(c.expression, clock) for c in constraints
        ):
            constraints += (start(clock, 0.0),)
        object.__setattr__(self, "subject_to", constraints)
        self.system.check_symbols("Bolza: running", self.minimise.running)
        for name in ("final", "initial"):
            part = getattr(self.minimise, name)
            self.system.check_symbols(f"Bolza: {name}", part)
            if ca.depends_on(part, self.system.u):
                raise ValueError(
                    f"Bolza: {name} depends on the control, which has no value at one instant; use running"
                )

    def __reduce__(self) -> tuple[object, ...]:
        system, cost = self.system, self.minimise
        expressions = [cost.running, cost.final, *(c.expression for c in self.subject_to)]
        limits = [(c.where, c.lower, c.upper, c.name, *(() if c.between is None else (c.between,)))
                  for c in self.subject_to]  # fmt: skip
        starts = not cost.initial.is_zero()
        expressions += [cost.initial] if starts else []
        function = ca.Function("problem", [system.x, system.u, system.p], expressions)
        return rebuild, (system, self.horizon, cost.time, function, limits, *((True,) if starts else ()))

    def labels(self, constraint: Constraint) -> tuple[Label, ...]:
        """Return the labels of the components of a constraint: those of the signal that it is, or numbered ones."""
        checks.instance("constraint", constraint, Constraint, "start(...), end(...) or along(...)")
        system, size = self.system, constraint.expression.numel()
        if len(system.labels.get(constraint.name, ())) == size:
            return system.labels[constraint.name]
        if constraint.name:
            return (
                (Label(constraint.name),)
                if size == 1
                else tuple(Label(f"{constraint.name}_{c + 1}") for c in range(size))
            )
        known = [
            (signal[i], label)
            for name, signal in {**system.signals, "x": system.x, "u": system.u}.items()
            for i, label in enumerate(system.label(name, signal.numel()))
        ]
        results = []
        for c, component in enumerate(ca.vertsplit(constraint.expression)):
            same = (label for signal, label in known if ca.is_equal(signal, component, 2))
            results.append(next(same, Label("a limited expression" if size == 1 else f"limited expression {c + 1}")))
        return tuple(results)

    def limits(self, where: Where, symbols: ca.SX) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower and upper limits that simple components of constraints put on symbols.

        Args:
            where: START, END or ALONG.
            symbols: (m,) a column of symbols of the system.

        Returns:
            lower, upper: (m,), infinite without a bound; lower > upper where constraints contradict each other.
        """
        checks.instance("where", where, Where, "Where.START, Where.END or Where.ALONG")
        checks.expression("symbols", symbols, "a column of symbols of the system")
        known = self.system.x, self.system.u, self.system.p
        for number, column in enumerate(known):
            if symbols is column:
                low, high = _limits(self, where, number)
                return low.copy(), high.copy()
        return _limits_of(self, where, symbols)


def same_structure(old: Problem, new: Problem) -> Problem:
    """Return `new` if it differs from `old` in numbers only, else raise ValueError."""
    same = (
        new.system is old.system
        and type(new.horizon) is type(old.horizon)
        and _same_cost(new.minimise, old.minimise)
        and len(new.subject_to) == len(old.subject_to)
        and all(
            a.where is b.where
            and a.expression.shape == b.expression.shape
            and _same_equations(new, a, b)
            and ca.is_equal(a.expression, b.expression, 10)
            for a, b in zip(old.subject_to, new.subject_to, strict=True)
        )
    )
    if not same:
        raise ValueError(
            "problem: differs from the prepared one in more than limits, start and end values; prepare it anew"
        )
    return new


def _same_equations(problem: Problem, one: Constraint, other: Constraint) -> bool:
    """Return whether the same components of two constraints are equations along the motion, with the same values."""
    system = problem.system
    if one.where is not Where.ALONG:
        return True
    rows = row_components(one, system)
    pairs = [[(float(a), float(b)) for a, b in zip(part.lower, part.upper, strict=True)] for part in (one, other)]
    return all(
        c not in rows or ((a[0] == a[1]) == (b[0] == b[1]) and (a[0] != a[1] or a == b))
        for c, (a, b) in enumerate(zip(*pairs, strict=True))
    )


def _same_cost(one: Bolza, other: Bolza) -> bool:
    pairs = ((one.running, other.running), (one.final, other.final), (one.initial, other.initial))
    return one is other or (one.time == other.time and all(ca.is_equal(a, b, 10) for a, b in pairs))


@functools.lru_cache(maxsize=64)
def _limits(problem: Problem, where: Where, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits on x, u or p (number 0, 1, 2); asked for many times in one solve."""
    size = (problem.system.x, problem.system.u, problem.system.p)[number].numel()
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for constraint in problem.subject_to:
        if constraint.where is where:
            for which, index, c in single_symbols(constraint, problem.system):
                if which == number:
                    low[index] = max(low[index], constraint.lower[c])
                    high[index] = min(high[index], constraint.upper[c])
    return low, high


def _limits_of(problem: Problem, where: Where, symbols: ca.SX) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.full(symbols.numel(), -np.inf), np.full(symbols.numel(), np.inf)
    for constraint in problem.subject_to:
        if constraint.where is where:
            for index, c in simple(constraint, symbols):
                low[index] = max(low[index], constraint.lower[c])
                high[index] = min(high[index], constraint.upper[c])
    return low, high


def parameters(problem: Problem, values: Sequence[float]) -> np.ndarray:
    """Return parameter values (np,), one for each parameter of the system of a problem.

    Args:
        problem: whose parameters.
        values: in the order of p.

    Raises:
        TypeError: no Problem.
        ValueError: another number of values, or one that is not finite.
    """
    checks.instance("problem", problem, Problem, "a Problem")
    names = problem.system.nominal
    wanted = f"{len(names)} finite numbers, one for each parameter ({', '.join(names) or 'none'})"
    if not names and np.size(values) == 0:
        return np.zeros(0)
    return checks.column("values", values, len(names), wanted)


def rebuild(
    system: System,
    horizon: Free | Fixed,
    time: float,
    function: ca.Function,
    limits: Sequence[tuple[Any, ...]],
    starts: bool = False,
) -> Problem:
    """Return the Problem with the expressions of a function (x, u, p) -> (running, final, *constraints).

    Args:
        system: on whose symbols the expressions are rebuilt.
        horizon: Free or Fixed.
        time: weight of the duration.
        function: as made by pickling a Problem.
        limits: where, lower, upper, name and, if it has one, the excess between the nodes of every constraint.
        starts: whether the last expression is a cost at the start.
    """
    running, final, *expressions = function.call([system.x, system.u, system.p])
    initial = expressions.pop() if starts else ca.SX(0)
    constraints = [
        Constraint(limit[0], expression, *limit[1:]) for expression, limit in zip(expressions, limits, strict=True)
    ]
    return Problem(system, horizon, Bolza(time, running, final, initial), tuple(constraints))
