"""Penalties on singular controls, which the NLP of a switching structure does not determine well."""

from __future__ import annotations

import numpy as np

from ocp.arcs.arc_problems import ArcProblem
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.solution.structure import Arc, Kind
from ocp.transcription.arc_layout import Penalty
from ocp.transcription.grid import Grid
from ocp.transcription.guess import Guess
from ocp.transcription.packing import INSIDE


def penalties_of(
    task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, guess: Guess | None, grid: Grid, weight: float
) -> tuple[Penalty, ...]:
    """Return the penalties that keep singular controls near those of a guess, or near zero without one."""
    low, high = task.problem.limits(Where.ALONG, task.problem.system.u)
    results = []
    scheme = task.scheme
    inside = np.clip(scheme.control_nodes, INSIDE, 1.0 - INSIDE)
    quadrature = scheme.weights @ scheme.control_at(scheme.points)
    for k, a in enumerate(arcs if weight > 0.0 else ()):
        chosen = np.array([i for i in sorted(task.singular) if a.kinds[i] is Kind.INTERIOR], dtype=int)
        if len(chosen) == 0:
            continue
        own = np.flatnonzero(arc == k)
        share = grid.ends[own][:, None] + grid.widths[own][:, None] * inside
        reference = np.zeros((*share.shape, len(chosen))) if guess is None else guess.control(share)[:, :, chosen]
        used = (
            np.ones(len(low)) if guess is None else np.maximum(np.ptp(guess.u, axis=0), np.max(np.abs(guess.u), axis=0))
        )
        scale = np.where(np.isfinite(high - low), high - low, np.where(used > 0.0, used, 1.0))[chosen]
        results.append(Penalty(chosen, reference, scale, weight, own, quadrature))
    return tuple(results)


def value_of(penalty: Penalty, controls: Array, seconds: Array) -> float:
    """Return the value of a penalty for given controls (N, d, nu) and widths (N,) of the elements [s]."""
    away = (controls[penalty.elements][:, :, penalty.controls] - penalty.reference) / penalty.scale
    integral = seconds[penalty.elements] @ np.sum(away**2, axis=2) @ penalty.quadrature
    return float(penalty.weight / 2.0 * integral)
