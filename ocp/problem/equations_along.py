"""Equations along the whole motion, with the time derivatives up to the first one that a control influences."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca

from ocp.problem.constraints import Where, row_components
from ocp.problem.problem import Problem

HIGHEST = 4  # order up to which derivatives are formed


@dataclass(frozen=True, eq=False)
class PathEquality:
    """An equation c(x, u, p) = value along the motion, as residual r = c - value with r, r', ..., r^(k).

    Args:
        constraint: index of the constraint in the problem.
        component: of it.
        chain: (k + 1) expressions; only the last one depends on the control.
    """

    constraint: int
    component: int
    chain: tuple[ca.SX, ...]

    @property
    def order(self) -> int:
        """Number of time derivatives until a control appears; 0 for an equation that contains one."""
        return len(self.chain) - 1


@functools.lru_cache(maxsize=64)
def path_equalities(problem: Problem) -> tuple[PathEquality, ...]:
    """Return the equations along the motion on expressions of states and controls.

    Args:
        problem: a Problem; equations on single symbols are bounds, and equations that no control influences within
            four derivatives are left out.

    Source: U. M. Ascher, L. R. Petzold, Computer Methods for Ordinary Differential Equations and Differential-
        Algebraic Equations, 9.2 (index reduction).
    """
    system, results = problem.system, []
    for i, constraint in enumerate(problem.subject_to):
        if constraint.where is not Where.ALONG:
            continue
        for c in row_components(constraint, system):
            if constraint.lower[c] != constraint.upper[c]:
                continue
            chain = [constraint.expression[c] - float(constraint.lower[c])]
            while not ca.depends_on(chain[-1], system.u) and len(chain) <= HIGHEST:
                chain.append(ca.jtimes(chain[-1], system.x, system.rate))
            if ca.depends_on(chain[-1], system.u):
                results.append(PathEquality(i, c, tuple(chain)))
    return tuple(results)
