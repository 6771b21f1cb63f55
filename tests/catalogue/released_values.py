"""Values of release 0.1.0 whose digests stand in tests/studies/data/digests.json, computed by that release."""

from models import Parameter, cylindrical, spherical, torus
from models.effects import Coulomb, Gravity, Payload, PowerLimit, RotorInertia, ToolForce, TorqueSpeed, Viscous
from models.forms import canonical, hamel, lagrange
from ocp import (
    Ball,
    Bolza,
    Box,
    CoarseGrid,
    Fixed,
    Free,
    Ipopt,
    Label,
    Seconds,
    Share,
    Smooth,
    StraightLine,
    WiderLimits,
    integrators,
    legendre,
    lobatto,
    point_to_point,
    radau,
    uniform,
)  # fmt: skip


def values():
    """Return name -> value."""
    plain = (
        Gravity(), Viscous(0.5), Coulomb([1.0] * 4), Payload(1.0), RotorInertia(0.1), TorqueSpeed([1.0], [2.0]),
        PowerLimit(3.0), ToolForce([1, 0, 0]), radau(3), lobatto(3), legendre(2), uniform(5), Ipopt(), Free(),
        Fixed(1.0), Bolza(time=1.0), Smooth(), CoarseGrid(), StraightLine(), WiderLimits(), Ball([0, 0, 0], 1.0),
        Box([0, 0, 0], [1, 1, 1]), Label("a", "b"), Seconds(1.0), Share(1e-3), integrators.gauss(2, 0.1),
        integrators.extrapolation(), integrators.radau_5(), cylindrical(), spherical(m_3=Parameter(12.0)), torus(),
    )  # fmt: skip
    named = {f"{k} {type(value).__name__}": value for k, value in enumerate(plain)}
    for form in (canonical, hamel, lagrange):
        named[f"{form.__name__} torus"] = form(torus(), [Gravity()])
        arm = form(cylindrical(), [Gravity(), Viscous(0.2)])
        named[f"{form.__name__} task"] = point_to_point(arm, [0, 0.2, 0.6], [1, 0.5, 0.7], tau=[160, 1100, 320])
    return named
