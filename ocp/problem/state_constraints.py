"""State constraints along the motion, with the time derivatives up to the first one that a control influences."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Problem
from ocp.system import Label

HIGHEST = 4  # order up to which derivatives are formed


@dataclass(frozen=True, eq=False)
class StateLimit:
    """lower <= c(x, u, p) <= upper along the motion, and c, c', ..., c^(r), the first derivative that depends on u.

    Args:
        constraint: number of the constraint in the problem.
        component: of it.
        chain: (r + 1) expressions; r is the order of the limit, 0 for one that depends on u itself.
        lower, upper: limits.
        label: what it is called.
        state: number of the state if the limit is one of a single state, else -1.
    """

    constraint: int
    component: int
    chain: tuple[ca.SX, ...]
    lower: float
    upper: float
    label: Label
    state: int

    @property
    def order(self) -> int:
        """Number of time derivatives until a control appears."""
        return len(self.chain) - 1

    @property
    def range(self) -> float:
        """Distance of both limits, or the size of the only one, or one."""
        both = np.array([self.lower, self.upper])
        finite = both[np.isfinite(both)]
        return float(np.ptp(finite) or np.max(np.abs(finite)) or 1.0)

    def at(self, side: int) -> float:
        """Return the lower (side = -1) or upper (side = 1) limit."""
        return self.lower if side < 0 else self.upper


def state_limits(problem: Problem) -> tuple[StateLimit, ...]:
    """Return the limits along the motion that are no limits of single controls or parameters.

    Args:
        problem: a Problem; limits that no control reaches within four derivatives are left out, and
            equations, which hold along the whole motion (`path_equalities`).

    Source: A. E. Bryson, W. F. Denham, S. E. Dreyfus, Optimal programming problems with inequality constraints I,
        AIAA Journal 1, 1963 (order of a state constraint).
    """
    system = problem.system
    known = ca.vertcat(system.u, system.p)
    results = []
    for i, constraint in enumerate(problem.subject_to):
        if constraint.where is not Where.ALONG:
            continue
        own = {c for _, c in simple(constraint, known)}
        states = {c: index for index, c in simple(constraint, system.x)}
        labels = problem.labels(constraint)
        for c in range(constraint.expression.numel()):
            lower, upper = float(constraint.lower[c]), float(constraint.upper[c])
            if c in own or lower == upper or not (np.isfinite(lower) or np.isfinite(upper)):
                continue
            chain = [constraint.expression[c]]
            while not ca.depends_on(chain[-1], system.u) and len(chain) <= HIGHEST:
                chain.append(ca.jtimes(chain[-1], system.x, system.rate))
            if ca.depends_on(chain[-1], system.u):
                results.append(StateLimit(i, c, tuple(chain), lower, upper, labels[c], states.get(c, -1)))
    return tuple(results)
