"""Pontryagin's Hamiltonian of a problem as a symbolic expression."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca

from ocp.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Hamiltonian:
    """H(x, u, p, lambda) = lambda . f(x, u, p) + running(x, u, p)."""

    value: ca.SX  # (1,) H [cost/s]
    terms: ca.SX  # (1,) sum of |lambda_i f_i| and |running|: what rounding and errors of H are compared with [cost/s]
    costate: ca.SX  # (nx,) symbols lambda [cost / unit of the state]
    arguments: tuple[ca.SX, ca.SX, ca.SX, ca.SX]  # x, u, p, lambda

    @property
    def slope(self) -> ca.SX:
        """(nu,) dH/du, dense; without limits on expressions these are the switching functions."""
        return ca.densify(ca.gradient(self.value, self.arguments[1]))

    @property
    def curvature(self) -> ca.SX:
        """(nu, nu) d^2H/du^2."""
        return ca.hessian(self.value, self.arguments[1])[0]


@functools.lru_cache(maxsize=32)
def hamiltonian_of(problem: Problem) -> Hamiltonian:
    """Return the Hamiltonian of a problem.

    Args:
        problem: one phase.

    Source: Pontryagin et al., The Mathematical Theory of Optimal Processes.
    """
    system, running = problem.system, problem.minimise.running
    costate = ca.SX.sym("lambda", system.x.numel())
    value = ca.dot(costate, system.rate) + running
    terms = ca.dot(ca.fabs(costate), ca.fabs(system.rate)) + ca.fabs(running)
    return Hamiltonian(value, terms, costate, (system.x, system.u, system.p, costate))
