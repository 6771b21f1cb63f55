"""The motion in a solution of an optimal-control problem, without knowing the solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import Label, System

# dq/dt of the interpolant may differ from v at collocation points by this share before the states count as foreign.
FOREIGN = 1e-4
INSIDE = 1e-9  # share of an element by which its last collocation point is moved inside


class Recorded(Protocol):
    """What a solution must offer."""

    @property
    def duration(self) -> float:
        """[s]."""

    @property
    def problem(self) -> Any:
        """What was solved, with its `system`; None if that is not known."""

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
