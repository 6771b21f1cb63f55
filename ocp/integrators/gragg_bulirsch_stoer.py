"""The Gragg-Bulirsch-Stoer method as an integrator of systems; the default of every simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ocp.checks import Array
from ocp.integrators.adaptive_step import AdaptiveStep
from ocp.integrators.contracts import Passage, check_components, check_tolerances, stopped
from ocp.integrators.control_segments import Polynomial, Sampled, Segment
from ocp.integrators.runge_kutta import RadauWithEstimate
from ocp.integrators.stiffness import Linearisation, decays, describe
from ocp.numerics.evaluation import Evaluation
from ocp.numerics.rate_functions import rates
from ocp.system import System

LOOK = 100  # steps after which the eigenvalues are checked for stiffness
STIFF = 300.0  # time to the next stop over the decay time, from which on an implicit method is cheaper


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Steps of order 16 with an error control for each, to tolerances near rounding; Radau IIA where that is stiff.

    After every hundred steps between two stops the largest eigenvalue of df/dx is computed. If its mode decays many
    times before the next stop, Radau IIA of order 5 continues from there with the same tolerances; an oscillating mode
    is resolved. The tolerance of a step is never below the rounding error of f.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).

    Raises:
        ValueError: a tolerance <= 0.

    Source: `integrate` below (Gragg-Bulirsch-Stoer); the change of methods follows L. Petzold, Automatic
        selection of methods for solving stiff and nonstiff systems, SIAM J. Sci. Stat. Comput. 4 (1983).
    """

    rtol: float = 1e-12
    atol: float | Array = 1e-12

    def __post_init__(self) -> None:
        check_tolerances(self.rtol, self.atol)

    def march(self, system: System, parameters: Sequence[float], x0: Array, segments: Sequence[Segment]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all segments; see `ocp.integrators.contracts.Method`."""
        check_components(self.atol, len(x0))
        run = _Run(self, system, parameters)
        xs = np.full((sum(len(segment.stops) - 1 for segment in segments), len(x0)), np.nan)
        x, row = x0, 0
        for segment in segments:
            run.rate.control = segment.control
            for t, stop in pairwise(segment.stops.tolist()):
                result, message = run.through(t, stop, x)
                if result is None:
                    return Passage(xs, message, run.evaluations)
                xs[row] = x = result
                row += 1
        return Passage(xs, "", run.evaluations)


class _Run:
    """State of one integration, with the explicit and the implicit method."""

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
        segment = Segment(np.array([t, stop]), self.rate.control)
        passage = self._implicit.march(self._system, self._parameters, x, [segment])
        self._more += passage.evaluations
        return (None, passage.message) if passage.message else (passage.x[0], "")


class _Rate:
    """f(t, x) of a system under a control that may be replaced."""

    def __init__(self, system: System, parameters: Sequence[float]) -> None:
        self._evaluation = Evaluation(rates(system))
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


Rate = Callable[[float, Array], Array]


Rounding = Callable[[float, Array], Array]


COLUMNS = 8  # of the extrapolation table: order 16


SAFETY = 0.7


SHRINK, GROW = 0.1, 4.0  # smallest and largest factor of one change of the step


MOST_STEPS = 100_000


AMPLIFIED = 20.0  # rounding of the last entry in units of eps: norm of its weights, 69, times 0.29 for one value


TORN = 2.0  # largest difference of the two extrapolations in units of the tolerance


@dataclass(frozen=True)
class Step:
    """Result of an integration over one interval."""

    x: Array  # (nx,) state at the end
    step: float  # proposal for the next step [s]
    reached: float  # time reached [s]; short of the end if the step vanished, f is not finite or steps ran out
    exhausted: bool = False  # whether the steps ran out


@np.errstate(over="ignore", invalid="ignore")  # a step that is not finite is rejected
def integrate(
    rate: Rate,
    t0: float,
    t1: float,
    x0: Array,
    rtol: float,
    atol: Array | float,
    first: float = 0.0,
    *,
    rounding: Rounding | None = None,
    steps: int = MOST_STEPS,
) -> Step:
    """Integrate a smooth ODE from t0 to t1 with steps of order 16.

    The modified midpoint rule with 2, 4, ..., 16 substeps has an error expansion in even powers of the step; Aitken-
    Neville extrapolation removes the first seven. The last two diagonal entries estimate the error. The rule carries
    two chains of states, at even and odd steps; where f has a jump or a thin layer, each may settle on its own side
    of it, and the extrapolation agrees with itself on a wrong motion. So an accepted step also agrees with the
    extrapolation of Gragg's smoothed values, which mix the chains.

    Args:
        rate: f(t, x) -> (nx,).
        t0, t1: interval [s], t1 > t0.
        x0: (nx,).
        rtol, atol: tolerance of one step, atol scalar or (nx,).
        first: first step to try [s]; 0 for the interval.
        rounding: (t, x) -> (nx,) rounding error of f, added to the tolerance; None for zero.
        steps: most of them, those rejected included.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.9 (Gragg-Bulirsch-Stoer; the
        smoothing is (9.13c)).
    """
    t, x = t0, np.array(x0, dtype=float)
    step = min(first, t1 - t0) if first > 0.0 else t1 - t0
    noise = rounding(t, x) if rounding else np.zeros(len(x))
    for _ in range(steps):
        if t >= t1:
            return Step(x, step, t)
        h = t1 - t if t + step * (1.0 + 1e-9) >= t1 else step
        new, error = _extrapolate(rate, t, x, h, rtol, atol, h * noise)
        if error <= 1.0:
            t, x = (t1 if h == t1 - t else t + h), new
            noise = rounding(t, x) if rounding else noise
        factor = SAFETY * error ** (-1.0 / (2 * COLUMNS - 1)) if error > 0.0 else GROW
        proposal = h * float(np.clip(factor, SHRINK, GROW))
        if error <= 1.0 and h < step:
            proposal = max(proposal, step)  # h was cut short by the end
        step = proposal
        if step < 1e-14 * max(abs(t), t1 - t0):
            return Step(x, step, t)
    return Step(x, step, t, exhausted=t < t1)


def _extrapolate(
    rate: Rate, t: float, x: Array, h: float, rtol: float, atol: Array | float, noise: Array
) -> tuple[Array, float]:
    """Return the extrapolated state after h and the error in units of the tolerance (inf if not finite).

    Args:
        rate, t, x, h, rtol, atol: as in `integrate`.
        noise: (nx,) rounding error of f, times h.
    """
    with np.errstate(all="ignore"):  # a step that overflows is rejected
        slope = rate(t, x)
        chains = [_midpoint(rate, t, x, slope, h, 2 * (k + 1)) for k in range(COLUMNS)]
        new, before = _neville([now for now, _ in chains])
        size = np.asarray(atol) + rtol * np.maximum(np.abs(x), np.abs(new)) + AMPLIFIED * noise
        # Rounding does not shrink with the step as the estimate does, so it must not influence the step.
        error = float(np.max(np.maximum(np.abs(new - before) - 2.0 * noise, 0.0) / size, initial=0.0))
        if error <= 1.0:
            ends = [(now + last + h / (2 * k + 2) * rate(t + h, now)) / 2.0 for k, (now, last) in enumerate(chains)]
            apart = float(np.max(np.abs(new - _neville(ends)[0]) / size, initial=0.0))
            error = error if apart <= TORN else apart
    return new, error if np.isfinite(error) else np.inf


def _neville(columns: list[Array]) -> tuple[Array, Array]:
    """Return the last two entries of the table over 2, 4, ... substeps, extrapolated in squares of the step."""
    table: list[Array] = []
    for k, first in enumerate(columns):
        row = [first]
        for j in range(1, k + 1):
            ratio = ((k + 1.0) / (k + 1.0 - j)) ** 2
            row.append(row[j - 1] + (row[j - 1] - table[j - 1]) / (ratio - 1.0))
        table = row
    return table[-1], table[-2]


def _midpoint(rate: Rate, t: float, x: Array, slope: Array, h: float, substeps: int) -> tuple[Array, Array]:
    """Return Gragg's modified midpoint rule after h, not smoothed, and the state one substep before."""
    small = h / substeps
    before, now = x, x + small * slope
    for k in range(1, substeps):
        before, now = now, before + 2.0 * small * rate(t + k * small, now)
    return now, before
