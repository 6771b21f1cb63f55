"""Forward simulation of a System under a given control, to tolerances near rounding."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp.integration import integrate
from ocp.solution import OUTSIDE, Solution
from ocp.system import System

Array = np.ndarray
ControlOf = Callable[[float], Array]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of a simulated motion at given times."""

    t: Array  # (K,) [s]
    x: Array  # (K, nx); NaN from where the integration could not go on
    u: Array  # (K, nu) control, from the left at the ends of pieces
    message: str  # empty, or why the integration stopped
    system: System
    values: Mapping[str, float]

    @property
    def ok(self) -> bool:
        """Whether the integration reached the end."""
        return not self.message

    def signal(self, signal: str | ca.SX) -> Array:
        """Return a signal of the system, or an expression in x, u, p, at the times t, shape (K, m)."""
        system = self.system
        expression = system[signal] if isinstance(signal, str) else signal
        system.check_symbols("signal", expression)
        function = ca.Function("signal", [system.x, system.u, system.p], [ca.densify(ca.vec(expression))])
        p = np.tile(np.array(list(self.values.values()))[:, None], len(self.t))
        return np.array(function.map(len(self.t))(self.x.T, self.u.T, p)).T


def simulate(
    system: System,
    x0: Sequence[float] | Array,
    control: Solution | ControlOf | Sequence[float] | Array,
    times: Sequence[float] | Array | float,
    *,
    values: Mapping[str, float] | None = None,
    breaks: Sequence[float] = (),
    rtol: float = 1e-12,
    atol: float | Array = 1e-12,
) -> Trajectory:
    """Integrate x' = f(x, u(t), p) from x0 at t = 0, with steps of order 16 and an error control for each step.

    Args:
        system: x' = f(x, u, p).
        x0: (nx,) state at t = 0.
        control: (nu,) constant, a function t -> (nu,), or a Solution, whose control is used element by element.
        times: (K,) times to report [s], increasing, >= 0; or one duration, reported at 101 places.
        values: of parameters, by name; nominal where silent (those of the Solution if the control is one).
        breaks: times where a function jumps or has a kink [s]; the steps end there.
        rtol, atol: tolerance of one step; atol scalar or (nx,).

    Raises:
        ValueError: sizes disagree, times that do not increase, tolerances <= 0.

    Source: `ocp.integration.integrate` (Gragg-Bulirsch-Stoer).
    """
    start = np.array(x0, dtype=float).ravel()
    if len(start) != system.x.numel() or not np.all(np.isfinite(start)):
        raise ValueError(f"x0: got {start.tolist()}, expected {system.x.numel()} finite numbers")
    reported = np.array(times, dtype=float)
    if reported.ndim == 0 and not 0.0 < reported < np.inf:
        raise ValueError(f"times: got {times}, expected a duration > 0 s or increasing times >= 0 s")
    if reported.ndim == 0:
        reported = np.linspace(0.0, float(reported), 101)
    if len(reported) < 1 or not np.all(np.diff(reported) > 0.0) or not np.all(reported >= 0.0):
        shown = ", ".join(f"{t:g}" for t in np.atleast_1d(reported)[:6])
        raise ValueError(f"times: got {shown}{' ...' if len(reported) > 6 else ''}, expected increasing times >= 0 s")
    if isinstance(control, Solution) and reported[-1] > control.duration * (1.0 + OUTSIDE):
        raise ValueError(f"times: got {reported[-1]:g} s, the control lasts {control.duration:g} s")
    if np.size(atol) not in (1, len(start)):
        raise ValueError(f"atol: has {np.size(atol)} components, expected 1 or {len(start)}")
    if not (rtol > 0.0 and np.all(np.asarray(atol) > 0.0)):
        raise ValueError(f"rtol, atol: got {rtol}, {atol}, expected numbers > 0")
    if values is None and isinstance(control, Solution):
        values = control.values
    known = {name: value for name, value in (values or {}).items() if name in system.nominal}
    parameters = system.values(known if isinstance(control, Solution) else values)
    nu = system.u.numel()
    x = start
    xs, us = np.full((len(reported), len(start)), np.nan), np.full((len(reported), nu), np.nan)
    message, step = "", 0.0
    if reported[0] == 0.0:
        xs[0], us[0] = start, _first(control, nu)
    rate = _BufferedRate(system, parameters)
    for a, b, u in _pieces(control, reported[-1], breaks, nu):
        rate.follow(u)
        t = a
        for stop in [*reported[(reported > a) & (reported < b)], b]:
            done = integrate(rate, t, stop, x, rtol, atol, step)
            if done.reached < stop:
                message = f"the integration stopped at t = {done.reached:.9g} s: the step vanished or f is not finite"
                break
            t, x, step = stop, done.x, done.step
            place = np.searchsorted(reported, stop)
            if place < len(reported) and reported[place] == stop:
                xs[place], us[place] = x, u(stop)
        if message:
            break
    named = dict(zip(system.nominal, parameters, strict=True))
    return Trajectory(reported, xs, us, message, system, named)


