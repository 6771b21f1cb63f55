"""Dynamic extension: the control becomes a state and its rate the control, for rate and jerk limits."""

from __future__ import annotations

import casadi as ca

from ocp import checks
from ocp.system import Label, System


def extend(system: System) -> System:
    """Return the system with x = [x; u] and the rate of u as control, u' = du.

    A limit on the signal "du" limits how fast the old control changes, exactly; with constant controls on an element
    the old control is continuous and piecewise linear. Extend twice to limit the second rate.

    Args:
        system: x' = f(x, u, p).

    Returns:
        The extended system, with all old signals and "du" (nu,), the rate of the old control.

    Raises:
        ValueError: the system has no control, or has been extended three times.

    Source: Isidori, Nonlinear Control Systems, 5.4 (dynamic extension).
    """
    checks.instance("system", system, System, "a System")
    nu = system.u.numel()
    if nu == 0:
        raise ValueError("extend: the system has no control")
    name = next((name for name in ("du", "d2u", "d3u") if name not in system.signals), None)
    if name is None:
        raise ValueError("extend: the system has been extended three times already")
    rate = ca.SX.sym(name, nu)
    old = system.label("u", nu)
    faster = tuple(Label(f"d{label.name}/dt", f"{label.unit}/s" if label.unit else "") for label in old)
    x, implicit = ca.vertcat(system.x, system.u), system.implicit
    if implicit is not None:
        implicit = implicit.extended((system.x, system.u), (x, rate), system.p, rate)
    return System(
        x=x,
        u=rate,
        p=system.p,
        rate=ca.vertcat(system.rate, rate),
        signals={**system.signals, name: rate},
        nominal=system.nominal,
        labels={
            **system.labels,
            "x": (*system.label("x", system.x.numel()), *old),
            "u": faster,
            name: faster,
        },
        notes=(*system.notes, f"extended: the control is the rate {name!r}"),
        limits=system.limits,
        initial=system.initial,
        singular=system.singular,
        implicit=implicit,
        t=system.t,
    )


def time_derivative(system: System, expression: ca.SX) -> ca.SX:
    """Return d(expression)/dt along the motion, (d expression / dx) f.

    The jerk of a mechanism whose drives are limited in rate is the second derivative of its velocity, in the
    extended system: time_derivative(e, time_derivative(e, e["v"])).

    Args:
        system: x' = f(x, u, p).
        expression: (m,) in x and p.

    Raises:
        ValueError: the expression depends on the control, whose rate is unknown; extend the system first.
    """
    checks.instance("system", system, System, "a System")
    system.check_symbols("time_derivative", expression)
    if ca.depends_on(expression, system.u):
        raise ValueError("time_derivative: the expression depends on the control, whose rate is no state; use extend")
    return ca.jtimes(expression, system.x, system.rate)
