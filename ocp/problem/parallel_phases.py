"""The phases of a sequence as one problem: they run in parallel, each over a duration of its own.

With the shares s in [0, 1] of the durations T_k, the states of all phases together obey dx_k/ds = T_k f_k(x_k, u_k, p).
The durations are parameters that are unknowns, and so are the values c of the linked expressions at each junction:
before(x_k(1)) = c = after(x_k+1(0)). Whatever is known about a Problem, such as the estimate of its error, its
sensitivities or its switching structure, is so known about a Sequence.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca

from ocp.problem.constraints import Constraint, Where, along, end, simple, start
from ocp.problem.problem import Bolza, Fixed, Problem
from ocp.problem.sequence import Sequence
from ocp.system import Implicit, Label, System


@dataclass(frozen=True, eq=False)
class ParallelPhases:
    """A sequence and the same as one problem of duration 1; made by `in_parallel`.

    Args:
        sequence: phases one after the other.
        problem: all phases in parallel, over the share of their durations.
        parts: the symbols of each phase in it.
    """

    sequence: Sequence
    problem: Problem
    parts: tuple[Part, ...]

    @property
    def timed(self) -> bool:
        """Whether the cost is the sum of the durations and nothing else."""
        costs = [phase.minimise for phase in self.sequence.problems]
        rest = [part for cost in costs for part in (cost.running, cost.final, cost.initial)]
        return costs[0].time > 0.0 and all(c.time == costs[0].time for c in costs) and all(p.is_zero() for p in rest)


@dataclass(frozen=True, eq=False)
class Part:
    """The symbols of one phase in the problem of all phases.

    Args:
        system: of the phase.
        x, u: slices of the states and controls of all phases.
        names: name of a parameter of the phase -> its name in the problem of all phases.
        duration: name of the parameter that is the duration of the phase.
        junction: names of the parameters that are the values of the linked expressions at its end.
        symbols: x, u, p and the duration of the phase.
    """

    system: System
    x: slice
    u: slice
    names: Mapping[str, str]
    duration: str
    junction: tuple[str, ...]
    symbols: tuple[ca.SX, ca.SX, ca.SX, ca.SX]

    def put(self, expression: ca.SX) -> ca.SX:
        """Return an expression of the phase in the symbols of all phases."""
        system = self.system
        x, u, p, _ = self.symbols
        result = ca.Function("put", [system.x, system.u, system.p], [expression]).call([x, u, p])[0]
        assert isinstance(result, ca.SX)
        return result

    def put_inner(self, implicit: Implicit, y: ca.SX, *expressions: ca.SX) -> list[ca.SX]:
        """Return expressions in the unknowns of an implicit rate of the phase, in y and the symbols of all phases."""
        system = self.system
        inner = ca.Function("inner", [system.x, system.u, system.p, implicit.y], list(expressions))
        return list(inner.call([*self.symbols[:3], y]))


def in_parallel(sequence: Sequence) -> ParallelPhases:
    """Return a sequence as one problem of duration 1.

    Parameters with one name and one nominal value are one parameter, an unknown of all phases or of none. Others with a
    common name have the phase in their names.

    Args:
        sequence: phases one after the other.
    """
    named = all(isinstance(link, str) for link in (*sequence.links, *sequence.closing))
    systems, free = tuple(phase.system for phase in sequence.problems), tuple(map(_free, sequence.problems))
    cached = _system(systems, free, sequence.links, sequence.closing) if named else None  # type: ignore[arg-type]
    system, parts, ends = cached or _assembled(sequence, free)
    constraints: list[Constraint] = []
    running, final, initial = ca.SX(0), ca.SX(0), ca.SX(0)
    for k, (phase, part) in enumerate(zip(sequence.problems, parts, strict=True), 1):
        horizon, cost, duration = phase.horizon, phase.minimise, part.symbols[3]
        low, high = (horizon.duration,) * 2 if isinstance(horizon, Fixed) else (horizon.lower, horizon.upper)
        constraints.append(along(duration, low, high))
        for constraint in phase.subject_to:
            name = f"{constraint.name} (phase {k})" if constraint.name else ""
            constraints.append(replace(constraint, expression=part.put(constraint.expression), name=name))
        running += duration * part.put(cost.running)
        final += cost.time * duration + part.put(cost.final)
        initial += part.put(cost.initial)
    problem = Problem(system, Fixed(1.0), Bolza(0.0, running, final, initial), (*constraints, *ends))
    return ParallelPhases(sequence, problem, parts)


@functools.lru_cache(maxsize=16)
def _system(
    systems: tuple[System, ...], free: tuple[frozenset[str], ...], links: tuple[str, ...], closing: tuple[str, ...]
) -> tuple[System, tuple[Part, ...], tuple[Constraint, ...]]:
    """Return the system of all phases; the same object for sequences that differ in numbers only."""
    return _assembled(Sequence(tuple(Problem(system) for system in systems), links, closing), free)


def _free(problem: Problem) -> frozenset[str]:
    """Return the names of the parameters that are unknowns."""
    names = list(problem.system.nominal)
    along_motion = (c for c in problem.subject_to if c.where is Where.ALONG)
    return frozenset(names[index] for c in along_motion for index, _ in simple(c, problem.system.p))


def _assembled(
    sequence: Sequence, free: tuple[frozenset[str], ...]
) -> tuple[System, tuple[Part, ...], tuple[Constraint, ...]]:
    systems = [phase.system for phase in sequence.problems]
    kinds: dict[str, set[tuple[float, bool]]] = {}
    for system, unknown in zip(systems, free, strict=True):
        for name, value in system.nominal.items():
            kinds.setdefault(name, set()).add((float(value), name in unknown))
    symbols: dict[str, ca.SX] = {}
    values: dict[str, float] = {}
    parts: list[Part] = []
    nx = nu = 0
    junctions = {before: side for before, _, side, _ in sequence.junctions}
    for k, system in enumerate(systems):
        sizes = system.x.numel(), system.u.numel()
        names = {name: name if len(kinds[name]) == 1 else f"{name} (phase {k + 1})" for name in system.nominal}
        duration = f"duration (phase {k + 1})"
        linked = junctions[k].numel() if k in junctions else 0
        junction = tuple(f"link {i + 1} after phase {k + 1}" for i in range(linked))
        for name, value in {**{names[n]: v for n, v in system.nominal.items()}, duration: 1.0}.items():
            symbols.setdefault(name, ca.SX.sym(name))
            values[name] = value
        own = (
            ca.SX.sym(f"x_{k + 1}", sizes[0]), ca.SX.sym(f"u_{k + 1}", sizes[1]),
            ca.SX(ca.vertcat(*(symbols[name] for name in names.values()))) if names else ca.SX(0, 1), symbols[duration],
        )  # fmt: skip
        parts.append(Part(system, slice(nx, nx + sizes[0]), slice(nu, nu + sizes[1]), names, duration, junction, own))
        nx, nu = nx + sizes[0], nu + sizes[1]
    ends = []
    for before, after, left, right in sequence.junctions:
        met = ca.SX.sym("met", left.numel())
        for name, symbol in zip(parts[before].junction, ca.vertsplit(met), strict=True):
            symbols[name], values[name] = symbol, 0.0
        ends += [
            along(met), end(parts[before].put(left) - met, 0.0), start(parts[after].put(right) - met, 0.0),
        ]  # fmt: skip
    shared = set.intersection(*(set(system.signals) for system in systems))
    labels = {
        name: tuple(
            Label(f"{label.name} (phase {k})", label.unit)
            for k, part in enumerate(parts, 1)
            for label in part.system.label(name, _size(part.system, name))
        )
        for name in ("x", "u", *sorted(shared))
    }
    columns = (ca.vertcat(*(part.symbols[i] for part in parts)) for i in (0, 1))
    x, u, p = *columns, ca.vertcat(*symbols.values())
    system = System(
        x, u, p, ca.vertcat(*(part.symbols[3] * part.put(part.system.rate) for part in parts)),
        {name: ca.vertcat(*(ca.vec(part.put(part.system[name])) for part in parts)) for name in sorted(shared)},
        values, labels,
        singular=tuple(
            replace(item, quantity=part.put(item.quantity)) for part in parts for item in part.system.singular
        ),
        implicit=_implicit(parts, (x, u, p), sorted(shared)),
    )  # fmt: skip
    return system, tuple(parts), tuple(ends)


def _implicit(parts: list[Part], symbols: tuple[ca.SX, ca.SX, ca.SX], shared: list[str]) -> Implicit | None:
    """Return the rate of all phases with the unknowns of those whose rates have some; None if no rate has any."""
    if all(part.system.implicit is None for part in parts):
        return None
    ys, residuals, values, solved, rates, rests, weights = ([] for _ in range(7))
    signals: dict[str, list[ca.SX]] = {name: [] for name in shared}
    rights = []
    for part in parts:
        implicit, duration, nx = part.system.implicit, part.symbols[3], part.system.x.numel()
        explicit = duration * part.put(part.system.rate)
        if implicit is None:
            rates.append(explicit)
            rests.append(explicit)
            weights.append(ca.SX(nx, nx))
            for name in shared:
                signals[name].append(ca.vec(part.put(part.system[name])))
            continue
        y, right = ca.SX.sym("y", implicit.y.numel()), ca.SX.sym("b", implicit.y.numel())
        zero, rest = implicit.mirror or (ca.DM(nx, nx), implicit.rate)
        short = [ca.vec(implicit.signals.get(name, part.system[name])) for name in shared]
        rate, rest, residual, *named = part.put_inner(implicit, y, implicit.rate, rest, implicit.residual, *short)
        ys.append(y)
        residuals.append(residual)
        values.append(part.put(implicit.value))
        rights.append(right)
        solved.append(implicit.solve(*part.symbols[:3], right))
        rates.append(duration * rate)
        rests.append(duration * rest)
        weights.append(duration * zero)
        for name, own in zip(shared, named, strict=True):
            signals[name].append(own)
    solve = ca.Function("solve", [*symbols, ca.vertcat(*rights)], [ca.vertcat(*solved)])
    common = {name: ca.vertcat(*own) for name, own in signals.items()}
    y, rate, residual, value, rest = (ca.vertcat(*own) for own in (ys, rates, residuals, values, rests))
    return Implicit(y, rate, residual, value, solve, common, (ca.diagcat(*weights), rest))


def _size(system: System, name: str) -> int:
    return int((system.x if name == "x" else system.u if name == "u" else system[name]).numel())
