"""Friction of the joints as the data of a robot state it."""

from __future__ import annotations

from models.effects.friction import Coulomb, Viscous
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from ocp import checks


def joint_friction(machine: Manipulator, width: float = 0.02) -> tuple[Effect, ...]:
    """Return the friction that a robot file or a data sheet states, as effects; none of it acts unless asked for.

    Args:
        machine: with damping and dry friction of its joints, such as from_urdf(...) or robots.puma560().
        width: speed of smoothing of the dry friction > 0 [rad/s or m/s].

    Raises:
        ValueError: the machine states no friction.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as robots.puma560()")
    if not any(machine.damping) and not any(machine.friction):
        raise ValueError(f"machine: {machine.name} states no friction of its joints; give Viscous(...) or Coulomb(...)")
    effects: list[Effect] = []
    if any(machine.damping):
        effects.append(Viscous(machine.damping))
    if any(machine.friction):
        effects.append(Coulomb(machine.friction, width))
    return tuple(effects)
