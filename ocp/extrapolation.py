"""The Gragg-Bulirsch-Stoer method as an integrator of systems; the default of every simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.buffered import Evaluation
from ocp.integration import integrate
from ocp.method import Array, Passage, check_components, check_tolerances, stopped
from ocp.piece import ControlOf, Piece
from ocp.system import System


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Steps of order 16 with an error control for each step, to tolerances near rounding.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).

    Raises:
        ValueError: a tolerance <= 0.

    Source: `ocp.integration.integrate` (Gragg-Bulirsch-Stoer).
    """

    rtol: float = 1e-12
    atol: float | Array = 1e-12

    def __post_init__(self) -> None:
        check_tolerances(self.rtol, self.atol)

    def march(self, system: System, parameters: Sequence[float], x0: Array, pieces: Sequence[Piece]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all pieces; see `ocp.method.Method`."""
        check_components(self.atol, len(x0))
        rate = _Rate(system, parameters)
        xs = np.full((sum(len(piece.stops) - 1 for piece in pieces), len(x0)), np.nan)
        x, step, row = x0, 0.0, 0
        for piece in pieces:
            rate.control = piece.control
            t = piece.stops[0]
            for stop in piece.stops[1:]:
                done = integrate(rate, t, stop, x, self.rtol, self.atol, step)
                if done.reached < stop:
                    message = stopped(done.reached, "the step vanished or f is not finite")
                    return Passage(xs, message, rate.calls)
                t, x, step = stop, done.x, done.step
                xs[row] = x
                row += 1
        return Passage(xs, "", rate.calls)


class _Rate:
    """f(t, x) of a system under a control that may be replaced."""

    def __init__(self, system: System, parameters: Sequence[float]) -> None:
        function = ca.Function("rate", [system.x, system.u, system.p], [ca.densify(system.rate)])
        self._evaluation = Evaluation(function)
        self._x, self._u, p = self._evaluation.inputs
        self._call, (self._out,) = self._evaluation.call, self._evaluation.outputs
        p[:] = parameters
        self.control: ControlOf = lambda _: np.zeros(system.u.numel())
        self.calls = 0

    def __call__(self, t: float, state: Array) -> Array:
        self._x[:] = state
        self._u[:] = self.control(t)
        self._call()
        self.calls += 1
        return self._out.copy()
