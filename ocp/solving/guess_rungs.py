"""Initial guesses by way of easier problems: the rungs of the ladder that `solve` climbs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.problem.constraints import Constraint, Where, along, simple
from ocp.problem.problem import Bolza, Fixed, Free, Problem
from ocp.problem.sequence import Sequence, parameter_values, phases_of
from ocp.solving.first_guesses import phase_guesses, smooth, straight_line
from ocp.solving.guess_conversion import AnySolution, as_guesses
from ocp.solving.nlp_solver import NlpSettings, limited
from ocp.solving.whole_turns import TURN, angles_without_limits
from ocp.transcription.grid import Grid
from ocp.transcription.guess import Guess

Values = Mapping[str, float] | None
EASIER_ITERATIONS, EASIER_SECONDS = 150, 10.0  # for each of the easier problems of a continuation in time


class Solvable(Protocol):
    """What the ladder needs of a prepared NLP (`ocp.Prepared` is one): attempts, and related problems prepared anew."""

    @property
    def problem(self) -> Problem | Sequence:
        """The problem."""
        ...

    @property
    def grid(self) -> Grid:
        """The grid of every phase."""
        ...

    @property
    def settings(self) -> NlpSettings:
        """Settings of the solver."""
        ...

    @property
    def setup(self) -> float:
        """Seconds that the preparation took."""
        ...

    @property
    def first(self) -> tuple[object, object, list[Guess]] | None:
        """Problem, parameter values and the smooth guess made for them while preparing; None if none was made."""
        ...

    def attempt(
        self, guesses: list[Guess], values: list[list[float]], warm: bool = ..., rung: str = ...
    ) -> AnySolution:
        """Solve once from one guess for each phase."""
        ...

    def on(self, problem: Problem | Sequence, grid: Grid, settings: NlpSettings, values: Values) -> Solvable:
        """Return another problem prepared on another grid, with the same scheme."""
        ...

    def __call__(self, guess: Any = ..., values: Values = ..., problem: Problem | Sequence | None = ...) -> AnySolution:
        """Solve from a guess or a ladder of rungs."""
        ...


class Rung(Protocol):
    """Something that makes an initial guess for a prepared NLP."""

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return one guess for each phase and whether it is near a solution; None if there is none to give."""
        ...


@dataclass(frozen=True)
class Smooth:
    """A smooth motion between the ends, states and controls by the system's own equations (`ocp.smooth`)."""

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool]:
        """Return the guess of every phase; the scaling may have needed it already."""
        numbers = parameter_values(prepared.problem, values)
        if prepared.first is not None and prepared.first[0] is prepared.problem and prepared.first[1] == numbers:
            return prepared.first[2], False
        return phase_guesses(prepared.problem, numbers, smooth), False


@dataclass(frozen=True)
class StraightLine:
    """The straight line between the ends, controls that balance the system (`ocp.straight_line`)."""

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool]:
        """Return the guess of every phase."""
        return phase_guesses(prepared.problem, parameter_values(prepared.problem, values), straight_line), False


@dataclass(frozen=True)
class CoarseGrid:
    """The solution on a grid with `factor` times fewer elements, at least three."""

    factor: int = 5

    def __post_init__(self) -> None:
        checks.whole("CoarseGrid: factor", self.factor, 2)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the coarse solution, or None if it fails."""
        ends = prepared.grid.ends
        nodes = np.linspace(0, len(ends) - 1, max(3, (len(ends) - 1) // self.factor) + 1).round().astype(int)
        if len(nodes) >= len(ends):
            return None
        coarse = prepared.on(prepared.problem, Grid(ends[nodes]), prepared.settings, values)
        result = coarse((Smooth(), StraightLine()), values)
        return (as_guesses(prepared.problem, result), True) if result.ok else None


@dataclass(frozen=True)
class WiderLimits:
    """Homotopy: limits of the controls several times as wide, then narrowed, each solved from the last."""

    factors: tuple[float, ...] = (8.0, 3.0, 1.5)

    def __post_init__(self) -> None:
        wanted = "numbers >= 1, the widest first"
        checks.instance("WiderLimits: factors", self.factors, tuple | list, wanted)
        if not np.all(checks.column("WiderLimits: factors", self.factors, expected=wanted) >= 1.0):
            raise checks.refused("WiderLimits: factors", self.factors, wanted)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the solution with the last wider limits, or None if none of them is solved."""
        result: Any = None
        for factor in self.factors:
            widened = _with_limits(prepared.problem, factor)
            start: Any = result if result is not None and result.ok else (Smooth(), StraightLine())
            again = prepared(start, values, widened)
            result = again if again.ok else result
        return (as_guesses(prepared.problem, result), True) if result is not None and result.ok else None


