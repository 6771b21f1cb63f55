"""The Gragg-Bulirsch-Stoer method as an integrator of systems; the default of every simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.integrators.adaptive_step import AdaptiveStep
from ocp.integrators.contracts import Array, Passage, check_components, check_tolerances, stopped
from ocp.integrators.control_pieces import Piece, Polynomial, Sampled
from ocp.integrators.integration import MOST_STEPS, integrate
from ocp.integrators.runge_kutta import RadauWithEstimate
from ocp.integrators.stiffness import Linearisation, decays, describe
from ocp.numerics.evaluation import Evaluation
from ocp.system import System

LOOK = 100  # steps after which the fastest mode is looked at
STIFF = 300.0  # times that a mode dies out before the next stop, from which on an implicit method is cheaper


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Steps of order 16 with an error control for each, to tolerances near rounding; Radau IIA where that is stiff.

    After every hundred steps without an end the fastest mode of the system is looked at. If it dies out many times
    before the next stop, Radau IIA of order 5 goes on from there with the same tolerances; a mode that swings is
    followed. No step is held to more than the rounding of f.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).

    Raises:
        ValueError: a tolerance <= 0.

    Source: `ocp.integration.integrate` (Gragg-Bulirsch-Stoer); the change of methods follows L. Petzold, Automatic
        selection of methods for solving stiff and nonstiff systems, SIAM J. Sci. Stat. Comput. 4 (1983).
    """

    rtol: float = 1e-12
    atol: float | Array = 1e-12

    def __post_init__(self) -> None:
        check_tolerances(self.rtol, self.atol)

    def march(self, system: System, parameters: Sequence[float], x0: Array, pieces: Sequence[Piece]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all pieces; see `ocp.method.Method`."""
        check_components(self.atol, len(x0))
        run = _Run(self, system, parameters)
        xs = np.full((sum(len(piece.stops) - 1 for piece in pieces), len(x0)), np.nan)
        x, row = x0, 0
        for piece in pieces:
            run.rate.control = piece.control
            for t, stop in pairwise(piece.stops.tolist()):
                found, message = run.through(t, stop, x)
                if found is None:
                    return Passage(xs, message, run.evaluations)
                xs[row] = x = found
                row += 1
        return Passage(xs, "", run.evaluations)


class _Run:
    """One integration: the explicit method, the implicit one, and which of them is at work."""

    def __init__(self, method: Extrapolation, system: System, parameters: Sequence[float]) -> None:
        self._rtol, self._atol = method.rtol, method.atol
        self._system, self._parameters = system, parameters
        self._implicit = AdaptiveStep(RadauWithEstimate(), method.rtol, method.atol)
        self._linear = Linearisation(system, parameters)
        self._step, self._stiff, self._more = 0.0, False, 0
        self.rate = _Rate(system, parameters)

    @property
    def evaluations(self) -> int:
        """How often f was evaluated."""
        return self.rate.calls + self._more

    def through(self, t: float, stop: float, x: Array) -> tuple[Array | None, str]:
        """Return the state at the next stop; None with the reason if it cannot be reached."""
        for k in range(MOST_STEPS // LOOK):
            if (k or self._stiff) and self._dies_out(t, stop, x):
                return self._implicitly(t, stop, x)
            done = integrate(
                self.rate, t, stop, x, self._rtol, self._atol, self._step, rounding=self._rounding, steps=LOOK
            )
            t, x, self._step = done.reached, done.x, done.step
            if t >= stop:
                return x, ""
            if not done.exhausted:
                return None, stopped(t, "the step vanished or f is not finite")
        mode = describe(self._linear.fastest(x, self.rate.control(t)))
        return None, stopped(t, f"{MOST_STEPS} steps were not enough to reach {stop:.9g} s{mode}")

    def _rounding(self, t: float, x: Array) -> Array:
        return self._linear.rounding(x, self.rate.control(t))

    def _dies_out(self, t: float, stop: float, x: Array) -> bool:
        mode = self._linear.fastest(x, self.rate.control(t))
        self._stiff = bool(np.isfinite(mode)) and decays(mode) and abs(mode) * (stop - t) > STIFF
        return self._stiff

    def _implicitly(self, t: float, stop: float, x: Array) -> tuple[Array | None, str]:
        piece = Piece(np.array([t, stop]), self.rate.control)
        passage = self._implicit.march(self._system, self._parameters, x, [piece])
        self._more += passage.evaluations
        return (None, passage.message) if passage.message else (passage.x[0], "")


class _Rate:
    """f(t, x) of a system under a control that may be replaced."""

    def __init__(self, system: System, parameters: Sequence[float]) -> None:
        function = ca.Function("rate", [system.x, system.u, system.p], [ca.densify(system.rate)])
        self._evaluation = Evaluation(function)
        self._x, self._u, p = self._evaluation.inputs
        self._call, (self._out,) = self._evaluation.call, self._evaluation.outputs
        p[:] = parameters
        self.control: Polynomial | Sampled = Polynomial(
            0.0, 1.0, np.zeros(1), np.zeros((1, system.u.numel())), np.ones_like
        )
        self.calls = 0

    def __call__(self, t: float, state: Array) -> Array:
        self._x[:] = state
        self._u[:] = self.control(t)
        self._call()
        self.calls += 1
        return self._out.copy()
