"""Structure of Hamiltonian systems in canonical coordinates, and methods that keep it.

A method is symplectic if its step x -> y satisfies (dy/dx)' W (dy/dx) = W for every Hamiltonian system with a constant
skew matrix W, dx/dt = W^-1 grad H(t, x); with x = [q; p] and W = -[0 1; -1 0] these are the canonical equations.
Then the energy of an autonomous system stays within O(h^r) of its value over times exponentially long in 1/h, r the
order, as long as all steps are equal (Hairer, Lubich, Wanner, Geometric Numerical Integration, IX.8).

The Gauss methods (`ocp.integrators.tableaux.gauss`) are symplectic for every such system, separable or not, with or
without a potential, and for given forces u(t) along the coordinates, whose potential -u'q belongs to H. They are not
symplectic where the momenta belong to a frame w = F(q) dq/dt with variable F, because the structure matrix then depends
on the state; with constant F they are, since Runge-Kutta methods commute with linear maps. Forces that depend on the
velocity (friction, feedback) destroy the symplectic structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.integrators.contracts import symbols
from ocp.numerics.arrays import probes
from ocp.numerics.newton import root
from ocp.system import System

SAMPLES = 8
ROUNDING = 1e-9  # share of the Jacobian up to which an asymmetry is rounding


def canonical_matrix(n: int) -> Array:
    """Return W = [0 1; -1 0], shape (2n, 2n)."""
    zero, one = np.zeros((n, n)), np.eye(n)
    return np.block([[zero, one], [-one, zero]])


def asymmetry(system: System, x: Sequence[float] | Array, u: Sequence[float] | Array, p: Sequence[float]) -> float:
    """Return how far a system is from canonical equations at one state: 0 if x = [q; p] and x' = W^-1 grad H.

    |W df/dx - (W df/dx)'| / |W df/dx|, the integrability condition of a Hamiltonian.

    Args:
        system: x' = f(x, u, p) with an even number of states.
        x: (nx,) state.
        u: (nu,) control.
        p: parameter values.

    Raises:
        ValueError: an odd number of states.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, VI.2, theorem 2.6.
    """
    nx = system.x.numel()
    if nx % 2:
        raise ValueError(f"asymmetry: the system has {nx} states, canonical equations have as many q as p")
    slope = ca.Function("slope", [system.x, system.u, system.p], [ca.densify(ca.jacobian(system.rate, system.x))])
    matrix = canonical_matrix(nx // 2) @ np.array(slope(x, u, p))
    return float(np.linalg.norm(matrix - matrix.T) / max(float(np.linalg.norm(matrix)), 1e-300))


@dataclass(frozen=True)
class StoermerVerlet:
    """The Stoermer-Verlet method for x = [q; p] and any Hamiltonian H(q, p): order 2, symplectic, symmetric.

    p_1/2 = p - h/2 H_q(q, p_1/2),  q_next = q + h/2 (H_p(q, p_1/2) + H_p(q_next, p_1/2)),
    p_next = p_1/2 - h/2 H_q(q_next, p_1/2)

    Implicit in p_1/2 and then in q_next unless H = T(p) + U(q). A control is taken at the middle of the step.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, VI.3, (3.4).
    """

    @property
    def order(self) -> int:
        """Order of convergence."""
        return 2

    @property
    def nodes(self) -> Array:
        """(1,) the middle of the step."""
        return np.array([0.5])

    @property
    def error_order(self) -> int:
        """No error estimate."""
        return 0

    def step(self, system: System) -> ca.Function:
        """Return the function of one step; see `ocp.integrators.contracts.Rule`.

        Raises:
            ValueError: the equations are not canonical in x = [q; p].
        """
        self._check(system)
        n = system.x.numel() // 2
        x, h, u, p = symbols(system, 1)
        f = ca.Function("rate", [system.x, system.u, system.p], [ca.densify(part) for part in _halves(system)])
        new, middle = ca.SX.sym("q_next", n), ca.SX.sym("p_half", n)
        half = root(middle, middle - x[n:] - h / 2 * f(ca.vertcat(x[:n], middle), u, p)[1], [x, h, u, p])
        shift = h / 2 * (f(ca.vertcat(x[:n], middle), u, p)[0] + f(ca.vertcat(new, middle), u, p)[0])
        drift = root(new, new - x[:n] - shift, [x, h, u, p, middle])
        given = half.mx_in()[1:]
        velocity, force = f(given[0], given[2], given[3])
        pm, change1, count1 = half(given[0][n:] + given[1] / 2 * force, *given)
        qm, change2, count2 = drift(given[0][:n] + given[1] * velocity, *given, pm)
        last = pm + given[1] / 2 * f(ca.vertcat(qm, pm), given[2], given[3])[1]
        evaluations = 2 + count1 + 2 * count2
        change = ca.fmax(change1, change2)
        return ca.Function("step", given, [ca.vertcat(qm, last), ca.MX(2 * n, 0), change, evaluations])

    def error(self, norms: Array) -> float:
        """Raise, as there is no estimate."""
        raise NotImplementedError

    def _check(self, system: System) -> None:
        """Raise ValueError unless the equations are canonical at sampled states."""
        p = system.values()
        states, controls = probes((SAMPLES, system.x.numel()), 0.3, 1.7), probes((SAMPLES, system.u.numel()), -1.0, 1.0)
        results = [asymmetry(system, x, u, p) for x, u in zip(states, controls, strict=True)]
        worst = max((value for value in results if np.isfinite(value)), default=0.0)
        if worst > ROUNDING:
            raise ValueError(
                f"StoermerVerlet: W df/dx is asymmetric by {worst:.1e} of its size, so the state is not [q; p] of a "
                "Hamiltonian; use the canonical form in a coordinate frame without friction, or another method"
            )


def _halves(system: System) -> tuple[ca.SX, ca.SX]:
    n = system.x.numel() // 2
    return system.rate[:n], system.rate[n:]
