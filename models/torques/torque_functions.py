"""Inverse dynamics as CasADi functions: torques of the joints, and the quantities of motors and drives behind them."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from models.mechanics.torque_balance import clock, joint_torques, parameters
from ocp import checks
from ocp.checks import Array
from ocp.system import System

# Time derivatives of the position, in the order of the inputs of `drive_dynamics`.
DERIVATIVES = ("q", "v", "a", "jerk", "snap", "crackle")


def inverse_dynamics(machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return the drive torques of a motion: the left-hand side of the Lagrange equations.

    tau = g(q) a + Gamma(q)(v, v) + dU/dq - (forces of effects)

    tau is the force on the joints, whatever the drives are; `drive_dynamics` gives those of the motors. No matrix is
    inverted, so that the function is defined in every position, singular ones included.

    Args:
        machine: from `cylindrical`, `spherical` or `torus`.
        effects: such as [Gravity()].

    Returns:
        Function (q, v, a, p) -> tau; q, v, a, tau of shape (n,) in rad or m, /s, /s^2, and N m or N along +q;
        p are the parameters that stay symbols, those of the machine first, then those of the effects in their order,
        as in the p of a form (often none: []). If an effect is a function of time, (q, v, a, p, t), t in s.

    Raises:
        TypeError: no machine, or no effect.
        ValueError: the force of an effect depends on a state, so that q(t) alone does not fix the torques, or a
            parameter of the same name as one of the machine.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (3.1), (4.1), (5.3).
    """
    mechanics = assemble(machine, effects)
    a = derivative(machine, "a")
    tau = joint_torques(mechanics, a)
    inputs, names = [machine.q, machine.v, a, parameters(mechanics)], ["q", "v", "a", "p"]
    if ca.depends_on(tau, clock(mechanics)):
        inputs, names = [*inputs, clock(mechanics)], [*names, "t"]
    return ca.Function("inverse_dynamics", inputs, [ca.cse(ca.densify(tau))], names, ["tau"])


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
    checks.instance("system", system, System, "a System, a form of the machine")
    torques_of = inverse_dynamics(machine, effects)
    rate = ca.SX.sym("rate", system.x.numel())
    q, v = system["q"], system["v"]
    n = len(machine.coordinates)
    if q.numel() != n or system.p.numel() != torques_of.numel_in(3):
        raise ValueError(
            f"system: has {q.numel()} coordinates and {system.p.numel()} parameters, {machine.name} with these effects "
            f"has {n} and {torques_of.numel_in(3)}; give the machine and the effects that it is a form of"
        )
    a = ca.jtimes(v, system.x, rate)
    time = [system["time"]] if torques_of.n_in() == 5 else []
    inputs, outputs = [system.x, rate, system.p], [q, v, a, torques_of(q, v, a, system.p, *time)]
    return ca.Function(
        "recover", inputs, ca.cse([ca.densify(o) for o in outputs]), ["x", "rate", "p"], ["q", "v", "a", "tau"]
    )


def drive_dynamics(machine: Manipulator, effects: Sequence[Effect] = ()) -> ca.Function:
    """Return the quantities of the drives along a motion: torques of joints and motors, and the control they need.

    ElasticDrive: motor_q = q + tau / k and its derivatives, motor_tau = J motor_a + tau. LaggedDrive: command =
    tau + T dtau/dt. MotorDrive: current = tau / (k N), voltage = R i + L di/dt + k N v. Time derivatives of tau follow
    from those of q, so that each of them needs one more derivative of the motion.

    Args:
        machine: from `cylindrical`, `spherical` or `torus`.
        effects: with at most one of LaggedDrive and MotorDrive, and at most one ElasticDrive.

    Returns:
        Function (q, v, a, [jerk, [snap, [crackle,]]] p [, t]) -> tau, motor_q, motor_v, motor_tau and the signals of
        the drive, by name, (n,) each; `Function.name_in()` lists the derivatives that are needed.

    Raises:
        TypeError: no machine, or no effect.
        ValueError: the motion at one instant does not fix the drives: elastic joints with damping, forces that depend
            on states.

    Source: A. De Luca, P. Lucibello, A general algorithm for dynamic feedback linearization of robots with elastic
        joints, ICRA 1998 (torques of elastic joints from derivatives of the motion).
    """
    mechanics = assemble(machine, effects)
    motion = [machine.q, machine.v, *(derivative(machine, name) for name in DERIVATIVES[2:])]
    time = clock(mechanics)

    def rate(expression: ca.SX) -> ca.SX:
        if ca.depends_on(expression, motion[-1]):
            raise ValueError("drive_dynamics: the drives need more than five derivatives of the motion")
        moved = ca.jtimes(expression, ca.vertcat(*motion[:-1]), ca.vertcat(*motion[1:]))
        return moved + ca.jacobian(expression, time) if ca.depends_on(expression, time) else moved

    tau = joint_torques(mechanics, motion[2])
    motor_q, motor_v, motor_tau = machine.q, machine.v, tau
    if mechanics.terms.transmission is not None:
        motor_q, motor_v, motor_tau = mechanics.terms.transmission.invert(tau, rate)
    outputs = {"tau": tau, "motor_q": motor_q, "motor_v": motor_v, "motor_tau": motor_tau}
    if mechanics.terms.source is not None:
        needs = mechanics.terms.source.invert(motor_tau, motor_v, rate)
        outputs |= {name: quantity.expression for name, quantity in needs.items()}
    everything = ca.vertcat(*outputs.values())
    depth = max(i for i, part in enumerate(motion) if i <= 2 or ca.depends_on(everything, part)) + 1
    inputs, names = [*motion[:depth], parameters(mechanics)], [*DERIVATIVES[:depth], "p"]
    if ca.depends_on(everything, time):
        inputs, names = [*inputs, time], [*names, "t"]
    results = ca.cse([ca.densify(output) for output in outputs.values()])
    return ca.Function("drive_dynamics", inputs, results, names, list(outputs))


def derivative(machine: Manipulator, name: str) -> ca.SX:
    """Return symbols (n,) of a time derivative of q."""
    return ca.vertcat(*(ca.SX.sym(f"{name}_{c.name}") for c in machine.coordinates))


def time_column(function: ca.Function, t: Array) -> tuple[Array, ...]:
    """Return the times as the last input of a function with the input t; nothing for one without."""
    return (t[:, None],) if "t" in function.name_in() else ()
