"""Derivatives of states, controls and signals of a motion with respect to one number, at a fixed time or share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.polynomials import slope_matrix
from ocp.numerics.rate_functions import slopes
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution


class Held(Enum):
    """What is held fixed when a signal at time t of a motion is differentiated."""

    SHARE = "share"  # the share t/T of the duration
    TIME = "time"  # the time t
    ARC = "arc"  # the share of the arc between two switches, which move; the share t/T if not polished


@dataclass(frozen=True, eq=False)
class Variation:
    """Derivative of a motion with respect to one number.

    Args:
        states, controls: (N, m, nx), (N, c, nu) derivatives of the unknowns at fixed tau of every element.
        seconds: (N,) derivatives of the durations of the elements [s/unit].
        p: (np,) derivatives of the parameters.
    """

    states: Array
    controls: Array
    seconds: Array
    p: Array

    @property
    def duration(self) -> float:
        """Derivative of the duration [s/unit]."""
        return float(self.seconds.sum())

    def at(self, solution: Solution, problem: Problem, t: Array, held: Held) -> tuple[Array, Array]:
        """Return the derivatives of state and control, (K, nx), (K, nu).

        Args:
            solution: that was differentiated.
            problem: that it solves.
            t: (K,) times [s].
            held: what is held fixed.
        """
        scheme = solution.scheme
        element, tau = solution.locate(t)
        widths = (solution.duration * solution.grid.widths)[element]
        data = np.concatenate([self.states, self._slopes(solution, problem)], axis=1)
        x = np.einsum("km,kma->ka", scheme.state_at(tau), data[element])
        u = np.einsum("km,kma->ka", scheme.control_at(tau), self.controls[element])
        drift = (np.cumsum(self.seconds) - self.seconds)[element] + tau * self.seconds[element]
        wanted = {Held.TIME: 0.0 * t, Held.SHARE: t / solution.duration * self.duration, Held.ARC: drift}[held]
        late = ((wanted - drift) / widths)[:, None]
        if np.any(late):
            x += late * np.einsum("km,kma->ka", scheme.slope_at(tau), solution.data[element])
            bend = slope_matrix(scheme.control_nodes, tau)
            u += late * np.einsum("km,kma->ka", bend, solution.controls[element])
        return x, u

    def signal(self, solution: Solution, problem: Problem, expression: ca.SX, t: Array, held: Held) -> Array:
        """Return the derivative (K, m) of an expression in x, u, p; arguments as for `at`."""
        system = problem.system
        known = [system.x, system.u, system.p]
        changes = [ca.SX.sym("d", part.numel()) for part in known]
        value = ca.densify(ca.vec(expression))
        change = ca.jtimes(value, ca.vertcat(*known), ca.vertcat(*changes))
        function = ca.Function("change", [*known, *changes], [ca.densify(change)]).map(len(t))
        p = solution.parameters
        fixed = (np.tile(column[:, None], len(t)) for column in (p, self.p))
        x, u = self.at(solution, problem, t, held)
        values, derivative = fixed
        return np.array(function(solution.x(t).T, solution.u(t).T, values, x.T, u.T, derivative)).T

    def _slopes(self, solution: Solution, problem: Problem) -> Array:
        """Return the derivative of h dx/dt at the start of every element, where it defines the state."""
        if not solution.scheme.slope_at_start:
            return np.zeros((len(self.states), 0, self.states.shape[2]))
        system, count = problem.system, len(self.states)
        first = solution.scheme.control_at(np.zeros(1))[0]
        x, u = solution.states[:, 0], np.einsum("m,kma->ka", first, solution.controls)
        p = solution.parameters
        by_p = ca.Function("by_p", [system.x, system.u, system.p], [ca.densify(ca.jacobian(system.rate, system.p))])
        results = []
        widths = solution.duration * solution.grid.widths
        for k in range(count):
            rate, by_x, by_u = (np.array(part) for part in slopes(system)(x[k], u[k], p))
            change = by_x @ self.states[k, 0] + by_u @ (first @ self.controls[k])
            change += np.array(by_p(x[k], u[k], p)).reshape(len(change), -1) @ self.p
            results.append(self.seconds[k] * rate.ravel() + widths[k] * change)
        return np.array(results)[:, None, :]
