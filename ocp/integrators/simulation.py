"""Forward simulation of a System under a given control, by any integrator; to tolerances near rounding by default."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.integrators.contracts import Method, Passage, check_components, check_tolerances, stopped
from ocp.integrators.control_segments import Controls, Segment, at_start, segments
from ocp.integrators.gragg_bulirsch_stoer import Extrapolation
from ocp.numerics.rate_functions import rates
from ocp.problem.singularities import between, meeting
from ocp.solution.solution import OUTSIDE, Solution
from ocp.system import System

WATCHED = 100  # least number of intervals that are checked for a singularity that a step may cross


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of a simulated motion at given times."""

    t: Array  # (K,) [s]
    x: Array  # (K, nx); NaN from where the integration could not go on
    u: Array  # (K, nu) control, from the left at the ends of segments
    message: str  # empty, or why the integration stopped
    system: System
    values: Mapping[str, float]
    evaluations: int = 0  # of f, those of rejected steps included

    @property
    def ok(self) -> bool:
        """Whether the integration reached the end."""
        return not self.message

    def signal(self, signal: str | ca.SX) -> Array:
        """Return a signal of the system, or an expression in x, u, p, at the times t, shape (K, m)."""
        system = self.system
        checks.instance("signal", signal, str | ca.SX, "the name of a signal or an expression")
        expression = system[signal] if isinstance(signal, str) else signal
        system.check_symbols("signal", expression)
        function = ca.Function("signal", [system.x, system.u, system.p], [ca.densify(ca.vec(expression))])
        p = np.tile(np.array(system.values(self.values))[:, None], len(self.t))
        return np.array(function.map(len(self.t))(self.x.T, self.u.T, p)).T


def simulate(
    system: System,
    x0: Sequence[float] | Array,
    control: Controls,
    times: Sequence[float] | Array | float,
    *,
    values: Mapping[str, float] | None = None,
    breaks: Sequence[float] = (),
    method: Method | None = None,
    rtol: float | None = None,
    atol: float | Array | None = None,
) -> Trajectory:
    """Integrate x' = f(x, u(t), p) from x0 at t = 0; by default with steps of order 16, an error control for each.

    A motion ends where it meets a singularity of the system, and the message names it. If a step may cross one, the
    integration stops at least 100 times to check, whatever times are reported.

    Args:
        system: x' = f(x, u, p).
        x0: (nx,) state at t = 0; the time, if it is a state, may be left out.
        control: (nu,) constant, a function t -> (nu,), or a Solution, whose control is used element by element.
        times: (K,) times to report [s], increasing, >= 0; or one duration, reported at 101 points.
        values: of parameters, by name; nominal where silent (those of the Solution if the control is one).
        breaks: times where a function jumps or has a kink [s]; the steps end there.
        method: from `ocp.integrators`, such as `gauss(2, step=1e-3)`; None is `extrapolation()`.
        rtol, atol: tolerance of one step, in place of those of the method; atol scalar or (nx,).

    Raises:
        ValueError: sizes disagree, times that do not increase, tolerances <= 0 or for a method without error control,
            a method that does not apply to the system.
        TypeError: method is no integrator.
    """
    checks.instance("system", system, System, "a System")
    start, reported = _initial_state(system, x0), _times(times, control)
    chosen = _with_tolerances(Extrapolation() if method is None else method, rtol, atol, len(start))
    parameters = _parameters(system, control, values)
    inner = checks.points("breaks", breaks, "times in s where the control jumps")
    nu, known = system.u.numel(), dict(zip(system.nominal, parameters, strict=True))
    xs, us = np.full((len(reported), len(start)), np.nan), np.full((len(reported), nu), np.nan)
    singular = meeting(system, start[None], parameters)
    if singular:
        message = f"the integration did not start: {singular.words}"
        return Trajectory(reported, xs, us, message, system, known)
    if reported[0] == 0.0:
        xs[0], us[0] = start, at_start(control, nu)
    parts = tuple(segments(control, _stops(system, reported, chosen), inner, nu))
    with np.errstate(over="ignore", invalid="ignore"):  # the message reports an overflow
        passage = chosen.march(system, parameters, start, parts)
    row = 0
    for segment in parts:
        for stop in segment.stops[1:]:
            k = np.searchsorted(reported, stop)
            if k < len(reported) and reported[k] == stop and not np.isnan(passage.x[row, 0]):
                xs[k], us[k] = passage.x[row], segment.control(stop)
            row += 1
    message = passage.message
    met = _met(system, parameters, start, parts, passage) if system.singular else None
    if met is not None:
        time, words = met
        xs[reported >= time], us[reported >= time] = np.nan, np.nan
        message = stopped(time, words)
    return Trajectory(reported, xs, us, message, system, known, passage.evaluations)


