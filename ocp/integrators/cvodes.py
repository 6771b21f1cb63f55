"""Multistep methods of variable order and step: CVODES of SUNDIALS, through CasADi."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.integrators.contracts import Passage, check_components, check_tolerances, stopped
from ocp.integrators.control_segments import ControlOf, Polynomial, Segment
from ocp.integrators.stiffness import Linearisation, describe
from ocp.numerics.rate_functions import rates
from ocp.system import System

MOST_STEPS = 100_000  # between two stops


class Multistep(Enum):
    """Family of formulae; the value is the name that CVODES uses."""

    BDF = "bdf"  # backward differentiation, orders 1 to 5: stiff systems, but oscillations are damped or unstable
    ADAMS = "adams"  # Adams-Moulton, orders 1 to 12: systems that are not stiff


@dataclass(frozen=True, eq=False)
class Cvodes:
    """CVODES with exact Jacobians. It starts anew, with order 1, at every jump of the control.

    Args:
        family: of formulae.
        rtol, atol: tolerance of one step; atol scalar or (nx,).
        extra: further options of CasADi's integrator "cvodes", by their names there.

    Raises:
        ValueError: a tolerance <= 0.
        TypeError: family is no member of Multistep.

    Source: A. C. Hindmarsh et al., SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers, ACM
        Trans. Math. Software 31 (2005).
    """

    family: Multistep = Multistep.ADAMS
    rtol: float = 1e-9
    atol: float | Array = 1e-9
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_tolerances(self.rtol, self.atol)
        if not isinstance(self.family, Multistep):
            raise TypeError(f"family: got {self.family!r}, expected {', '.join(map(str, Multistep))}")

    def march(self, system: System, parameters: Sequence[float], x0: Array, segments: Sequence[Segment]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all segments; see `ocp.integrators.contracts.Method`."""
        check_components(self.atol, len(x0))
        xs = np.full((sum(len(segment.stops) - 1 for segment in segments), len(x0)), np.nan)
        made: dict[tuple[object, ...], ca.Function] = {}
        x, row, evaluations = x0, 0, 0
        for segment in segments:
            for stops in (segment.stops, *(() if len(segment.stops) == 2 else _pairs(segment.stops))):
                whole = stops is segment.stops
                result, calls, flag = self._over(made, system, parameters, x, stops, segment)
                evaluations += calls
                if result is None and whole and len(stops) > 2:
                    continue  # again from stop to stop, to keep the part that can be reached
                if result is None:
                    reason = f"CVODES did not reach {stops[-1]:.9g} s from there"
                    if "TOO_MUCH_WORK" in flag:
                        mode = describe(Linearisation(system, parameters).fastest(x, segment.control(stops[0])))
                        reason += f": {MOST_STEPS} steps were not enough{mode}"
                    return Passage(xs, stopped(float(stops[0]), reason), evaluations)
                xs[row : row + len(result)] = result
                x, row = result[-1], row + len(result)
                if whole:
                    break
        return Passage(xs, "", evaluations)

    def _over(
        self, made: dict[tuple[object, ...], ca.Function], system: System, parameters: Sequence[float], x: Array,
        stops: Array, segment: Segment,
    ) -> tuple[Array | None, int, str]:  # fmt: skip
        """Return the states at all stops but the first (None for a failure), evaluations, and the message of CVODES."""
        start, width = float(stops[0]), float(stops[-1] - stops[0])
        shares = tuple(((stops[1:] - start) / width).tolist())
        if isinstance(segment.control, Polynomial):
            shape: Polynomial | _Called = segment.control
            key: tuple[object, ...] = (shares, len(segment.control.values))
            values = segment.control.values
            share = [(start - segment.control.start) / segment.control.width, width / segment.control.width]
        else:
            shape = _Called("control", segment.control, system.u.numel())
            key, values, share = (shares, id(segment.control)), np.zeros((0, system.u.numel())), [start, width]
        if key not in made:
            made[key] = self._integrator(system, shape, shares)
        integrator = made[key]
        scale = np.broadcast_to(np.asarray(self.atol, dtype=float), len(x))
        try:
            end = integrator(
                x0=x / scale, p=np.concatenate([parameters, values.ravel(order="F"), share, [width], scale])
            )
            result = np.array(end["xf"]).T * scale
        except RuntimeError as error:
            return None, int(integrator.stats()["nfevals"]), str(error)
        good = bool(np.all(np.isfinite(result)))
        return result if good else None, int(integrator.stats()["nfevals"]), ""

    def _integrator(self, system: System, shape: Polynomial | _Called, shares: tuple[float, ...]) -> ca.Function:
        """Return the integrator over tau in [0, 1], in states of the size of their absolute tolerance."""
        nx, nu, np_ = system.x.numel(), system.u.numel(), system.p.numel()
        count = len(shape.values) if isinstance(shape, Polynomial) else 0
        tau, x, p = ca.MX.sym("tau"), ca.MX.sym("x", nx), ca.MX.sym("p", np_)
        values, share, width = ca.MX.sym("values", count, nu), ca.MX.sym("share", 2), ca.MX.sym("width")
        scale = ca.MX.sym("scale", nx)
        at = share[0] + share[1] * tau
        u = shape.expression(at, values) if isinstance(shape, Polynomial) else shape(at)
        equations: Any = {
            "t": tau, "x": x, "p": ca.vertcat(p, ca.vec(values), share, width, scale),
            "ode": width * rates(system)(scale * x, u, p) / scale,
        }  # fmt: skip
        options: dict[str, Any] = {
            "linear_multistep_method": self.family.value, "reltol": self.rtol, "abstol": 1.0,
            "max_num_steps": MOST_STEPS, "disable_internal_warnings": True, "show_eval_warnings": False,
        }  # fmt: skip
        made: ca.Function = ca.integrator("cvodes", "cvodes", equations, 0.0, list(shares), {**options, **self.extra})
        return made


def _pairs(stops: Array) -> list[Array]:
    return [stops[k : k + 2] for k in range(len(stops) - 1)]


class _Called(ca.Callback):
    """A control given in Python, as a function that CVODES can call."""

    def __init__(self, name: str, control: ControlOf, nu: int) -> None:
        ca.Callback.__init__(self)
        self._control, self._nu = control, nu
        self.construct(name, {})

    def get_n_in(self) -> int:
        return 1

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(1, 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._nu, 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        return [ca.DM(self._control(float(arguments[0])))]
