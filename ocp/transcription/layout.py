"""Indices of the unknowns of a transcribed problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp.checks import Array
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Control, Scheme


@dataclass(frozen=True, eq=False)
class Layout:
    """Indices of the unknowns in z: states and controls element by element, the durations, the free parameters."""

    state: Array  # (N, m, nx) of the state unknowns; the end of an element is the start of the next
    control: Array  # (N, c, nu) of the control unknowns; linear controls share those at the ends
    horizon: Array  # (A,) of the durations of the arcs (one without arcs); (0,) if the duration is fixed
    free: Array  # (nf,) of the free parameters
    size: int


def lay_out(scheme: Scheme, grid: Grid, nx: int, nu: int, durations: int, free_parameters: int) -> Layout:
    """Return the layout of the unknowns of a problem on a grid."""
    n, m = len(grid), len(scheme.nodes)
    own = m - 1  # the last node is the first of the next element
    c = len(scheme.control_nodes)
    own_controls = 1 if scheme.control is Control.LINEAR else c
    block = own * nx + own_controls * nu
    start = np.arange(n)[:, None, None] * block
    inner = start + np.arange(own)[None, :, None] * nx + np.arange(nx)[None, None, :]
    last = np.arange(1, n + 1)[:, None, None] * block + np.arange(nx)[None, None, :]
    state = np.concatenate([inner, last], axis=1)
    control = start + own * nx + np.arange(own_controls)[None, :, None] * nu + np.arange(nu)[None, None, :]
    size = n * block + nx
    if scheme.control is Control.LINEAR:
        final = size + np.arange(nu)[None, None, :]
        control = np.concatenate([control, np.concatenate([control[1:], final], axis=0)], axis=1)
        size += nu
    horizon = np.arange(size, size + durations)
    size += durations
    return Layout(state, control, horizon, np.arange(size, size + free_parameters), size + free_parameters)