@dataclass(frozen=True)
class LongerDuration:
    """Solution with a lower limit of the free durations, as a share of their guesses; the limit is then released.

    For motions whose duration collapses to zero, or whose iterates diverge.
    """

    share: float = 0.5

    def __post_init__(self) -> None:
        checks.number("LongerDuration: share", self.share, "a number > 0", above=0.0)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the solution with the limit, or None if it fails or no duration is free."""
        phases = [_slower(phase, self.share) for phase in phases_of(prepared.problem)]
        if all(new is old for new, old in zip(phases, phases_of(prepared.problem), strict=True)):
            return None
        sequence = prepared.problem
        longer = Sequence(phases, sequence.links) if isinstance(sequence, Sequence) else phases[0]
        result = prepared((Smooth(), StraightLine()), values, longer)
        return (as_guesses(prepared.problem, result), True) if result.ok else None


@dataclass(frozen=True)
class OneTurn:
    """Solution with angles near zero; their bounds are then released.

    For controls without limits in which the equations have the period 2 pi, such as a direction: every motion has
    them within half a turn of zero, but iterates may wander by many turns.

    Args:
        turns: largest absolute angle, more than half a turn, so that no optimum needs to touch the bounds.
    """

    turns: float = 0.75

    def __post_init__(self) -> None:
        checks.number("OneTurn: turns", self.turns, "a number > 0.5", above=0.5)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the solution with the bounds, or None if it fails or no control is such an angle."""
        old = phases_of(prepared.problem)
        numbers = parameter_values(prepared.problem, values)
        phases = [self._bounded(phase, own) for phase, own in zip(old, numbers, strict=True)]
        if all(new is before for new, before in zip(phases, old, strict=True)):
            return None
        sequence = prepared.problem
        narrow = Sequence(phases, sequence.links, sequence.closing) if isinstance(sequence, Sequence) else phases[0]
        result = prepared.on(narrow, prepared.grid, prepared.settings, values)((Smooth(), StraightLine()), values)
        return (as_guesses(prepared.problem, result), True) if result.ok else None

    def _bounded(self, problem: Problem, values: list[float]) -> Problem:
        most = self.turns * TURN
        bounds = [along(problem.system.u[i], -most, most) for i in angles_without_limits(problem, values)]
        return replace(problem, subject_to=(*problem.subject_to, *bounds)) if bounds else problem


def _slower(problem: Problem, share: float) -> Problem:
    horizon = problem.horizon
    if not isinstance(horizon, Free):
        return problem
    lower = min(max(horizon.lower, share * horizon.guess), horizon.upper)
    return replace(problem, horizon=replace(horizon, lower=lower)) if lower > horizon.lower else problem


@dataclass(frozen=True)
class LeastEffort:
    """Continuation in time: the motion of least effort in a given duration, for problems with a free one.

    Minimises the integral of sum_i (u_i / limit_i)^2 in `factors` times the duration of the smooth motion, until one is
    solved. That problem is smoother than one of minimum time, and a duration that is too short is no obstacle.

    Args:
        factors: increasing.
    """

    factors: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)

    def __post_init__(self) -> None:
        wanted = "increasing numbers > 0"
        checks.instance("LeastEffort: factors", self.factors, tuple | list, wanted)
        factors = checks.column("LeastEffort: factors", self.factors, expected=wanted)
        if not (np.all(factors > 0.0) and np.all(np.diff(factors) > 0.0)):
            raise checks.refused("LeastEffort: factors", self.factors, wanted)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the motion of least effort, or None if none is solved or the duration is fixed."""
        problem = prepared.problem
        if not isinstance(problem, Problem) or not isinstance(problem.horizon, Free) or not problem.system.u.numel():
            return None
        low, high = problem.limits(Where.ALONG, problem.system.u)
        largest = np.maximum(np.abs(low), np.abs(high))
        scale = np.where(np.isfinite(largest) & (largest > 0.0), largest, 1.0)
        effort = Bolza(running=ca.sumsqr(problem.system.u / ca.DM(scale)))
        shortest = smooth(problem, parameter_values(problem, values)[0]).duration
        durations = [factor * shortest for factor in self.factors]
        allowed = [d for d in durations if problem.horizon.lower <= d <= problem.horizon.upper]
        brief, easier = limited(prepared.settings, EASIER_ITERATIONS, EASIER_SECONDS), None
        for duration in allowed:
            eased = replace(problem, horizon=Fixed(duration), minimise=effort)
            easier = easier or prepared.on(eased, prepared.grid, brief, values)
            result = easier((Smooth(),), values, eased)
            if result.ok:
                return as_guesses(problem, result), True
        return None


@dataclass(frozen=True)
class ParameterPath:
    """Homotopy: a parameter runs from a value that is easy to its own, each step solved from the last.

    Args:
        name: of the parameter, such as "gravity.g"; it must be one that stays a symbol.
        easy: value to begin with.
        steps: number of steps.
    """

    name: str
    easy: float = 0.0
    steps: int = 4

    def __post_init__(self) -> None:
        checks.text("ParameterPath: name", self.name, "the name of a parameter")
        checks.number("ParameterPath: easy", self.easy)
        checks.whole("ParameterPath: steps", self.steps, 1)

    def __call__(self, prepared: Solvable, values: Values) -> tuple[list[Guess], bool] | None:
        """Return the solution one step before the parameter's own value, or None if a step fails."""
        own = {name: value for phase in phases_of(prepared.problem) for name, value in phase.system.nominal.items()}
        if self.name not in own:
            raise ValueError(f"ParameterPath: no parameter {self.name!r}; there are {', '.join(own) or 'none'}")
        target = float((values or {}).get(self.name, own[self.name]))
        result: Any = None
        for step in range(self.steps):
            value = self.easy + (target - self.easy) * step / self.steps
            result = prepared(result or (Smooth(), StraightLine()), {**(values or {}), self.name: value})
            if not result.ok:
                return None
        return as_guesses(prepared.problem, result), True


def _with_limits(problem: Problem | Sequence, factor: float) -> Problem | Sequence:
    if isinstance(problem, Sequence):
        return Sequence([_widened(phase, factor) for phase in problem.problems], problem.links)
    return _widened(problem, factor)


def _widened(problem: Problem, factor: float) -> Problem:
    def wider(constraint: Constraint) -> Constraint:
        if constraint.where is not Where.ALONG or not simple(constraint, problem.system.u):
            return constraint
        middle, low, high = np.zeros(len(constraint.lower)), constraint.lower, constraint.upper
        both = np.isfinite(low) & np.isfinite(high)
        middle[both] = (low[both] + high[both]) / 2.0
        return replace(constraint, lower=middle + factor * (low - middle), upper=middle + factor * (high - middle))

    return replace(problem, subject_to=tuple(wider(c) for c in problem.subject_to))
