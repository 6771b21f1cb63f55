"""Drive torques of a motion as a sum of parts: inertia, Coriolis forces, and one part for each effect."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import Mechanics, assemble
from models.mechanics.partials import inertial
from models.mechanics.terms import Effect, Part
from models.mechanics.torque_balance import clock, joint_torques, parameters
from models.torques.torque_functions import derivative


def split_torques(machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return the drive torques of a motion, split into parts that sum up to the inverse dynamics.

    "inertia": g(q) a and "coriolis": Gamma(q)(v, v), Coriolis and centrifugal forces, of the machine itself; then one
    part for each effect that acts on the joints, under its name ("gravity", "payload", "coulomb", "rotor_inertia", ...;
    "viscous_2" for a second one). A load has its own inertia, Coriolis forces and weight; gravity has the weight of the
    machine.

    Args:
        machine: from `cylindrical`, `spherical` or `torus`.
        effects: such as [Gravity(), Payload(5.0)].

    Returns:
        Function (q, v, a, p) -> the named parts, (n,) each [N m or N along +q]; p as for `inverse_dynamics`, with a
        fifth input t [s] if an effect is a function of time.

    Raises:
        TypeError, ValueError: as `inverse_dynamics`.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (3.1), (4.1), (5.3).
    """
    mechanics = assemble(machine, effects)
    a = derivative(machine, "a")
    whole = joint_torques(mechanics, a)
    own = machine.metric @ a
    if machine.recursion is None:
        whole_motion = inertial(machine.metric, machine.q, machine.v, a)
    else:
        whole_motion = machine.recursion.inverse_dynamics(machine.v, a, ca.SX(3, 1))
    parts = {"inertia": own, "coriolis": whole_motion - own}
    for part in mechanics.parts:
        share = _share(mechanics, part, a)
        if share is not None:
            parts[part.name] = share
    inputs, names = [machine.q, machine.v, a, parameters(mechanics)], ["q", "v", "a", "p"]
    if ca.depends_on(whole, clock(mechanics)):
        inputs, names = [*inputs, clock(mechanics)], [*names, "t"]
    outputs = ca.cse([ca.densify(part) for part in parts.values()])
    return ca.Function("split_torques", inputs, outputs, names, list(parts))


def _share(mechanics: Mechanics, part: Part, a: ca.SX) -> ca.SX | None:
    """Return the torque (n,) that the drives need because of an effect; None if it does not act on the joints."""
    q, v, terms = mechanics.machine.q, mechanics.machine.v, part.terms
    field, potential = mechanics.terms.acceleration, terms.potential
    if terms.acceleration is not None:
        for body in mechanics.machine.bodies:
            potential += body.mass * ca.dot(-terms.acceleration, body.centre)
    if field is not None:
        for body in terms.bodies:
            potential += body.mass * ca.dot(-field, body.centre)
    share = ca.gradient(potential, q) if ca.depends_on(potential, q) else ca.SX(*q.shape)
    recursion = mechanics.machine.recursion
    if recursion is not None and (terms.loads or terms.spins is not None):
        more = recursion.loaded(terms.loads).with_rotors(ca.SX(q.numel(), q.numel()), terms.spins)
        weight = ca.SX(3, 1) if field is None else field
        share = share + more.inverse_dynamics(v, a, weight) - recursion.inverse_dynamics(v, a, weight)
    if terms.metric is not None:
        share = share + inertial(terms.metric, q, v, a)
    if terms.force is not None:
        share = share - mechanics.resolved(terms.force)
    return share if ca.sparsify(share).nnz() else None
