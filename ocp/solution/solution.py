"""The result of a solve, successful or not: status, motion as interpolants of the scheme, costates, timings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.arrays import largest_of_unit
from ocp.numerics.evaluation import mapped
from ocp.numerics.rate_functions import rates
from ocp.problem.problem import Problem
from ocp.solution.accuracy import Accuracy
from ocp.solution.deferred import Deferred
from ocp.solution.structure import Structure
from ocp.transcription.grid import Grid
from ocp.transcription.packing import Multipliers
from ocp.transcription.schemes.scheme import Scheme

OUTSIDE = 1e-9  # times outside the motion by less than this share of the duration are rounding
GAUSS = np.polynomial.legendre.leggauss(4)


class Status(Enum):
    """How a solve ended; the value is the sentence shown to the user."""

    SOLVED = "solved to the requested tolerance"
    ACCEPTABLE = "solved to a looser tolerance only; tighten or rescale before trusting the last digits"
    INFEASIBLE = "no motion found that meets all constraints"
    UNBOUNDED = "the iterates diverge: the cost or the motion has no bound"
    LIMIT = "stopped at the limit of iterations or time; the last iterate is kept"
    STOPPED = "stopped by the user; the last iterate is kept"
    FAILED = "the solver failed; the last iterate is kept"


@dataclass(frozen=True)
class Timings:
    """Wall-clock seconds of a solve: of all its attempts, from every initial guess and on every grid."""

    setup: float  # everything else: transcription, derivatives of the graph, initial guesses, checks
    derivatives: float  # evaluation of cost, constraints and their derivatives
    solver: float  # the rest of the solve: linear algebra and line search
    total: float


@dataclass(frozen=True, eq=False)
class Solution:
    """A motion and how it was computed; x(t), u(t) and costate(t) are the interpolants of the scheme.

    Costates are the gradient of the optimal cost with respect to the state, lambda = dJ/dx, so that the Hamiltonian
    lambda . f + running is minus the weight of time on an optimal motion of free duration (-1 for minimum time).
    """

    status: Status
    message: str  # in words; IPOPT's own status is in `solver_status`
    solver_status: str  # verbatim
    duration: float  # [s]
    cost: float
    states: Array  # (N, m, nx) at the nodes of the scheme on every element
    controls: Array  # (N, c, nu) control unknowns of every element
    slopes: Array  # (N, e, nx) h dx/dt at the start of every element; e = 1 for Lobatto, else 0
    costates: Array  # (N, d, nx) at the collocation points
    free: Mapping[str, float]  # values of the parameters that were unknowns
    values: Mapping[str, float]  # value of every parameter in this motion
    timings: Timings
    iterations: int
    grid: Grid
    scheme: Scheme
    problem: Problem | None  # None if loaded from a file without it
    rung: str = "given guess"  # which initial guess led here
    log: Mapping[str, Sequence[float]] = field(default_factory=dict)  # per iteration: IPOPT's inf_pr, obj ...
    multipliers: Multipliers | None = None  # None if loaded from a file of version 1
    accuracy: Accuracy | None = None  # of a step of solve_to_accuracy; not saved, `estimate` computes its errors again
    structure: Structure | None = None  # switching structure of a polished solution

    @property
    def ok(self) -> bool:
        """Whether the solver met its tolerance."""
        return self.status is Status.SOLVED

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "message": self.message}

    def __repr__(self) -> str:
        return (
            f"Solution({self.status.name.lower()}, duration {self.duration:.9g} s, cost {self.cost:.9g}, "
            f"{self.iterations} iterations, {self.timings.total:.3g} s, {self.scheme!r}, {self.grid!r})"
        )

    @property
    def parameters(self) -> Array:
        """(np,) values of the parameters of the system, in the order of its symbols `system.p`.

        Raises:
            ValueError: the solution was loaded without its problem, which knows the order.
        """
        if self.problem is None:
            raise ValueError("parameters: this solution was loaded without its problem; use load(path, problem=...)")
        system = self.problem.system
        return np.array(system.values({name: self.values[name] for name in system.nominal if name in self.values}))

    @property
    def data(self) -> Array:
        """(N, m + e, nx) coefficients of the state polynomial of every element: states, then slopes."""
        return np.concatenate([self.states, self.slopes], axis=1)

    @property
    def nodes(self) -> Array:
        """(N + 1,) times of the ends of the elements [s]."""
        return np.asarray(self.duration * self.grid.ends)

    @property
    def collocation_times(self) -> Array:
        """(N, d) times of the collocation points [s]."""
        shares: Array = self.grid.ends[:-1, None] + self.grid.widths[:, None] * self.scheme.points
        times: Array = self.duration * shares
        return times

    @property
    def t(self) -> Array:
        """Times of all ends of elements and collocation points, increasing [s]."""
        return np.unique(np.concatenate([self.nodes, self.collocation_times.ravel()]))

    def x(self, t: Array | float) -> Array:
        """Return the state at times t [s] within the motion, shape (len(t), nx), or (nx,) for a scalar."""
        return self._evaluate(t, self.data, self.scheme.state_at)

    def rate(self, t: Array | float) -> Array:
        """Return dx/dt of the interpolant at times t [s], shape (len(t), nx), or (nx,) for a scalar."""
        return self._evaluate(t, self.data / self._seconds[:, None, None], self.scheme.slope_at)

    def u(self, t: Array | float) -> Array:
        """Return the control at times t [s], from the right where it jumps, shape (len(t), nu) or (nu,)."""
        return self._evaluate(t, self.controls, self.scheme.control_at)

    def costate(self, t: Array | float) -> Array:
        """Return lambda = dJ/dx at times t [s], shape (len(t), nx), or (nx,) for a scalar."""
        return self._evaluate(t, self.costates, self.scheme.costate_at)

    def signal(self, signal: str | ca.SX, t: Array | float) -> Array:
        """Return a signal of the system, or an expression in x, u, p, at times t.

        Args:
            signal: name of a signal ("q", "tau", ...; also "x", "u"), or an expression (m,).
            t: times [s] within the motion, (K,) or scalar.

        Returns:
            (K, m), or (m,) for a scalar.

        Raises:
            ValueError: the solution was loaded without its problem, or t lies outside the motion.
            KeyError: no such signal.
        """
        if isinstance(signal, str) and signal in ("x", "u"):
            return self.x(t) if signal == "x" else self.u(t)
        checks.instance("signal", signal, str | ca.SX, "the name of a signal or an expression")
        if self.problem is None:
            raise ValueError("signal: this solution was loaded without its problem; use load(path, problem=...)")
        system = self.problem.system
        expression = system[signal] if isinstance(signal, str) else signal
        system.check_symbols("signal", expression)
        times = self._times(t)
        function = ca.Function("signal", [system.x, system.u, system.p], [ca.densify(ca.vec(expression))])
        parameters = self.parameters[:, None]
        results = function.map(len(times))(self.x(times).T, self.u(times).T, np.tile(parameters, len(times)))
        result = np.array(results).T
        return result if np.ndim(t) else result[0]

    @property
    def error(self) -> Array:
        """(N,) relative local error of the dynamics on every element.

        e_k = max_i integral over the element of |dx_i/dt - f_i(x, u)| dt / s_i

        with s_i the largest |x_i|, at least a thousandth of the largest state with the same unit.

        The residual changes its sign at the collocation points; each interval between two of them is integrated by a
        Gauss quadrature of four points.

        Raises:
            ValueError: the solution was loaded without its problem.

        Source: J. T. Betts, Practical Methods for Optimal Control and Estimation Using Nonlinear Programming, 4.7.
        """
        if self.problem is None:
            raise ValueError("error: this solution was loaded without its problem; use load(path, problem=...)")
        system = self.problem.system
        edges = np.unique(np.concatenate([[0.0], self.scheme.points, [1.0]]))
        tau = (edges[:-1, None] + np.diff(edges)[:, None] * (GAUSS[0] + 1.0) / 2.0).ravel()
        shares = (np.diff(edges)[:, None] * GAUSS[1] / 2.0).ravel()
        t, x, rate, u = self.samples(tau)
        function = mapped(rates(system), len(t))
        p = self.parameters[:, None]
        missed = np.abs(rate - np.array(function(x.T, u.T, np.tile(p, len(t)))).T)
        each = missed.reshape(len(self.grid), len(tau), -1)
        widths = self.duration * self.grid.widths
        integral = np.einsum("ksa,s->ka", each, shares) * widths[:, None]
        largest = np.max(np.abs(x), axis=0)
        units = [label.unit for label in system.label("x", len(largest))]
        scale = np.maximum(largest, 1e-3 * largest_of_unit(largest, units))
        relative: Array = np.max(integral / np.where(scale > 0.0, scale, 1.0), axis=1)
        return relative

    def samples(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """Return the motion at points tau of every element; at 0 and 1 the values are those inside the element.

        Args:
            tau: (s,) points in [0, 1], shares of the element.

        Returns:
            t (N s,), x (N s, nx), dx/dt (N s, nx), u (N s, nu).
        """
        tau = checks.points("tau", tau, "points in [0, 1] of every element", 0.0, 1.0, least=1)
        widths = self.duration * self.grid.widths
        t = (self.nodes[:-1, None] + widths[:, None] * tau).ravel()
        x = np.einsum("sm,kma->ksa", self.scheme.state_at(tau), self.data)
        rate = np.einsum("sm,kma->ksa", self.scheme.slope_at(tau), self.data / self._seconds[:, None, None])
        u = np.einsum("sm,kma->ksa", self.scheme.control_at(tau), self.controls)
        return t, x.reshape(len(t), -1), rate.reshape(len(t), -1), u.reshape(len(t), -1)

    def locate(self, t: Array | float) -> tuple[Array, Array]:
        """Return the element of each time and the point tau in [0, 1] on it.

        Raises:
            ValueError: a time is not a number within the motion.
        """
        return self._position(self._times(t))

    def _position(self, t: Array) -> tuple[Array, Array]:
        share = np.clip(t / self.duration if self.duration > 0.0 else 0.0 * t, 0.0, 1.0)
        element = self.grid.locate(share)
        return element, (share - self.grid.ends[element]) / self.grid.widths[element]

    def _times(self, t: Array | float) -> Array:
        times = checks.real(t)
        if times is None or times.ndim > 1 or not times.size:
            raise checks.refused("t", t, "times in s within the motion, one or (K,)")
        slack = OUTSIDE * self.duration
        if not np.all((times >= -slack) & (times <= self.duration + slack)):
            raise ValueError(f"t: got {times.min()} .. {times.max()} s, the motion lasts from 0 to {self.duration} s")
        return np.atleast_1d(times)

    @property
    def _seconds(self) -> Array:
        """(N,) durations of the elements; one for a motion of zero duration, whose states are constant."""
        widths: Array = self.duration * self.grid.widths
        return widths if self.duration > 0.0 else np.ones(len(widths))

    def _evaluate(self, t: Array | float, values: Array, matrix_at: Callable[[Array], Array]) -> Array:
        element, tau = self._position(self._times(t))
        result: Array = np.einsum("km,kma->ka", matrix_at(tau), values[element])
        return result if np.ndim(t) else result[0]


Solution.message = Deferred("message")  # type: ignore[assignment] # warnings take a re-integration of the motion
