"""Drive torques of a given motion: Lagrange inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from models.manipulator import Manipulator
from models.mechanics import assemble
from models.terms import Effect
from ocp.system import System


def inverse_dynamics(machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return the drive torques of a motion, read off the Lagrange equations from left to right.

    tau = g(q) a + Gamma(q)(v, v) + dU/dq - (forces of effects)

    Nothing is inverted: the function exists at every configuration, singular ones included.

    Args:
        machine: from `cylindrical`, `spherical` or `torus`.
        effects: such as [Gravity()].

    Returns:
        Function (q, v, a, p) -> tau; q, v, a, tau of shape (n,) in rad or m, /s, /s^2, and N m or N along +q;
        p are the parameters that stay symbols, those of the machine first, then those of the effects in their order,
        as in the p of a form (often none: []).

    Raises:
        TypeError: no machine, or no effect.
        ValueError: an effect has states, so that q(t) alone does not fix the torques, or a parameter of the same name
            as one of the machine.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (3.1), (4.1), (5.3).
    """
    mechanics = assemble(machine, effects)
    if mechanics.terms.states:
        names = ", ".join(mechanics.terms.states)
        raise ValueError(f"q(t) alone does not fix the states {names}; solve for them in an optimal-control problem")
    q, v = machine.q, machine.v
    a = ca.vertcat(*(ca.SX.sym(f"a_{c.name}") for c in machine.coordinates))
    momentum = mechanics.metric @ v
    kinetic = ca.dot(v, momentum) / 2
    inertia = mechanics.metric @ a + ca.jtimes(momentum, q, v) - ca.gradient(kinetic, q)
    tau = inertia + ca.gradient(mechanics.potential, q)
    if mechanics.terms.force is not None:
        tau = tau - mechanics.terms.force
    parameters = mechanics.parameters
    p = ca.vertcat(*parameters.values()) if parameters else ca.SX(0, 1)
    names_in, names_out = ["q", "v", "a", "p"], ["tau"]
    return ca.Function("inverse_dynamics", [q, v, a, p], [ca.cse(ca.densify(tau))], names_in, names_out)


def recover(system: System, machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return position, velocity, acceleration and drive torques of a motion given as states of any form.

    v = v(x),  a = (dv/dx) x',  tau = inverse dynamics of (q, v, a): the equations of the form are not used.

    Args:
        system: a form of the machine with these effects.
        machine: the machine itself.
        effects: the same effects.

    Returns:
        Function (x, rate, p) -> (q, v, a, tau), rate = dx/dt along the motion; q, v, a, tau of shape (n,).

    Raises:
        TypeError, ValueError: as `inverse_dynamics`.
    """
    torques = inverse_dynamics(machine, effects)
    rate = ca.SX.sym("rate", system.x.numel())
    q, v = system["q"], system["v"]
    a = ca.jtimes(v, system.x, rate)
    inputs, outputs = [system.x, rate, system.p], [q, v, a, torques(q, v, a, system.p)]
    return ca.Function(
        "recover", inputs, ca.cse([ca.densify(o) for o in outputs]), ["x", "rate", "p"], ["q", "v", "a", "tau"]
    )
