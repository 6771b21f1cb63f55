"""Tolerances in the user's own terms: cost, share of the cost, seconds of the duration, a signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.solution.accuracy import Errors
from ocp.solution.solution import Solution


class Tolerance(Protocol):
    """An allowed error of a solution, in a unit of the user's choice."""

    @property
    def tol(self) -> float:
        """The amount, in `unit`."""
        ...

    @property
    def unit(self) -> str:
        """Of the amount."""
        ...

    @property
    def what(self) -> str:
        """What is measured: the words used in messages."""
        ...

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the estimated error in `unit`."""
        ...

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the part of every element (N,) in the error, in `unit`."""
        ...


@dataclass(frozen=True)
class Cost:
    """The cost, in its own unit; seconds for minimum time."""

    tol: float
    unit: str = "(unit of the cost)"
    what: str = "optimal cost"

    def __post_init__(self) -> None:
        _positive(self)

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the error of the cost."""
        _check(solution, errors)
        return errors.cost

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the part of every element (N,) in it."""
        _check(solution, errors)
        return errors.elements


@dataclass(frozen=True)
class Share:
    """The cost, as a share of it; of 1/1000 of the change of the cost by a scale of every variable if that is more."""

    tol: float
    unit: str = "share"
    what: str = "optimal cost"

    def __post_init__(self) -> None:
        _positive(self)

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the error as a share of the cost."""
        _check(solution, errors)
        return errors.cost / errors.cost_scale

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the part of every element (N,) in it."""
        _check(solution, errors)
        return np.asarray(errors.elements / errors.cost_scale)


@dataclass(frozen=True)
class Seconds:
    """The optimal duration [s]."""

    tol: float
    unit: str = "s"
    what: str = "optimal duration"

    def __post_init__(self) -> None:
        _positive(self)

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the error of the duration [s]."""
        _check(solution, errors)
        return errors.duration

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the part of every element (N,) in it."""
        _check(solution, errors)
        return np.asarray(errors.elements * (errors.duration / max(errors.cost, 1e-300)))


@dataclass(frozen=True)
class Signal:
    """A signal of states: its drift, the distance between the solution and the motion re-integrated with its controls.

    Args:
        name: of a signal that depends on states only, such as "q"; its largest component counts.
        tol: in the unit of the signal.
        unit: of the signal, for messages.
    """

    name: str
    tol: float
    unit: str = ""

    def __post_init__(self) -> None:
        checks.text("Signal: name", self.name, "the name of a signal of states")
        _positive(self)

    @property
    def what(self) -> str:
        """What is measured."""
        return f"{self.name} along the motion"

    def error(self, solution: Solution, errors: Errors) -> float:
        """Return the largest distance of the signal at ends of elements."""
        _check(solution, errors)
        if not np.isfinite(errors.cost):
            return float("inf")
        return float(np.max(np.abs(self._projected(solution, errors.drift[1:]))))

    def parts(self, solution: Solution, errors: Errors) -> Array:
        """Return the local errors of the elements (N,)."""
        _check(solution, errors)
        return np.asarray(np.max(np.abs(self._projected(solution, errors.local)), axis=1))

    def _projected(self, solution: Solution, apart: Array) -> Array:
        problem = solution.problem
        if problem is None:
            raise ValueError("Signal: this solution was loaded without its problem; use load(path, problem=...)")
        system = problem.system
        expression = ca.vec(system[self.name] if self.name != "x" else system.x)
        if ca.depends_on(expression, system.u):
            raise ValueError(f"Signal: {self.name!r} depends on the controls; name a signal of states")
        slope = ca.densify(ca.jacobian(expression, system.x))
        function = ca.Function("slope", [system.x, system.p], [slope]).map(len(apart))
        p = solution.parameters[:, None]
        slopes = np.array(function(solution.states[:, -1].T, np.tile(p, len(apart))))
        return np.asarray(np.einsum("akb,kb->ka", slopes.reshape(expression.numel(), len(apart), -1), apart))


def _positive(tolerance: Tolerance) -> None:
    called = type(tolerance).__name__
    checks.number(f"{called}: tol", tolerance.tol, "a number > 0", above=0.0)
    checks.text(f"{called}: unit", tolerance.unit)
    checks.text(f"{called}: what", tolerance.what)


def _check(solution: Solution, errors: Errors) -> None:
    checks.instance("solution", solution, Solution, "a Solution")
    checks.instance("errors", errors, Errors, "its Errors, as estimate(solution) returns them")
