"""Equations of motion along a given path, for the timing law s(t) that the drives allow."""

from __future__ import annotations

from collections.abc import Sequence
from math import perm

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from models.motions.coordinate_labels import labels_of
from models.motions.function_curves import ExpressionCurve
from models.motions.motion import Motion
from models.motions.piecewise import Piecewise
from models.motions.solution_curve import Recorded
from models.motions.timing_laws import on_path
from models.torques.torque_functions import inverse_dynamics
from ocp import checks
from ocp.system import Label, System


def path_system(machine: Manipulator, effects: Sequence[Effect], path: Motion) -> System:
    """Return the machine on a path as a system of one degree of freedom.

    x = (s, s'), u = s'',  v = q_s s',  a = q_s s'' + q_ss s'^2,  tau by inverse dynamics

    Limits on the signals tau and v, with s from path.start to path.end in minimum time, give the time-optimal motion
    along the path; `timed` makes a Motion of the solution. Limits of effects on torques and speeds, such as those of
    TorqueSpeed, are limits of the system; the notes tell those that the motion alone does not determine.

    Args:
        machine, effects: as in `inverse_dynamics`.
        path: q(s) as a piecewise polynomial or an expression, at least twice continuously differentiable.

    Raises:
        ValueError: another number of coordinates, a path that is not smooth enough, or given by samples of functions.

    Source: J. E. Bobrow, S. Dubowsky, J. S. Gibson, Time-optimal control of robotic manipulators along specified
        paths, Int. J. Robotics Research 4 (1985).
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    checks.instance("path", path, Motion, "a path such as path_through(waypoints)")
    n = len(machine.coordinates)
    if len(path.labels) != n:
        raise ValueError(f"the path has {len(path.labels)} coordinates, {machine.name} has {n}")
    if path.smoothness < 2:
        raise ValueError("the path has corners or jumps of its curvature; the torques would jump with them")
    s, ds, dds = ca.SX.sym("s"), ca.SX.sym("ds"), ca.SX.sym("dds")
    q, first, second = _derivatives(path, s)
    v, a = first * ds, first * dds + second * ds**2
    torques = inverse_dynamics(machine, effects)
    p = ca.SX.sym("p", torques.numel_in(3))
    if p.numel():
        raise ValueError("parameters stay symbols; the timing of a path needs a machine and effects of numbers")
    tau = torques(q, v, a, p)
    coordinates = machine.coordinates
    tool = ca.substitute(machine.tool, machine.q, q)
    mechanics = assemble(machine, effects)
    limited, left = {}, []
    known = {
        symbol.element_hash() for symbol in ca.vertsplit(ca.vertcat(machine.q, machine.v, machine.tau, s, ds, dds))
    }
    for name in mechanics.terms.limits:
        signal = mechanics.resolved(mechanics.terms.signals[name].expression)
        reads = [read.symbol for read in mechanics.terms.reads if read.name == "acceleration"]
        signal = ca.substitute([signal], reads, [a] * len(reads))[0]
        if all(symbol.element_hash() in known for symbol in ca.symvar(signal)):
            limited[name] = ca.substitute([signal], [machine.q, machine.v, machine.tau], [q, v, tau])[0]
        else:
            left.append(f"the limit on {name} is not imposed: it depends on more than q, v and tau")
    signals = {"s": s, "ds": ds, "dds": dds, "q": q, "v": v, "a": a, "tau": tau, "tool": tool, "power": ca.dot(tau, v)}
    return System(
        x=ca.vertcat(s, ds),
        u=dds,
        p=p,
        rate=ca.vertcat(ds, dds),
        signals={name: ca.densify(signal) for name, signal in {**signals, **limited}.items()},
        limits={name: mechanics.terms.limits[name] for name in limited},
        notes=tuple(left),
        labels={
            "x": (Label("s"), Label("ds/dt", "1/s")),
            "u": (Label("d2s/dt2", "1/s^2"),),
            "q": labels_of(machine),
            "v": tuple(Label(f"d{c.name}/dt", f"{c.unit}/s") for c in coordinates),
            "a": tuple(Label(f"d2{c.name}/dt2", f"{c.unit}/s^2") for c in coordinates),
            "tau": tuple(Label(f"tau_{c.name}", c.force_unit) for c in coordinates),
            "tool": tuple(Label(f"tool_{axis}", "m") for axis in "xyz"),
            "power": (Label("power", "W"),),
        },
    )


def timed(path: Motion, solution: Recorded) -> Motion:
    """Return the motion along the path with the timing law of a solution of its `path_system`.

    Args:
        path: q(s).
        solution: of a problem whose system is path_system(machine, effects, path).

    Raises:
        ValueError: the solution is of another kind of system, or leaves the path.
    """
    checks.instance("path", path, Motion, "a path such as path_through(waypoints)")
    s, ds, dds = ca.SX.sym("s"), ca.SX.sym("ds"), ca.SX.sym("dds")
    x, law = ca.vertcat(s, ds), {"q": s, "v": ds}
    law_system = System(x, dds, ca.SX(0, 1), ca.vertcat(ds, dds), law)
    return on_path(path, Motion.of(solution, law_system))


def _derivatives(path: Motion, s: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return q, dq/ds and d2q/ds2 of a path as expressions in s."""
    curve = path.curve
    if isinstance(curve, ExpressionCurve):
        return curve.derivatives[0](s), curve.derivatives[1](s), curve.derivatives[2](s)
    if not isinstance(curve, Piecewise):
        raise ValueError("the path is no piecewise polynomial and no expression; use path_through(waypoints)")

    def chosen(values: np.ndarray) -> ca.SX:
        """Return the value of the piece in which s lies."""
        if np.all(values == values[0]):
            return ca.SX(float(values[0]))
        return ca.pw_const(s, ca.DM(curve.breaks[1:-1]), ca.DM(values))

    since = s - chosen(curve.breaks[:-1])
    columns = []
    for i in range(curve.coefficients.shape[2]):
        coefficients = [chosen(curve.coefficients[:, j, i]) for j in range(curve.degree + 1)]
        values = []
        for order in range(3):
            value = ca.SX(0)
            for j in range(curve.degree, order - 1, -1):
                value = value * since + coefficients[j] * perm(j, order)
            values.append(value)
        columns.append(ca.horzcat(*values))
    table = ca.cse(ca.vertcat(*columns))
    return table[:, 0], table[:, 1], table[:, 2]
