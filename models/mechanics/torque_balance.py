"""Torques of the joints for given accelerations, as an expression: inverse dynamics with the forces of effects."""

from __future__ import annotations

import casadi as ca

from models.mechanics.mechanics import Mechanics


def joint_torques(mechanics: Mechanics, a: ca.SX) -> ca.SX:
    """Return tau (n,) as an expression in q, v, the accelerations a (n,), parameters and the clock.

    Raises:
        ValueError: the force of an effect depends on a state other than the clock, or on the drives.
    """
    q, v = mechanics.machine.q, mechanics.machine.v
    force = mechanics.applied
    fixed = ca.vertcat(q, v, parameters(mechanics), clock(mechanics))
    known = {symbol.element_hash() for symbol in ca.vertsplit(fixed)}
    free = [str(symbol) for symbol in ca.symvar(force) if symbol.element_hash() not in known]
    if free:
        raise ValueError(
            f"forces of effects depend on {', '.join(free)}, which q(t) alone does not fix; "
            "solve for the torques in an optimal-control problem"
        )
    return mechanics.inverse_dynamics(a) - force


def parameters(mechanics: Mechanics) -> ca.SX:
    """Return the parameters that stay symbols as a column, perhaps empty."""
    symbols = mechanics.parameters
    return ca.vertcat(*symbols.values()) if symbols else ca.SX(0, 1)


def clock(mechanics: Mechanics) -> ca.SX:
    """Return the symbol of the time, or nothing if no effect is a function of it."""
    states = mechanics.terms.states
    return states["time"].symbol if "time" in states else ca.SX(0, 1)
