"""Multipliers of motions whose controls switch at the same time: the NLP alone may leave them undetermined."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.arcs.arc_problems import ArcProblem
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.hamiltonian import hamiltonian_of
from ocp.solution.structure import Arc, Kind
from ocp.transcription.nlp import Nlp

BOUNDS = (Kind.LOWER, Kind.UPPER)
SMALL = 800  # equations up to which dependent ones are looked for where there are enough unknowns
Sides = tuple[Array, Array, Array, Array]


def simultaneous(arcs: tuple[Arc, ...]) -> int:
    """Return the number of switches that coincide with another one."""
    pairs = pairwise(arcs)
    changes = [sum(a is not b for a, b in zip(one.kinds, other.kinds, strict=True)) for one, other in pairs]
    return sum(max(count - 1, 0) for count in changes)


def chosen_multipliers(
    task: ArcProblem, nlp: Nlp, arcs: tuple[Arc, ...], owner: Array, point: tuple[Array, Array, Array], sides: Sides
) -> Array | None:
    """Return multipliers with which every switching function vanishes at its own switch; None if nothing is to choose.

    One duration between two simultaneous switches asks for the sum of their switching functions only. Where equations
    depend on each other, the multipliers y of the rows solve, in the least-squares sense,

        grad f + J' y = 0  for all unknowns that are not fixed,   dH/du_i = 0  at every simultaneous switch of u_i.

    Args:
        task: the problem.
        nlp: of the arcs.
        arcs: the structure.
        owner: (N,) index of the arc of each element.
        point: unknowns z (nz,), parameters (ns,) of the NLP, and multipliers (ng,) of the rows as found.
        sides: bounds of the unknowns and of the rows.
    """
    z, s, y = point
    low, high, rows_low, rows_high = sides
    equal, free = np.flatnonzero(rows_low == rows_high), np.flatnonzero(low < high)
    switches = [
        (k, [i for i, kind in enumerate(arc.kinds) if {kind, arcs[k - 1].kinds[i]} == set(BOUNDS)])
        for k, arc in enumerate(arcs)
        if k
    ]
    switches = [(k, own) for k, own in switches if len(own) > 1]
    if not switches or (len(equal) <= len(free) and len(equal) > SMALL):
        return None
    gradient = np.array(nlp.derivatives["grad_f"](z, s)[1]).ravel()
    jacobian = nlp.derivatives["jac_g"](z, s)[1]
    others = np.setdiff1d(np.arange(len(y)), equal)
    rest = np.zeros(len(y))
    rest[others] = y[others]
    right = -(gradient + np.array(ca.mtimes(jacobian.T, rest)).ravel())[free]
    left = np.array(jacobian[equal.tolist(), free.tolist()]).T
    rows, values = _switching_rows(task, nlp, owner, z, switches, len(y))
    size = max(float(np.max(np.abs(gradient))), 1e-300)
    whole = np.vstack([left, size * rows[:, equal]])
    chosen = np.linalg.lstsq(whole, np.append(right, size * values), rcond=1e-12)[0]
    rest[equal] = chosen
    return rest


def _switching_rows(
    task: ArcProblem, nlp: Nlp, owner: Array, z: Array, switches: list[tuple[int, list[int]]], count: int
) -> tuple[Array, Array]:
    """Return the equations dH/du_i = 0 at switches as rows (m, ng) of the multipliers, and right sides (m,)."""
    H, scheme, scaling = hamiltonian_of(task.problem), nlp.scheme, nlp.scaling
    system = task.problem.system
    slope = ca.Function(
        "slope", [system.x, system.u, system.p],
        [ca.densify(ca.jacobian(H.slope, H.costate)), ca.substitute(H.slope, H.costate, ca.DM.zeros(*H.costate.shape))],
    )  # fmt: skip
    at_end = scheme.costate_at(np.ones(1))[0]  # (d,)
    low, high = task.problem.limits(Where.ALONG, system.u)
    results, right = [], []
    for k, own in switches:
        element = int(np.flatnonzero(owner == k - 1)[-1])
        x = z[nlp.layout.state[element, -1]] * scaling.x
        u = z[nlp.layout.control[element, -1]] * scaling.u
        by_costate, constant = (np.array(part) for part in slope(x, u, list(task.numbers)))
        for i in own:
            row = np.zeros(count)
            width = high[i] - low[i]
            # lambda(1) = sum_j C_j lambda_j with lambda_j = -sum_i rate_ij mu_i / weight_j / scale.
            share = -(scheme.rate @ (at_end / scheme.weights))
            row[nlp.defects[element]] = width * share[:, None] * (by_costate[i] / scaling.x)[None, :]
            results.append(row)
            right.append(-width * float(constant[i, 0]))
    return np.array(results), np.array(right)
