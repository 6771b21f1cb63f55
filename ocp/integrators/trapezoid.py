"""The trapezoid rule as predictor and corrector, the scheme of hand and pocket calculators."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.integrators.contracts import symbols
from ocp.numerics.rate_functions import rates
from ocp.system import System


@dataclass(frozen=True)
class PredictorCorrector:
    """Euler's method predicts, the trapezoid rule corrects, a fixed number of times: P(EC)^m E, order 2.

    x_0 = x + h f(x, u(t)),  x_k = x + h/2 (f(x, u(t)) + f(x_{k-1}, u(t + h))),  k = 1 .. m,  x_next = x_m

    One correction is Heun's method; with many it becomes the implicit trapezoid rule, if h |df/dx| < 2, else the
    corrections diverge. The corrections do not raise the order, they lower the error constant.

    Args:
        corrections: m >= 1.

    Raises:
        ValueError: no whole number >= 1.

    Source: K. Heun, Neue Methoden zur approximativen Integration der Differentialgleichungen einer unabhaengigen
        Veraenderlichen, Z. Math. Phys. 45 (1900), for m = 1; J. D. Lambert, Computational Methods in Ordinary
        Differential Equations, 3.8 (modes of predictor and corrector).
    """

    corrections: int = 2

    def __post_init__(self) -> None:
        checks.whole("corrections", self.corrections, 1)

    @property
    def order(self) -> int:
        """Order of convergence."""
        return 2

    @property
    def nodes(self) -> Array:
        """(2,) both ends of the step."""
        return np.array([0.0, 1.0])

    @property
    def error_order(self) -> int:
        """No error estimate."""
        return 0

    def step(self, system: System) -> ca.Function:
        """Return the function of one step; see `ocp.integrators.contracts.Rule`."""
        x, h, u, p = symbols(system, 2)
        f = rates(system)
        slope = f(x, u[:, 0], p)
        new = x + h * slope
        for _ in range(self.corrections):
            new = x + h / 2 * (slope + f(new, u[:, 1], p))
        evaluations = 1 + self.corrections
        return ca.Function("step", [x, h, u, p], [new, ca.SX(x.numel(), 0), 0, evaluations], {"cse": True})

    def error(self, norms: Array) -> float:
        """Raise, as there is no estimate."""
        raise NotImplementedError
