"""A motion made of arcs: the problem, prepared for any switching structure, and the motion of one structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.arcs.limit_arcs import chain_of
from ocp.arcs.state_limit_multipliers import Jump, LimitMultiplier
from ocp.checks import Array
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit, state_limits
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solving.nlp_solver import NlpResult
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme


@dataclass(frozen=True, eq=False)
class ArcProblem:
    """What all switching structures of a problem share.

    Args:
        problem: one phase.
        limits: its state limits.
        scheme: with collocated control.
        numbers: (np,) values of the parameters, in the order of the system.
        levels: function (x, u, p) -> limited expressions.
        singular: indices of the controls that enter the Hamiltonian linearly; between their bounds they are singular.
    """

    problem: Problem
    limits: tuple[StateLimit, ...]
    scheme: Scheme
    numbers: tuple[float, ...]
    levels: ca.Function
    singular: frozenset[int]

    def loose(self, arcs: tuple[Arc, ...]) -> bool:
        """Return whether a structure has singular arcs, whose controls the NLP does not determine well."""
        return any(arc.kinds[i] is Kind.INTERIOR for arc in arcs for i in self.singular)

    def chain(self, contact: Contact) -> tuple[ca.SX, ...]:
        """Return c, c', ..., c^(r) of the limit of a contact, r the first order at which its control appears."""
        limit = self.limits[contact.limit]
        return (chain_of(self.problem, limit, contact.control) if contact.control >= 0 else ()) or limit.chain

    def adapted(self, problem: Problem, numbers: tuple[float, ...]) -> ArcProblem:
        """Return the same for other parameter values and a problem that differs in numbers only."""
        sides = [(problem.subject_to[limit.constraint], limit.component) for limit in self.limits]
        limits = tuple(
            replace(limit, lower=float(constraint.lower[c]), upper=float(constraint.upper[c]))
            for limit, (constraint, c) in zip(self.limits, sides, strict=True)
        )
        return replace(self, problem=problem, limits=limits, numbers=numbers)


def arc_problem(problem: Problem, scheme: Scheme, values: Mapping[str, float]) -> ArcProblem:
    """Prepare a problem to be solved for given switching structures.

    Args:
        problem: one phase.
        scheme: with collocated control.
        values: of the parameters, by name.
    """
    system, limits = problem.system, state_limits(problem)
    expressions = ca.vertcat(ca.SX(0, 1), *(limit.chain[0] for limit in limits))
    levels = ca.Function("limits", [system.x, system.u, system.p], [ca.densify(expressions)])
    curvature = hamiltonian_of(problem).curvature
    singular = frozenset(i for i in range(system.u.numel()) if ca.SX(curvature[i, i]).is_zero())
    return ArcProblem(problem, limits, scheme, tuple(system.values(values)), levels, singular)


@dataclass(frozen=True, eq=False)
class ArcMotion:
    """The solution of the NLP of one switching structure.

    Args:
        arcs: with their optimal durations.
        result: of the solver.
        grid: of the whole motion.
        arc: (N,) index of the arc of each element.
        states, controls, costates: (N, m, nx), (N, d, nu), (N, d, nx); costates of the problem with its state limits
            adjoined directly, lambda = dJ/dx.
        limit_multipliers: of the state limits that are active along an arc.
        jumps: of the costates at entries, exits and touch points.
        free: indices of the parameters that were unknowns.
        parameters: (np,) values of all parameters.
        setup: seconds spent on preparing the NLP.
        penalty: part of the cost of the result that the penalties on singular controls add.
        pressed: (N,) whether a state limit that stays an inequality presses on an element at its points.
    """

    arcs: tuple[Arc, ...]
    result: NlpResult
    grid: Grid
    arc: Array
    states: Array
    controls: Array
    costates: Array
    limit_multipliers: tuple[LimitMultiplier, ...]
    jumps: tuple[Jump, ...]
    free: Array
    parameters: Array
    setup: float
    penalty: float
    pressed: Array

    @property
    def duration(self) -> float:
        """Sum of the durations [s]."""
        return sum(arc.duration for arc in self.arcs)

    def solution(self, task: ArcProblem, like: Solution) -> Solution:
        """Return the motion as a Solution without structure.

        Args:
            task: what it solves.
            like: solution from which message, timings and all other fields are copied.
        """
        values = dict(zip(task.problem.system.nominal, self.parameters.tolist(), strict=True))
        names = list(values)
        return replace(
            like, status=self.result.status, solver_status=self.result.verbatim, duration=self.duration,
            cost=self.result.cost - self.penalty, states=self.states, controls=self.controls,
            slopes=np.zeros((len(self.grid), 0, self.states.shape[2])), costates=self.costates,
            free={names[number]: values[names[number]] for number in self.free}, values=values, grid=self.grid,
            scheme=task.scheme, problem=task.problem, log=self.result.log, multipliers=None, accuracy=None,
            structure=None,
        )  # fmt: skip
