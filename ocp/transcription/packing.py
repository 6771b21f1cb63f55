"""Conversion between motions in physical units and the scaled unknowns and multipliers of the NLP."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.numerics.polynomials import lagrange_matrix
from ocp.numerics.rate_functions import rates
from ocp.problem.problem import Fixed
from ocp.transcription.guess import Guess
from ocp.transcription.nlp import Nlp
from ocp.transcription.schemes.scheme import Control

INSIDE = 1e-5  # distance from the ends of an element, share of its width


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of bounds and constraints, -d cost / d bound: > 0 at an upper bound, < 0 at a lower one, else 0.

    Unknowns that two elements share have the same multiplier in both.
    """

    x: Array  # (N, m, nx) of the state unknowns [cost / unit of the state]
    u: Array  # (N, c, nu) of the control unknowns [cost / unit of the control]
    path: Array  # (N, l) of the constrained expressions, element by element
    ends: Array  # (nb,) of the conditions at both ends that are not bounds of single unknowns


def pack(nlp: Nlp, guess: Guess, values: list[float]) -> Array:
    """Return the scaled unknowns (nz,) of a guess."""
    layout, scaling, grid, scheme = nlp.layout, nlp.scaling, nlp.grid, nlp.scheme
    z = np.zeros(layout.size)
    starts, widths = grid.ends[:-1, None], grid.widths[:, None]
    z[layout.state] = guess.state(starts + widths * scheme.nodes) / scaling.x
    # A constant control takes the value of the guess in the middle of its element.
    nodes = np.array([0.5]) if len(scheme.control_nodes) == 1 else scheme.control_nodes
    if scheme.control is Control.SEGMENTS:  # it jumps between elements: values at their ends are those seen from inside
        inside = np.array([INSIDE, 1.0 - INSIDE])
        controls = np.einsum("cs,ksa->kca", lagrange_matrix(inside, nodes), guess.control(starts + widths * inside))
    else:
        controls = guess.control(starts + widths * nodes)
    z[layout.control] = controls / scaling.u
    z[layout.horizon] = guess.duration / scaling.horizon
    nominal = np.array([values[number] for number in nlp.free])
    z[layout.free] = (guess.free if len(guess.free) == len(nominal) else nominal) / scaling.free
    return z


@dataclass(frozen=True, eq=False)
class Motion:
    """Scaled unknowns and multipliers converted to a motion in physical units."""

    duration: float  # [s]
    states: Array  # (N, m, nx)
    controls: Array  # (N, c, nu)
    slopes: Array  # (N, e, nx)
    costates: Array  # (N, d, nx)
    multipliers: Multipliers
    free: Mapping[str, float]
    values: Mapping[str, float]


def unpack(nlp: Nlp, z: Array, multipliers: Array, limits: Array, values: list[float]) -> Motion:
    """Return the motion given by scaled unknowns (nz,), multipliers of the rows (ng,) and of the bounds (nz,)."""
    layout, scaling, problem, scheme = nlp.layout, nlp.scaling, nlp.problem, nlp.scheme
    system = problem.system
    if isinstance(problem.horizon, Fixed):
        duration = problem.horizon.duration
    else:
        duration = float(z[layout.horizon[0]] * scaling.horizon)
    names = list(system.nominal)
    results = [float(value) for value in z[layout.free] * scaling.free]
    free = {names[number]: value for number, value in zip(nlp.free, results, strict=True)}
    everything = {**dict(zip(names, values, strict=True)), **free}
    states, controls = z[layout.state] * scaling.x, z[layout.control] * scaling.u
    slopes = np.zeros((len(states), 0, states.shape[2]))
    if scheme.slope_at_start:
        first = np.einsum("m,kma->ka", scheme.control_at(np.zeros(1))[0], controls)
        parameters = np.array([everything[name] for name in names])
        widths = duration * nlp.grid.widths
        slopes = (evaluate(rates(system), states[:, 0], first, parameters)[0] * widths[:, None])[:, None, :]
    # The rate F_j enters the Lagrangian with -sum_i rate_ij lam_i; divided by the weight b_j that is the costate.
    of_defects = multipliers[nlp.defects]
    costates = -np.einsum("ij,kia->kja", scheme.rate, of_defects) / scheme.weights[:, None] / scaling.x
    path = np.hstack([multipliers[rows] for rows in (np.zeros((len(states), 0), dtype=int), *nlp.path)])
    held = Multipliers(
        limits[layout.state] / scaling.x, limits[layout.control] / scaling.u, path, multipliers[nlp.ends]
    )
    return Motion(duration, states, controls, slopes, costates, held, free, everything)
