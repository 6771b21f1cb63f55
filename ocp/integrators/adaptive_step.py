"""Integration by a one-step method with an error estimate, the width of every step chosen by it."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.integrators.contracts import Passage, Rule, check_components, check_tolerances, stopped
from ocp.integrators.control_segments import Polynomial, Segment
from ocp.integrators.stiffness import Linearisation, describe
from ocp.numerics.evaluation import Evaluation
from ocp.numerics.newton import ACCEPTED
from ocp.numerics.rate_functions import rates
from ocp.system import System

SAFETY = 0.9
SHRINK, GROW = 0.2, 8.0  # smallest and largest factor of one change of the step
MOST_STEPS = 1_000_000  # between two stops


@dataclass(frozen=True, eq=False)
class AdaptiveStep:
    """A one-step method with error control: every step's estimate stays below atol + rtol |x|, component by component.

    Args:
        rule: the one-step method, with an error estimate.
        rtol, atol: tolerance of one step; atol scalar or (nx,).

    Raises:
        ValueError: a tolerance <= 0, or a rule without estimate.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4.
    """

    rule: Rule
    rtol: float = 1e-9
    atol: float | Array = 1e-9

    def __post_init__(self) -> None:
        check_tolerances(self.rtol, self.atol)
        if self.rule.error_order == 0:
            raise ValueError(f"AdaptiveStep: {self.rule!r} has no error estimate; use FixedStep")

    def march(self, system: System, parameters: Sequence[float], x0: Array, segments: Sequence[Segment]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all segments; see `ocp.integrators.contracts.Method`."""
        check_components(self.atol, len(x0))
        attempt = _Attempt(self, system, parameters)
        xs = np.full((sum(len(segment.stops) - 1 for segment in segments), len(x0)), np.nan)
        x, row = x0, 0
        step = self._first(system, parameters, x0, segments[0]) if segments else 0.0
        for segment in segments:
            attempt.follow(segment)
            t = float(segment.stops[0])
            for stop in segment.stops[1:].tolist():
                x, t, step = attempt.through(x, t, stop, step)
                if t < stop:
                    reason = "the step vanished or f is not finite"
                    if attempt.exhausted:
                        mode = describe(Linearisation(system, parameters).fastest(x, segment.control(t)))
                        reason = f"{MOST_STEPS} steps were not enough to reach {stop:.9g} s{mode}"
                    return Passage(xs, stopped(t, reason), attempt.evaluations)
                xs[row] = x
                row += 1
        return Passage(xs, "", attempt.evaluations)

    def _first(self, system: System, parameters: Sequence[float], x0: Array, segment: Segment) -> float:
        """Return a first step in which x changes by about a hundredth of its value [s]."""
        slope = np.array(rates(system)(x0, segment.control(segment.stops[0]), parameters)).ravel()
        size = np.asarray(self.atol) + self.rtol * np.abs(x0)
        way, speed = np.max(np.abs(x0) / size), np.max(np.abs(slope) / size)
        guess = 1e-2 * way / speed if way > 1e-5 and speed > 1e-5 else 1e-4 * (segment.stops[-1] - segment.stops[0])
        return float(min(guess, segment.stops[-1] - segment.stops[0]))


class _Attempt:
    """One step function with its memory and its count."""

    def __init__(self, method: AdaptiveStep, system: System, parameters: Sequence[float]) -> None:
        self._rule, self._rtol, self._atol = method.rule, method.rtol, np.asarray(method.atol)
        self._run = Evaluation(attempt(method.rule, system))
        self._x, self._h, self._u, p = self._run.inputs
        p[:] = parameters
        self._nx = system.x.numel()
        self._varies = False
        self.evaluations = 0
        self.exhausted = False  # whether the steps between two stops ran out

    def follow(self, segment: Segment) -> None:
        """Use the control of another segment from now on."""
        self._control = segment.control
        self._varies = not (isinstance(segment.control, Polynomial) and len(segment.control.values) == 1)
        self._u[:] = np.tile(segment.control(segment.stops[0]), len(self._rule.nodes))

    @np.errstate(over="ignore", invalid="ignore")  # a step that is not finite is rejected
    def through(self, x: Array, t: float, stop: float, step: float) -> tuple[Array, float, float]:
        """Return the state and time reached, and a proposal for the next step."""
        new, errors, change, evaluations = self._run.outputs
        grow = GROW
        for _ in range(MOST_STEPS):
            if t >= stop:
                break
            h = stop - t if t + step * (1.0 + 1e-9) >= stop else step
            self._x[:], self._h[0] = x, h
            if self._varies:
                self._u[:] = self._control.sample(t + h * self._rule.nodes).ravel()
            self._run.call()
            self.evaluations += int(evaluations[0])
            size = self._atol + self._rtol * np.maximum(np.abs(x), np.abs(new))
            error = self._rule.error(np.max(np.abs(errors.reshape(-1, self._nx)) / size, axis=1))
            good = error <= 1.0 and change[0] <= ACCEPTED and bool(np.all(np.isfinite(new)))
            finite = np.isfinite(error) and change[0] <= ACCEPTED
            factor = SAFETY * error ** (-1.0 / self._rule.error_order) if error > 0.0 and finite else grow
            proposal = h * (min(max(factor, SHRINK), grow) if finite else SHRINK)
            if good:
                x, t = new.copy(), (stop if h == stop - t else t + h)
                proposal = max(proposal, step) if h < step else proposal  # h was cut short by the stop
            grow = GROW if good else 1.0
            step = proposal
            if step < 1e-14 * max(abs(t), abs(stop)):
                break
        else:
            self.exhausted = t < stop
        return x, t, step


@functools.lru_cache(maxsize=32)
def attempt(rule: Rule, system: System) -> ca.Function:
    """Return the function (x, h, u, p) -> (x_next, errors, change, evaluations) of one step, all dense.

    Args:
        rule: the one-step method.
        system: x' = f(x, u, p).
    """
    step = rule.step(system)
    given = step.mx_in()
    return ca.Function("attempt", given, [ca.densify(part) for part in step.call(given)])
