"""Between motions in physical units and the scaled unknowns and multipliers of the NLP."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ocp.checks import Array
from ocp.problem.problem import Fixed
from ocp.system import rates
from ocp.transcription.guess import Guess
from ocp.transcription.nlp import Nlp


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of the limits, -d cost / d limit: > 0 at an upper limit, < 0 at a lower one, zero away from both.

    Those of shared unknowns (ends of elements) stand on both sides.
    """

    x: Array  # (N, m, nx) of the state unknowns [cost / unit of the state]
    u: Array  # (N, c, nu) of the control unknowns [cost / unit of the control]
    path: Array  # (N, l) of the limited expressions that are no unknowns, on every element, one after the other
    ends: Array  # (nb,) of the conditions at both ends that are no limits of unknowns


def pack(nlp: Nlp, guess: Guess, values: list[float]) -> Array:
    """Return the scaled unknowns (nz,) of a guess."""
    layout, scaling, grid, scheme = nlp.layout, nlp.scaling, nlp.grid, nlp.scheme
    z = np.zeros(layout.size)
    starts, widths = grid.ends[:-1, None], grid.widths[:, None]
    z[layout.state] = guess.state(starts + widths * scheme.nodes) / scaling.x
    # A constant control stands for the middle of its element, not for its start.
    places = np.array([0.5]) if len(scheme.control_nodes) == 1 else scheme.control_nodes
    z[layout.control] = guess.control(starts + widths * places) / scaling.u
    z[layout.horizon] = guess.duration / scaling.horizon
    nominal = np.array([values[number] for number in nlp.free])
    z[layout.free] = (guess.free if len(guess.free) == len(nominal) else nominal) / scaling.free
    return z


@dataclass(frozen=True, eq=False)
class Motion:
    """What scaled unknowns and multipliers stand for, in physical units."""

    duration: float  # [s]
    states: Array  # (N, m, nx)
    controls: Array  # (N, c, nu)
    slopes: Array  # (N, e, nx)
    costates: Array  # (N, d, nx)
    multipliers: Multipliers
    free: Mapping[str, float]
    values: Mapping[str, float]


def unpack(nlp: Nlp, z: Array, multipliers: Array, limits: Array, values: list[float]) -> Motion:
    """Return the motion that scaled unknowns (nz,), multipliers of the rows (ng,) and of bounds (nz,) stand for."""
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
        rate = rates(system).map(len(states))
        first = np.einsum("m,kma->ak", scheme.control_at(np.zeros(1))[0], controls)
        parameters = np.tile(np.array([everything[name] for name in names])[:, None], len(states))
        widths = duration * nlp.grid.widths
        slopes = (np.array(rate(states[:, 0].T, first, parameters)).T * widths[:, None])[:, None, :]
    # The rate F_j enters the Lagrangian with -sum_i rate_ij mu_i; a quadrature weight b_j makes it the costate.
    mu = multipliers[nlp.defects]
    costates = -np.einsum("ij,kia->kja", scheme.rate, mu) / scheme.weights[:, None] / scaling.x
    path = np.hstack([multipliers[rows] for rows in (np.zeros((len(states), 0), dtype=int), *nlp.path)])
    held = Multipliers(
        limits[layout.state] / scaling.x, limits[layout.control] / scaling.u, path, multipliers[nlp.ends]
    )
    return Motion(duration, states, controls, slopes, costates, held, free, everything)