def _pieces(
    control: Solution | ControlOf | Sequence[float] | Array, end: float, breaks: Sequence[float], nu: int
) -> Iterator[tuple[float, float, ControlOf]]:
    """Yield (from, to, u) for the intervals on which the control is smooth."""
    if isinstance(control, Solution):
        for k, (a, b) in enumerate(zip(control.nodes[:-1], control.nodes[1:], strict=True)):
            if a < end:
                yield a, min(b, end), _on_element(control, k, a, b)
        return
    if callable(control):
        function: ControlOf = control
    else:
        constant = _first(control, nu)

        def function(_: float) -> Array:
            return constant

    _first(function, nu)
    inner = sorted({float(b) for b in breaks if 0.0 < b < end})
    marks = [0.0, *inner, end]
    for a, b in pairwise(marks):
        yield a, b, _inside(function, a, b) if inner else function


def _first(control: Solution | ControlOf | Sequence[float] | Array, nu: int) -> Array:
    """Return the control at t = 0."""
    if isinstance(control, Solution):
        return control.u(0.0)
    value = control(0.0) if callable(control) else control
    if np.size(value) != nu:
        raise ValueError(f"control: got {np.size(value)} numbers, expected {nu}")
    return np.array(value, dtype=float).ravel()


def _inside(function: ControlOf, a: float, b: float) -> ControlOf:
    """Return u(t) as seen from inside (a, b), so that a jump at a or b is not mixed into the piece."""
    nudge = 1e-12 * (b - a)
    return lambda t: np.asarray(function(min(max(t, a + nudge), b - nudge)), dtype=float)


def _on_element(solution: Solution, k: int, a: float, b: float) -> ControlOf:
    unknowns = solution.controls[k]
    if len(unknowns) == 1:
        return lambda t: unknowns[0]
    return lambda t: (solution.scheme.control_at(np.array([(t - a) / (b - a)])) @ unknowns)[0]


class _BufferedRate:
    """f(t, x) on numpy arrays, evaluated by CasADi on memory that this object owns."""

    def __init__(self, system: System, parameters: Sequence[float]) -> None:
        self._u: ControlOf = lambda _: np.zeros(system.u.numel())
        self._function = ca.Function("rate", [system.x, system.u, system.p], [ca.densify(system.rate)])
        self._memory = [np.zeros(system.x.numel()), np.zeros(system.u.numel()), np.array(parameters, dtype=float)]
        self._out = np.zeros(system.x.numel())
        # The buffer keeps bare pointers: it, the function and the arrays must live as long as the call.
        self._buffer, self._call = self._function.buffer()
        for i, array in enumerate(self._memory):
            if array.size:
                self._buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type,call-arg]
        self._buffer.set_res(0, memoryview(self._out))  # type: ignore[arg-type,call-arg]

    def follow(self, u: ControlOf) -> None:
        """Use another control from now on."""
        self._u = u

    def __call__(self, t: float, state: Array) -> Array:
        self._memory[0][:] = state
        self._memory[1][:] = self._u(t)
        self._call()
        return self._out.copy()
