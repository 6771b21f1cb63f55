"""The torques of a motion, split into what the bare machine and what every effect asks for."""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca

from models.manipulator import Body, Manipulator
from models.terms import Effect, Terms

INERTIA, CENTRIFUGAL = "inertia", "coriolis"


def contributions(machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return the parts of the drive torques: inertia, Coriolis and centrifugal, and one for every effect.

    tau = g a  +  (g' v - dT/dq)  +  sum over effects of what each adds to those before it

    The parts are formed term by term, not as differences of large torques. A field acts on the masses that are there
    when it comes, and a mass in the field that is there when it comes: of Gravity() and Payload(m) the later one
    bears the weight of the load.

    Args:
        machine, effects: as in `inverse_dynamics`.

    Returns:
        Function (q, v, a, p) -> (inertia, coriolis, one output (n,) for each effect, named after its class).
    """
    q, v = machine.q, machine.v
    a = ca.vertcat(*(ca.SX.sym(f"a_{c.name}") for c in machine.coordinates))
    parts = {INERTIA: machine.metric @ a, CENTRIFUGAL: _velocity_forces(machine.metric, q, v)}
    total, symbols = Terms(), dict(machine.symbols)
    for effect in effects:
        own = effect(machine, total)
        parts[_name(effect, parts)] = _torque(machine, total, own, a)
        symbols |= own.symbols
        total = total + own
    p = ca.vertcat(*symbols.values()) if symbols else ca.SX(0, 1)
    outputs = [ca.densify(part) for part in parts.values()]
    return ca.Function("contributions", [q, v, a, p], ca.cse(outputs), ["q", "v", "a", "p"], list(parts))


def _torque(machine: Manipulator, before: Terms, own: Terms, a: ca.SX) -> ca.SX:
    """Return what the terms of one effect ask of the drives (n,)."""
    q, v, n = machine.q, machine.v, machine.q.numel()
    potential = own.potential
    if own.acceleration is not None:
        potential = potential + _weight((*machine.bodies, *before.bodies, *own.bodies), own.acceleration)
    if before.acceleration is not None:
        potential = potential + _weight(own.bodies, before.acceleration)
    torque = ca.SX(n, 1) + ca.gradient(potential, q)
    if own.metric is not None:
        torque = torque + own.metric @ a + _velocity_forces(own.metric, q, v)
    return torque if own.force is None else torque - own.force


def _weight(bodies: Sequence[Body], field: ca.SX) -> ca.SX:
    return sum((body.mass * ca.dot(-field, body.centre) for body in bodies), ca.SX(0))


def _velocity_forces(metric: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    momentum = metric @ v
    return ca.jtimes(momentum, q, v) - ca.gradient(ca.dot(v, momentum) / 2, q)


def _name(effect: Effect, taken: dict[str, ca.SX]) -> str:
    """Return a name for the part of an effect, numbered if there are two of a kind."""
    kind = getattr(effect, "__name__", type(effect).__name__)
    base = re.sub(r"\W+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind)).strip("_").lower() or "effect"
    number = 2
    name = base
    while name in taken:
        name, number = f"{base}_{number}", number + 1
    return name
