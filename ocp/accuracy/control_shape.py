"""The shape of the control on the elements of a refined grid: constant where controls switch, polynomial elsewhere."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.pointwise import controls_without_bounds, point_values
from ocp.problem.problem import Problem, parameters
from ocp.solving.first_guesses import smooth
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

NEARLY_LINEAR = 0.05  # largest cost of all controls at their limits, share of that of time


def scheme_for(problem: Problem) -> Scheme:
    """Return radau(3) with constant controls if all are limited and `switching_controls`, else collocated.

    Collocated controls leave their limits around a switch.
    """
    constant = _all_limited(problem) and switching_controls(problem)
    return radau(3, Control.CONSTANT if constant else Control.COLLOCATED)


def _all_limited(problem: Problem) -> bool:
    """Return whether bounds, and limits on both sides of as many expressions as controls without, hold the controls."""
    u = problem.system.u
    free = controls_without_bounds(problem)
    if len(free) == 0:
        return True
    held = [
        constraint.expression[c]
        for constraint in problem.subject_to
        if constraint.where is Where.ALONG
        for c in range(constraint.expression.numel())
        if np.isfinite([constraint.lower[c], constraint.upper[c]]).all() and constraint.lower[c] < constraint.upper[c]
    ]
    slopes = ca.jacobian_sparsity(ca.vertcat(*held), u[free.tolist()]) if held else ca.Sparsity(0, len(free))
    return bool(ca.sprank(ca.SX(slopes)) == len(free)) if slopes.nnz() else False


def switching_controls(problem: Problem) -> bool:
    """Return whether H is linear in the controls, or so nearly that they switch between their limits.

    It is if all controls at their limits cost less than a twentieth of the time, as in `gentle(problem)`; where no
    control has bounds, those of the smooth guess, which is within all limits.
    """
    H = hamiltonian_of(problem)
    if not ca.depends_on(H.slope, problem.system.u):
        return True
    most = np.max(np.abs(problem.limits(Where.ALONG, problem.system.u)), axis=0)
    if not np.any(np.isfinite(most)) and not ca.depends_on(
        ca.jacobian(problem.system.rate, problem.system.u), problem.system.u
    ):
        return _most_of_controls(problem) <= NEARLY_LINEAR * problem.minimise.time
    if not np.all(np.isfinite(most)) or ca.symvar(ca.densify(H.curvature)):
        return False
    largest = most @ np.abs(ca.DM(H.curvature).full()) @ most / 2.0
    return bool(largest <= NEARLY_LINEAR * problem.minimise.time)


def _most_of_controls(problem: Problem) -> float:
    """Return the largest change of the running cost by the controls of the smooth guess."""
    values = problem.system.values()
    p, guess = parameters(problem, values), smooth(problem, values)
    own, without = (evaluate(point_values(problem), guess.x, u, p)[2] for u in (guess.u, 0.0 * guess.u))
    return float(np.max(np.abs(own - without)))
