"""The motion in a solution of an optimal-control problem, by the attributes of the solution only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import Label, System

# dq/dt of the interpolant may differ from v at collocation points by this share; more means that the states are those
# of another system.
FOREIGN = 1e-4
INSIDE = 1e-9  # share of an element by which its last collocation point is moved inside


class Recorded(Protocol):
    """A solution, as far as its motion needs it."""

    @property
    def duration(self) -> float:
        """[s]."""

    @property
    def problem(self) -> Any:
        """The problem that was solved, with its `system`; None if it is not known."""

    @property
    def values(self) -> Mapping[str, float]:
        """Value of every parameter."""

    @property
    def nodes(self) -> Array:
        """(N + 1,) ends of the elements [s]."""

    @property
    def collocation_times(self) -> Array:
        """(N, d) [s]."""

    def x(self, t: Array) -> Array:
        """(K, nx) states."""

    def rate(self, t: Array) -> Array:
        """(K, nx) their rates."""


@dataclass(frozen=True, eq=False)
class SolutionCurve:
    """q = q(x), v = v(x), a = (dv/dx) x' along the interpolant of a solution."""

    solution: Recorded
    functions: tuple[ca.Function, ...]  # of (x, x', p)
    parameters: Array
    labels: tuple[Label, ...]

    @classmethod
    def of(cls, solution: Recorded, system: System | None) -> SolutionCurve:
        """Form the functions and check that the states are those of the system.

        Raises:
            ValueError: no system, one without q and v, or one whose v is not dq/dt of the solution.
        """
        checks.instance("system", system, System | None, "a System, or None for that of the solution")
        if not all(hasattr(solution, name) for name in ("x", "rate", "duration", "nodes", "values")):
            raise TypeError(f"solution: got {checks.shown(solution)}, expected a Solution")
        if system is None:
            if getattr(solution, "problem", None) is None:
                raise ValueError("the solution was loaded without its problem; give the system whose states it holds")
            system = solution.problem.system
        x, p = system.x, system.p
        states = solution.x(np.zeros(1)).shape[1]
        if states != x.numel():
            raise ValueError(f"the solution has {states} states, the system has {x.numel()}")
        rate = ca.SX.sym("rate", x.numel())
        try:
            q, v = system["q"], system["v"]
        except KeyError as error:
            raise ValueError(f"the system has no motion: {error.args[0]}") from None
        if ca.depends_on(ca.vertcat(q, v), system.u):
            raise ValueError("the velocities depend on the control, so that there are no accelerations")
        outputs = (q, v, ca.jtimes(v, x, rate), ca.jtimes(q, x, rate))
        functions = tuple(ca.Function("derivative", [x, rate, p], [ca.densify(output)]) for output in outputs)
        parameters = np.array([solution.values.get(name, value) for name, value in system.nominal.items()])
        curve = cls(solution, functions[:3], parameters, system.label("q", q.numel()))
        times = curve.times()
        inputs = solution.x(times), solution.rate(times), parameters
        (velocity,), (slope,) = evaluate(functions[1], *inputs), evaluate(functions[3], *inputs)
        if np.max(np.abs(velocity - slope)) > FOREIGN * (1e-3 + np.max(np.abs(slope))):
            raise ValueError(
                "the states of the solution are not those of this system: its v is not dq/dt; give the machine, form "
                "and frame it was solved with"
            )
        return curve

    def times(self) -> Array:
        """Return the collocation points, those at the end of an element moved inside."""
        widths = np.diff(self.solution.nodes)[:, None]
        return np.unique(np.minimum(self.solution.collocation_times, self.solution.nodes[1:, None] - INSIDE * widths))

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        if order >= len(self.functions):
            raise ValueError("the motion of a solution has no jerk: its accelerations jump with the control")
        return evaluate(self.functions[order], self.solution.x(t), self.solution.rate(t), self.parameters)[0]


@dataclass(frozen=True, eq=False)
class JoinedCurve:
    """The motions of several solutions, one after the other; at a joint the values are those of the later one."""

    curves: tuple[SolutionCurve, ...]
    starts: Array  # (m + 1,) at which each begins, and the end of the last [s]

    @classmethod
    def of(cls, phases: Sequence[Recorded], system: System | None) -> JoinedCurve:
        """Join the phases of a solution; see `SolutionCurve.of`."""
        curves = tuple(SolutionCurve.of(phase, system) for phase in phases)
        return cls(curves, np.concatenate([[0.0], np.cumsum([phase.duration for phase in phases])]))

    @property
    def labels(self) -> tuple[Label, ...]:
        """Name and unit of every coordinate."""
        return self.curves[0].labels

    @property
    def nodes(self) -> Array:
        """Ends of all elements [s]."""
        shifted = [start + curve.solution.nodes for start, curve in zip(self.starts, self.curves, strict=False)]
        return np.unique(np.concatenate(shifted))

    def times(self) -> Array:
        """Return the collocation points of all phases, those at the end of an element moved inside."""
        shifted = [start + curve.times() for start, curve in zip(self.starts, self.curves, strict=False)]
        return np.unique(np.concatenate(shifted))

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        phase = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.curves) - 1)
        result = np.empty((len(t), len(self.labels)))
        for k, curve in enumerate(self.curves):
            chosen = phase == k
            if np.any(chosen):
                since = np.clip(t[chosen] - self.starts[k], 0.0, curve.solution.duration)
                result[chosen] = curve(since, order)
        return result
