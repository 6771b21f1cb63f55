"""Inverse form: the state is (q, v), the control the acceleration; the drive torques follow by inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from models.forms.state_space import Accelerations, Equations, as_system
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import Mechanics, assemble
from models.mechanics.terms import Effect, Quantity
from models.mechanics.torque_balance import joint_torques
from ocp import checks
from ocp.system import System


def inverse(machine: Manipulator, effects: Sequence[Effect] = (), frame: str | Frame | None = None) -> System:
    """Return the equations of motion with the accelerations as controls and the drive torques as signals.

    q' = v,  v' = a,  x = [q; v], u = a,
    tau = g(q) a + Gamma(q)(v, v) + dU/dq - (forces of effects)

    Limits of tau become constraints along the motion. No matrix is inverted, and stiff forces, such as dry friction
    with a narrow transition or a light wrist behind fast drives, do not make the equations stiff: they enter tau only.
    With constant accelerations on each element, the default, speeds are piecewise linear and their limits hold
    everywhere. A motion is optimal among those whose accelerations have the shape of the control on each element.

    Args:
        machine: any machine or arm.
        effects: such as [Gravity(), Coulomb(3.0)]; not the ones whose drives have states or whose joints yield
            (ElasticDrive, LaggedDrive, TorqueRate, MotorDrive with an inductance), and no limit of the jerk.
        frame: None or "coordinate".

    Raises:
        TypeError: no machine, or no effect.
        ValueError: a frame, or an effect for which (q, v, a) do not determine the torques of the drives.

    Source: the left-hand side of P. Maisser, Modellgleichungen fuer Manipulatoren, (3.1), (4.1), (5.3); as a
        constraint of the optimal-control problem: H. Ferrolho et al., Inverse dynamics vs. forward dynamics in
        direct transcription formulations for trajectory optimization, ICRA 2021.
    """
    if frame is not None and not (isinstance(frame, str) and frame == "coordinate"):
        wanted = "expected None or 'coordinate': the control is the acceleration of the coordinates"
        raise ValueError(f"inverse: frame is {checks.shown(frame)}, {wanted}")
    mechanics = assemble(machine, effects)
    coordinates = machine.coordinates
    names = tuple(f"d2{c.name}/dt2" for c in coordinates)
    a = Quantity(
        ca.vertcat(*(ca.SX.sym(f"a_{c.name}") for c in coordinates)), tuple(f"{c.unit}/s^2" for c in coordinates), names
    )
    drives = _drives(mechanics, a.expression)

    def equations(mechanics: Mechanics) -> Equations:
        v, recursion = machine.v, mechanics.recursion
        kinetic = None if recursion is None else ca.dot(v, recursion.momentum(v)) / 2
        count = ca.Function("tau", ca.symvar(drives), [ca.cse(ca.densify(drives))]).n_instructions()
        note = f"torques by inverse dynamics, {count} instructions"
        return Equations(
            mechanics.frame("coordinate"), v, v, v, a.expression, kinetic, (note,),
            accelerations=Accelerations(a, drives),
        )  # fmt: skip

    return as_system(mechanics, equations)


def _drives(mechanics: Mechanics, a: ca.SX) -> ca.SX:
    """Return the control of the drives (n,) that causes the accelerations a (n,).

    Raises:
        ValueError: the drives have states, or a limit of the jerk needs the rate of the accelerations.
    """
    terms = mechanics.terms
    for read in terms.reads:
        if read.name == "jerk":
            raise ValueError(
                f"inverse: {read.reader} limits the jerk, but the accelerations, which are the controls, may jump; use "
                f"canonical with {read.cure}"
            )

    owner = terms.defines.get("transmission") or terms.defines.get("drives")
    refused = ValueError(
        f"inverse: {owner} has states of its own, which q, v and the acceleration do not determine; use canonical"
    )

    def rate(expression: ca.SX) -> ca.SX:
        raise refused

    tau = joint_torques(mechanics, a)
    v = mechanics.machine.v
    if terms.transmission is not None:
        if any(not ca.depends_on(mechanics.machine.q, symbol) for symbol in ca.symvar(terms.transmission.motor_q)):
            raise refused  # elastic joints, damped or not
        _, v, tau = terms.transmission.invert(tau, rate)
    if terms.source is not None:
        tau = next(iter(terms.source.invert(tau, v, rate).values())).expression
    return ca.cse(ca.densify(tau))
