"""A transcribed problem: its sparse NLP, the meaning of its rows, and its bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.compilation import Compilation
from ocp.problem.constraints import Where
from ocp.problem.problem import Free, Problem
from ocp.transcription.grid import Grid
from ocp.transcription.layout import Layout
from ocp.transcription.scaled_nlp import ScaledNlp
from ocp.transcription.scaling import Scaling
from ocp.transcription.schemes.scheme import Scheme


@dataclass(frozen=True, eq=False)
class Nlp:
    """min f(z, s) subject to bounds on z and g(z, s); z are scaled unknowns, s = [p; duration if fixed; widths].

    The solver sees f and g divided by their scales (`ocp.transcription.scaled_nlp`).
    """

    problem: Problem
    scheme: Scheme
    grid: Grid
    scaling: Scaling
    layout: Layout
    free: Array  # numbers of the parameters that are unknowns
    scaled: ScaledNlp
    defects: Array  # (N, rows, nx) rows of g
    path: tuple[Array, ...]  # for each path part (N, points) rows of g
    ends: Array  # (nb,) rows of g
    path_parts: tuple[tuple[int, int], ...]  # (constraint, component) of each path row
    ends_parts: tuple[tuple[int, int, Where], ...]  # of each end row, and at which end
    conditions: tuple[Array, ...] = ()  # for each condition of an arc layout (elements, points, m) rows of g
    total: Array = field(default_factory=lambda: np.zeros(0, dtype=int))  # row of the sum of all durations, if given
    compilation: Compilation | None = None  # of the functions of an element, if asked for
    structure: bytes = b""  # digest of everything that the graphs depend on; empty if they are not kept

    @property
    def rows(self) -> int:
        """Number of rows of g."""
        return len(self.scaled.rows)

    @property
    def expressions(self) -> Mapping[str, ca.MX]:
        """Expressions "x", "p", "f" and "g"."""
        return self.scaled.physical[0]

    @property
    def derivatives(self) -> Mapping[str, ca.Function]:
        """Functions "grad_f", "jac_g" and "hess_lag" of f and g, with the signatures of `nlpsol`."""
        return self.scaled.physical[1]


def bounds(nlp: Nlp) -> tuple[Array, Array, Array, Array]:
    """Return lower and upper bounds of the scaled unknowns and the rows, (nz,), (nz,), (ng,), (ng,)."""
    problem, layout, scaling = nlp.problem, nlp.layout, nlp.scaling
    system = problem.system
    low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)

    def tighten(indices: Array, lower: Array, upper: Array, scale: Array) -> None:
        low[indices] = np.maximum(low[indices], lower / scale)
        high[indices] = np.minimum(high[indices], upper / scale)

    tighten(layout.state, *problem.limits(Where.ALONG, system.x), scaling.x)
    tighten(layout.control, *problem.limits(Where.ALONG, system.u), scaling.u)
    tighten(layout.state[0, 0], *problem.limits(Where.START, system.x), scaling.x)
    tighten(layout.state[-1, -1], *problem.limits(Where.END, system.x), scaling.x)
    if isinstance(problem.horizon, Free):
        limits = np.array([problem.horizon.lower]), np.array([problem.horizon.upper])
        tighten(layout.horizon, *limits, np.array([scaling.horizon]))
    if len(nlp.free):
        lower, upper = problem.limits(Where.ALONG, system.p)
        tighten(layout.free, lower[nlp.free], upper[nlp.free], scaling.free)
    rows_low, rows_high = np.zeros(nlp.rows), np.zeros(nlp.rows)
    for part, (i, c) in enumerate(nlp.path_parts):
        constraint = problem.subject_to[i]
        rows_low[nlp.path[part]] = constraint.lower[c]
        rows_high[nlp.path[part]] = constraint.upper[c]
    for part, (i, c, _) in enumerate(nlp.ends_parts):
        constraint = problem.subject_to[i]
        rows_low[nlp.ends[part]] = constraint.lower[c]
        rows_high[nlp.ends[part]] = constraint.upper[c]
    return low, high, rows_low, rows_high