def _initial_state(system: System, x0: Sequence[float] | Array) -> Array:
    wanted = f"{system.x.numel()} finite numbers"
    start = checks.numbers("x0", np.ravel(x0).tolist() if isinstance(x0, np.ndarray) else x0, wanted).ravel()
    if system.t is not None and len(start) == system.x.numel() - 1:
        start = np.insert(start, system.clock, 0.0)
    if len(start) != system.x.numel():
        raise checks.refused("x0", x0, wanted)
    return start


def _times(times: Sequence[float] | Array | float, control: Controls) -> Array:
    """Return the times to report (K,) [s]; 101 for a single duration."""
    wanted = "a duration > 0 s or increasing times >= 0 s"
    reported = checks.numbers("times", times, wanted).copy()
    if reported.ndim == 0 and not 0.0 < reported < np.inf:
        raise ValueError(f"times: got {times}, expected {wanted}")
    if reported.ndim == 0:
        reported = np.linspace(0.0, float(reported), 101)
    if reported.ndim != 1 or len(reported) < 1 or not np.all(np.diff(reported) > 0.0) or not np.all(reported >= 0.0):
        raise checks.refused("times", times, wanted)
    if isinstance(control, Solution) and reported[-1] > control.duration * (1.0 + OUTSIDE):
        raise ValueError(f"times: got {reported[-1]:g} s, the control lasts {control.duration:g} s")
    return reported


def _parameters(system: System, control: Controls, values: Mapping[str, float] | None) -> list[float]:
    """Return parameter values: those given, else those of a solution whose control is used, else nominal ones."""
    if values is None and isinstance(control, Solution):
        values = control.values
    if values is not None:
        checks.mapping("values", values, "a dict parameter name -> number, or None")
    known = {name: value for name, value in (values or {}).items() if name in system.nominal}
    return system.values(known if isinstance(control, Solution) else values)


def _stops(system: System, reported: Array, method: Method) -> Array:
    """Return the times to report, with those at which a motion is looked at for singularities it may step over."""
    end = float(reported[-1])
    if len(reported) >= WATCHED or not any(singularity.crossed for singularity in system.singular) or end == 0.0:
        return reported
    step = getattr(method, "step", end / WATCHED)
    every = np.arange(1, int(end / step) + 1) * step
    return np.union1d(reported, every[every < end * (1.0 - 1e-9)])


def _met(
    system: System, parameters: Sequence[float], start: Array, parts: Sequence[Segment], passage: Passage
) -> tuple[float, str] | None:
    """Return the time [s] at which an integrated motion meets a singularity, with the message, or None.

    A motion that stopped is extended in a straight line to the next stop, to find the singularity that stopped it.
    """
    x, row = start, 0
    for segment in parts:
        count = len(segment.stops) - 1
        path = np.vstack([x, passage.x[row : row + count]])
        good = np.all(np.isfinite(path), axis=1)
        reached = len(path) if good.all() else int(np.argmin(good))
        u = segment.control.sample(segment.stops[:reached])
        t, fine = between(system, segment.stops[:reached], path[:reached], u, parameters)
        if reached < len(path):
            ahead = np.linspace(0.0, segment.stops[reached] - segment.stops[reached - 1], WATCHED)[1:, None]
            slope = np.array(rates(system)(path[reached - 1], u[-1], parameters)).T
            t, fine = np.append(t, t[-1] + ahead), np.vstack([fine, path[reached - 1] + ahead * slope])
        result = meeting(system, fine, parameters)
        if result:
            return float(t[result.row]), result.words
        if reached < len(path):
            return None
        x, row = path[-1], row + count
    return None


def _with_tolerances(method: Method, rtol: float | None, atol: float | Array | None, nx: int) -> Method:
    """Return the method with the tolerances that are not None in place of its own."""
    if isinstance(method, type) or not callable(getattr(method, "march", None)):
        given_method = checks.shown(method)
        raise TypeError(
            f"method: got {given_method}, expected an integrator such as ocp.integrators.runge_kutta_4(1e-3)"
        )
    given = {name: value for name, value in (("rtol", rtol), ("atol", atol)) if value is not None}
    if not given:
        return method
    if not hasattr(method, "rtol"):
        raise ValueError(f"{', '.join(given)}: {method!r} has no error control; its accuracy is that of its step")
    check_components(given.get("atol", 1.0), nx)
    check_tolerances(given.get("rtol", 1.0), given.get("atol", 1.0))
    return replace(method, **given)  # type: ignore[type-var]
