"""Butcher tableaux as data: classical explicit methods, embedded pairs, and collocation methods of any order."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.polynomials import integration_matrix, quadrature
from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.radau_iia import radau


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
        """(s,) points of the stages in the step, c_i = sum_j a_ij."""
        points: Array = self.a.sum(axis=1)
        return points

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


def _pair(main: Tableau, errors: list[list[float]], error_order: int) -> Tableau:
    return Tableau(main.name, main.a, main.b, main.order, np.array(errors, dtype=float), error_order)


# Dormand, Prince, A family of embedded Runge-Kutta formulae, 1980; Hairer, Norsett, Wanner, Solving Ordinary
# Differential Equations I, table II.5.2. The seventh stage is f at the end of the step and serves the estimate only.
DORMAND_PRINCE_5 = _pair(
    explicit(
        "dormand_prince_5",
        [
            [1 / 5],
            [3 / 40, 9 / 40],
            [44 / 45, -56 / 15, 32 / 9],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
            [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
        ],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0],
        order=5,
    ),
    [[71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]],
    error_order=5,
)


# Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.5 and the appendix (DOP853).
# fmt: off
_ROWS: list[list[float]] = [
    [0.05260015195876773],
    [0.0197250569845379, 0.0591751709536137],
    [0.02958758547680685, 0.0, 0.08876275643042054],
    [0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
    [0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
    [0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596,
     -0.017578125],
    [0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328,
     -0.015319437748624402, 0.008273789163814023],
    [0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726,
     27.59209969944671, 20.154067550477894, -43.48988418106996],
    [0.47766253643826434, 0.0, 0.0, -2.4881146199716677, -0.590290826836843,
     21.230051448181193, 15.279233632882423, -33.28821096898486, -0.020331201708508627],
    [-0.9371424300859873, 0.0, 0.0, 5.186372428844064, 1.0914373489967295,
     -8.149787010746927, -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196],
    [2.273310147516538, 0.0, 0.0, -10.53449546673725, -2.0008720582248625,
     -17.9589318631188, 27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303,
     0.6433927460157636],
]


_WEIGHTS: list[float] = [
    0.054293734116568765, 0.0, 0.0, 0.0, 0.0,
    4.450312892752409, 1.8915178993145003, -5.801203960010585, 0.3111643669578199, -0.1521609496625161,
    0.20136540080403034, 0.04471061572777259,
]


_FIFTH: list[float] = [
    0.01312004499419488, 0.0, 0.0, 0.0, 0.0,
    -1.2251564463762044, -0.4957589496572502, 1.6643771824549864, -0.35032884874997366, 0.3341791187130175,
    0.08192320648511571, -0.022355307863886294,
]


_THIRD: list[float] = [
    -0.18980075407240762, 0.0, 0.0, 0.0, 0.0,
    4.450312892752409, 1.8915178993145003, -5.801203960010585, -0.4226823213237919, -0.1521609496625161,
    0.20136540080403034, 0.02265179219836082,
]


# fmt: on
DORMAND_PRINCE_8 = _pair(explicit("dormand_prince_8", _ROWS, _WEIGHTS, order=8), [_FIFTH, _THIRD], error_order=8)
