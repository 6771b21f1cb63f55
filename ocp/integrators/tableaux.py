"""Butcher tableaux as data: classical explicit methods, embedded pairs, and collocation methods of any order."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ocp import checks
from ocp.transcription.schemes.scheme import integration_matrix, legendre, quadrature, radau

Array = np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Tableau:
    """A Runge-Kutta method, X_i = x + h sum_j a_ij f(X_j, u(t + c_i h)), x_next = x + h sum_i b_i f(X_i, ...).

    Args:
        name: short.
        a: (s, s); strictly lower triangular for an explicit method.
        b: (s,) weights.
        order: of the method.
        errors: (k, s) weights of h f_i in error estimates, k = 0, 1 or 2. Two estimates e_1, e_2 are combined as
            e_1^2 / sqrt(e_1^2 + 0.01 e_2^2), as in DOP853.
        error_order: order in h of the (combined) estimate; 0 without one.

    Raises:
        ValueError: shapes disagree, or the weights do not add up to 1.
    """

    name: str
    a: Array
    b: Array
    order: int
    errors: Array = field(default_factory=lambda: np.zeros((0, 0)))
    error_order: int = 0

    def __post_init__(self) -> None:
        s = len(self.b)
        if self.a.shape != (s, s) or (self.errors.size and self.errors.shape[1] != s):
            raise ValueError(
                f"Tableau: a is {self.a.shape}, errors {self.errors.shape}, expected {s} columns, as b has"
            )
        if abs(self.b.sum() - 1.0) > 1e-12:
            raise ValueError(f"Tableau: the weights b add up to {self.b.sum()}, expected 1")

    def __repr__(self) -> str:
        return self.name

    @property
    def c(self) -> Array:
        """(s,) places of the stages in the step, c_i = sum_j a_ij."""
        places: Array = self.a.sum(axis=1)
        return places

    @property
    def explicit(self) -> bool:
        """Whether every stage follows from those before it."""
        return not np.any(np.triu(self.a))


def explicit(name: str, rows: Sequence[Sequence[float]], b: Sequence[float], order: int) -> Tableau:
    """Return an explicit tableau from the rows of a below the diagonal, the first (empty) one left out."""
    a = np.zeros((len(b), len(b)))
    for i, row in enumerate(rows, 1):
        a[i, : len(row)] = row
    return Tableau(name, a, np.array(b, dtype=float), order)


def gauss(stages: int) -> Tableau:
    """Return the Gauss method: order 2 stages, symplectic, symmetric, A-stable; 1 stage is the implicit midpoint rule.

    Args:
        stages: 1 to 12.

    Raises:
        ValueError: stages out of range.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5.
    """
    checks.whole("stages", stages, 1, 12)
    return _gauss(int(stages))


@functools.lru_cache(maxsize=16)
def _gauss(stages: int) -> Tableau:
    points = legendre(stages).points
    return Tableau(f"gauss({stages})", integration_matrix(points), quadrature(points), 2 * stages)


def radau_iia(stages: int) -> Tableau:
    """Return the Radau IIA method: order 2 stages - 1, L-stable; 1 stage is the implicit Euler method.

    Args:
        stages: 1 to 12.

    Raises:
        ValueError: stages out of range.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5.
    """
    checks.whole("stages", stages, 1, 12)
    return _radau_iia(int(stages))


@functools.lru_cache(maxsize=16)
def _radau_iia(stages: int) -> Tableau:
    points = radau(stages).points
    return Tableau(f"radau_iia({stages})", integration_matrix(points), quadrature(points), 2 * stages - 1)


EULER = explicit("euler", [], [1.0], order=1)
# Heun 1900: the trapezoid rule with Euler's prediction.
HEUN = explicit("heun", [[1.0]], [0.5, 0.5], order=2)
# Kutta 1901, "the" Runge-Kutta method.
KUTTA = explicit("runge_kutta_4", [[0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6], order=4)
