"""Post-optimal sensitivities: derivatives of duration, cost, switching times and signals, without solving again."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.problem import Problem, same_structure
from ocp.sensitivities.kkt_derivatives import WEAK, Derivative, Direction, differentiate
from ocp.sensitivities.kkt_root import Optimum, initial_point, settle
from ocp.sensitivities.limit_sensitivities import LimitSensitivity, sensitivities_to_limits
from ocp.sensitivities.motion_derivatives import Held, Variation
from ocp.sensitivities.nlp_of_solution import Reconstruction, reconstruct
from ocp.solution.attached_problem import with_problem
from ocp.solution.solution import Solution
from ocp.system import Label

OPEN = 1e-7  # residual of the conditions of optimality above which a note is added
DISAGREEMENT = 1e-6  # relative, of the two derivatives of the cost, above which a note is added
STILL = 1e-6  # a weakly active bound whose rate is below this share of the largest rate of an unknown does not matter


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of an optimum with respect to numbers, per unit of the number.

    Args:
        solution: that was differentiated.
        names: of the numbers: parameters, and the keys of `toward`.
        duration: name -> [s/unit].
        cost: name -> [cost/unit].
        free: name -> derivatives of the parameters that are unknowns, by their names.
        switching: name -> (A - 1,) of the times between the arcs of `solution.structure` [s/unit]; None if the
            solution is not polished.
        valid: name -> (for a smaller number, for a larger one), whether the derivative holds on that side.
        notes: sentences about derivatives that are one-sided, not determined or not accurate.
        variations: name -> derivative of the motion.
        seconds: wall-clock time of the computation.
        reconstruction, root: the solution as unknowns of its NLP, and the root of its conditions of optimality.
    """

    solution: Solution
    names: tuple[str, ...]
    duration: Mapping[str, float]
    cost: Mapping[str, float]
    free: Mapping[str, Mapping[str, float]]
    switching: Mapping[str, Array] | None
    valid: Mapping[str, tuple[bool, bool]]
    notes: tuple[str, ...]
    variations: Mapping[str, Variation]
    seconds: float
    reconstruction: Reconstruction
    root: Optimum

    @functools.cached_property
    def limits(self) -> tuple[LimitSensitivity, ...]:
        """Derivatives of the cost with respect to every active limit and boundary value, from the multipliers."""
        return sensitivities_to_limits(self.reconstruction, self.root)

    @property
    def problem(self) -> Problem:
        """The problem that was solved."""
        return self.reconstruction.problem

    def x(self, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return name -> derivative of the state at times t, (K, nx), or (nx,) for a scalar."""
        return self.signal("x", t, held)

    def u(self, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return name -> derivative of the control at times t, (K, nu), or (nu,) for a scalar."""
        return self.signal("u", t, held)

    def signal(self, signal: str | ca.SX, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return the derivatives of a signal at times t.

        At a fixed share or time, a control that jumps has no derivative at its switches. With Held.ARC the point moves
        with the switches, and the derivative exists everywhere.

        Args:
            signal: name of a signal ("q", ..., also "x", "u"), or an expression (m,) in x, u, p.
            t: times [s] within the motion, (K,) or scalar.
            held: what is fixed: the share of the duration, the time, or the share of the arc.

        Returns:
            name -> (K, m), or (m,) for a scalar [unit of the signal per unit of the number].

        Raises:
            TypeError: held is no Held.
            ValueError: t lies outside the motion.
            KeyError: no such signal.
        """
        checks.instance("held", held, Held, ", ".join(map(str, Held)))
        checks.instance("signal", signal, str | ca.SX, "the name of a signal or an expression")
        system = self.problem.system
        known = {"x": system.x, "u": system.u}
        expression = signal if isinstance(signal, ca.SX) else known[signal] if signal in known else system[signal]
        system.check_symbols("signal", expression)
        self.solution.locate(t)
        times = np.atleast_1d(np.asarray(t, dtype=float))
        every = {
            name: one.signal(self.solution, self.problem, expression, times, held)
            for name, one in self.variations.items()
        }
        return every if np.ndim(t) else {name: result[0] for name, result in every.items()}

    def switches(self, control: str) -> dict[str, Array]:
        """Return name -> derivatives of the times that `solution.structure.switches(control)` gives [s/unit].

        Raises:
            ValueError: the solution is not polished, or there is no such control.
        """
        structure = self.solution.structure
        if structure is None or self.switching is None:
            raise ValueError("switches: this solution has no switching structure; take the sensitivity of polish(...)")
        starts = np.cumsum([arc.duration for arc in structure.arcs])[:-1]
        chosen = [int(np.argmin(np.abs(starts - t))) for t in structure.switches(control)]
        return {name: result[chosen] for name, result in self.switching.items()}

    def labels(self, signal: str, name: str) -> tuple[Label, ...]:
        """Return names and units of the components of `signal(signal, ...)[name]`.

        Raises:
            TypeError: an argument is no string.
            KeyError: no such signal.
            ValueError: no such number.
        """
        system = self.problem.system
        checks.text("signal", signal, "the name of a signal")
        if not isinstance(name, str) or name not in self.names:
            raise checks.refused("name", name, f"one of {', '.join(self.names)}")
        size = (system.x if signal == "x" else system.u if signal == "u" else system[signal]).numel()
        return tuple(
            Label(f"d {one.name} / d {name}", f"{one.unit or '1'} per unit of {name}")
            for one in system.label(signal, size)
        )

    def __str__(self) -> str:
        width = max(len(name) for name in self.names)
        lines = [f"{'per unit of':{max(width, 11)}s}  duration [s]  cost"]
        lines += [f"{n:{max(width, 11)}s}  {self.duration[n]:<12.6g}  {self.cost[n]:<.6g}" for n in self.names]
        return "\n".join([*lines, *self.notes])


def sensitivity(
    solution: Solution,
    names: str | Sequence[str] | None = None,
    toward: Mapping[str, Problem] | None = None,
    problem: Problem | None = None,
) -> Sensitivity:
    """Differentiate an optimum with respect to numbers, from the conditions of optimality of its NLP.

    The conditions F(Z, y; s) = 0 hold at the optimum, so that dF/dZ dZ + dF/dy dy = -dF/ds ds; one factorisation
    serves all numbers. The optimum is that of the NLP: for a polished solution the optimum of the problem, to the
    accuracy of the polish; otherwise the optimum on the grid of the solution with its scheme.

    Args:
        solution: solved, of a Problem, polished or not.
        names: of parameters of the system; None for all that are given.
        toward: name -> the problem after the number called `name` has grown by one; it may differ in limits, start
            and end values or a given duration only. The derivative is taken along the difference.
        problem: needed only for a solution loaded without it.

    Returns:
        Sensitivity; NaN and a note where a derivative does not exist, a note where it holds on one side only.

    Raises:
        TypeError: a sequence, or something else that is no Solution.
        ValueError: not solved, without its problem, a wrong name, or nothing to vary.

    Source: A. V. Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming, 1983.
    """
    begun = time.perf_counter()
    solution, problem = _checked(solution, problem)
    system = problem.system
    chosen = _names(solution, problem, names, toward)
    here = reconstruct(solution, problem)
    head, base = len(here.head), here.bounds
    directions = []
    for name in chosen:
        unit = np.zeros(head)
        unit[list(system.nominal).index(name)] = 1.0
        directions.append(Direction(unit, tuple(np.zeros(len(side)) for side in base)))  # type: ignore[arg-type]
    for other in (toward or {}).values():
        new_head, new = here.moved(same_structure(problem, other))
        directions.append(Direction.between((here.head, base), (new_head, new)))
    everything = (*chosen, *(toward or {}))
    conditions, at = initial_point(here.nlp, base, here.z, here.s, here.y, here.limits)
    at = settle(here.nlp, base, conditions, at)
    result = differentiate(here.nlp, base, conditions, at, tuple(directions), head)
    variations = {
        name: _variation(here, result.z[:, c], direction)
        for c, (name, direction) in enumerate(zip(everything, directions, strict=True))
    }
    valid, notes = _sides(here, result, everything, at)
    if at.error > OPEN:
        notes.append(f"conditions of optimality open by {at.error:.1e}; solve with a smaller tol")
    for c, name in enumerate(everything):
        if result.gap[c] > DISAGREEMENT:
            notes.append(f"{name}: cost by multipliers and by the motion differ by {result.gap[c]:.1e}")
    duration = {name: one.duration for name, one in variations.items()}
    if result.reason and result.unique and _timed(problem):
        duration = dict(zip(everything, (float(cost / problem.minimise.time) for cost in result.cost), strict=True))
    switching = None
    if here.posed is not None:
        last = np.flatnonzero(np.diff(here.arc))
        switching = {name: np.cumsum(one.seconds)[last] for name, one in variations.items()}
    free = {name: {list(system.nominal)[i]: float(one.p[i]) for i in here.nlp.free} for name, one in variations.items()}
    costs = {name: float(c) for name, c in zip(everything, result.cost, strict=True)}
    return Sensitivity(
        solution, everything, duration, costs, free, switching, valid, tuple(notes), variations,
        time.perf_counter() - begun, here, at,
    )  # fmt: skip


def _checked(solution: Solution, problem: Problem | None) -> tuple[Solution, Problem]:
    result = with_problem("sensitivity", solution, problem)
    if not solution.ok:
        raise ValueError(f"sensitivity: {solution.message}; only a solved solution has derivatives, solve it first")
    if not solution.duration > 0.0:
        raise ValueError("sensitivity: the motion has no duration; move start or goal, then it has derivatives")
    return result


def _names(
    solution: Solution, problem: Problem, names: str | Sequence[str] | None, toward: Mapping[str, Problem] | None
) -> tuple[str, ...]:
    known = [name for name in problem.system.nominal if name not in solution.free]
    checks.instance("names", names, str | list | tuple | None, "names of parameters, or None for all")
    checks.instance("toward", toward, Mapping | None, "a dict name -> Problem, or None")
    chosen = tuple(known) if names is None else (names,) if isinstance(names, str) else tuple(names)
    listed = ", ".join(known) or "none"
    for number, name in enumerate(chosen):
        checks.text("names, each", name, "the name of a parameter")
        if name in chosen[:number]:
            raise ValueError(f"names: got {name!r} twice, expected different ones")
        if name in solution.free:
            raise ValueError(f"names: {name!r} is an unknown of this problem; given parameters are {listed}")
        if name not in known:
            raise ValueError(f"names: no parameter {name!r}; there are {listed}")
    for name, other in (toward or {}).items():
        checks.text("toward, each name", name)
        checks.instance(f"toward {name!r}", other, Problem, "a Problem")
        if name in chosen:
            raise ValueError(f"toward: {name!r} is a parameter already; choose another name")
    if not chosen and not toward:
        given = "" if names is None else f"names: got {checks.shown(names)}, "
        raise ValueError(f"{given}nothing to vary; there are the parameters {listed}, toward= names other numbers")
    return chosen


def _timed(problem: Problem) -> bool:
    cost = problem.minimise
    return cost.time != 0.0 and cost.running.is_zero() and cost.final.is_zero() and cost.initial.is_zero()


def _variation(here: Reconstruction, change: Array, direction: Direction) -> Variation:
    """Return the change of a motion in physical units."""
    layout, scaling = here.nlp.layout, here.nlp.scaling
    count = len(here.problem.system.nominal)
    p = np.array(direction.head[:count])
    p[here.nlp.free] = change[layout.free] * scaling.free
    durations = change[layout.horizon] * scaling.horizon if len(layout.horizon) else direction.head[count:]
    seconds = durations[here.arc] * here.shares
    return Variation(change[layout.state] * scaling.x, change[layout.control] * scaling.u, seconds, p)


def _sides(
    here: Reconstruction, result: Derivative, names: tuple[str, ...], at: Optimum
) -> tuple[dict[str, tuple[bool, bool]], list[str]]:
    """Return for each name on which sides the derivative holds, and a sentence where it does not hold on both."""
    if result.reason:
        words = f"no derivative of the motion: {result.reason}"
        return dict.fromkeys(names, (result.unique, result.unique)), [words]
    valid, notes = {}, []
    largest = np.max(np.abs(result.z), axis=0, initial=0.0)
    limits = [here.where(int(number)) for number in result.weak]
    every = result.moves
    for limit, row, side in here.touches():
        if abs(at.y[row]) < WEAK * max(1.0, float(np.max(np.abs(at.y)))):
            limits.append(limit)
            every = np.vstack([every, side * result.y[row]])
    for c, name in enumerate(names):
        moves = every[:, c] / (largest[c] or 1.0)
        sides = not np.any(moves > STILL), not np.any(moves < -STILL)
        valid[name] = sides
        if all(sides):
            continue
        which = list(dict.fromkeys(limits[number] for number in np.flatnonzero(np.abs(moves) > STILL)))
        what = ", ".join(which[:3]) + (f" and {len(which) - 3} more" if len(which) > 3 else "")
        holds = {(True, False): "smaller values only", (False, True): "larger values only", (False, False): "no side"}
        notes.append(f"{name}: {what} only just active, without a multiplier; the derivative holds for {holds[sides]}")
    return valid, notes
