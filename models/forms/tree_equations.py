"""Equations of motion of machines of links by recursion; the shortest of the algorithms there are is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as ca

from models.forms.state_space import Equations, InnerEquations, symbols
from models.machines.frames import Frame
from models.machines.recursion import Build, Recursion
from models.mechanics.mechanics import Mechanics

FROM_TIP = ("innovations", "udu")  # frames of U D U', the same under two names
FRAMES = (*FROM_TIP, "ldl")
MOST = 24  # joints up to which derivatives by the implicit function theorem are offered


def canonical_equations(mechanics: Mechanics, frame: str) -> Equations:
    """Return the canonical equations in the coordinates or in a frame of a factorisation.

    In coordinates v = M^-1 p and p' = dT/dq - dU/dq + tau; in the frame w = L' v the momenta are L^-1 p, and their rate
    is L^-1 (p' - (dL/dt) L^-1 p).

    Args:
        mechanics: of a machine with a recursion.
        frame: "coordinate", "innovations", "udu" or "ldl".
    """
    recursion, n = _of(mechanics), mechanics.machine.q.numel()
    p = symbols("p", n)
    if frame in FRAMES:
        factors = recursion.factors(frame in FROM_TIP)
        w = p / factors.pivots
        v = factors.backward(w)
        constant, moving = ca.SX.sym("c", n), ca.SX.sym("v", n)
        turned = ca.jtimes(factors.lower @ constant, mechanics.machine.q, moving)
        turned = ca.substitute(turned, ca.vertcat(constant, moving), ca.vertcat(p, v))
        rate = factors.forward(_pushed(mechanics, v, None) - turned)
        return Equations(mechanics.frame(frame), p, w, v, rate, ca.dot(w, p) / 2)

    def built(build: Build) -> Equations:
        v = build.solve(p)
        return Equations(mechanics.frame("coordinate"), p, v, v, _pushed(mechanics, v, p), ca.dot(v, p) / 2)

    equations, y = shortest(recursion.builds, built), ca.SX.sym("y", n)
    if n > MOST:
        return equations
    # Value and slopes share the factors of M by composite bodies, whichever algorithm the rate itself uses.
    factored, residual = recursion.factors(True).solve, recursion.momentum(y) - p
    pushed, other = _pushed(mechanics, y, None), _forces(mechanics, y)  # d(dT/dq)/dv = (dp/dq)'
    inner = InnerEquations(y, y, pushed, residual, factored(p), factored, True, other)
    return replace(equations, inner=inner)


def lagrange_equations(mechanics: Mechanics) -> Equations:
    """Return a = M^-1 (tau - h - dU/dq) with h by the recursion of Newton and Euler, or by articulated bodies."""
    recursion, v = _of(mechanics), mechanics.machine.v
    forces = mechanics.force - mechanics.other_potential_gradient
    kinetic = ca.dot(v, recursion.momentum(v)) / 2

    def built(build: Build) -> Equations:
        a = build.accelerations(v, ca.densify(forces), mechanics.field)
        return Equations(mechanics.frame("coordinate"), v, v, v, a, kinetic)

    equations, y = shortest(recursion.builds, built), ca.SX.sym("y", v.numel())
    if v.numel() > MOST:
        return equations
    solve, residual = recursion.factors(True).solve, recursion.inverse_dynamics(v, y, mechanics.field) - forces
    bias = recursion.inverse_dynamics(v, None, mechanics.field)
    inner = InnerEquations(y, v, y, residual, solve(forces - bias), solve)
    return replace(equations, inner=inner)


def hamel_equations(mechanics: Mechanics, frame: str) -> Equations:
    """Return w' = D^-1 L^-1 (tau - h - dU/dq) + (dL'/dt) v in the frame w = L' v, in which T = w' D w / 2.

    Args:
        mechanics: of a machine with a recursion.
        frame: "innovations", "udu", "ldl" or "coordinate".

    Source: A. Jain, G. Rodriguez, Diagonalized Lagrangian robot dynamics, IEEE Trans. Robotics and Automation 11
        (1995).
    """
    recursion, n = _of(mechanics), mechanics.machine.q.numel()
    w = symbols("w", n)
    if frame == "coordinate":  # w = v, the equations of Lagrange

        def in_coordinates(build: Build) -> Equations:
            a = build.accelerations(w, ca.densify(_forces(mechanics, w)), mechanics.field)
            return Equations(mechanics.frame(frame), w, w, w, a, ca.dot(w, recursion.momentum(w)) / 2)

        return shortest(recursion.builds, in_coordinates)
    builds = recursion.builds if frame in FROM_TIP else (recursion.from_base,)
    pivots = recursion.pivots if frame in FROM_TIP else recursion.factors(False).pivots
    kinetic = ca.dot(w, pivots * w) / 2

    def built(build: Build) -> Equations:
        v = build.velocities(w)
        rate = build.frame_rate(v, ca.densify(_forces(mechanics, v)), mechanics.field)
        return Equations(mechanics.frame(frame), w, w, v, rate, kinetic)

    return shortest(builds, built)


def shortest(builds: Sequence[Build], built: Callable[[Build], Equations]) -> Equations:
    """Return the equations with the fewest instructions and a note on the others.

    Args:
        builds: algorithms.
        built: returns the equations of an algorithm.
    """
    made = [(build.name, built(build)) for build in builds]
    counts = [instructions(equations) for _, equations in made]
    best = counts.index(min(counts))
    name, equations = made[best]
    others = [f"{other} would take {count}" for (other, _), count in zip(made, counts, strict=True) if other != name]
    note = f"built by {name}, {counts[best]} instructions" + "".join(f"; {other}" for other in others)
    return replace(equations, notes=(note,))


def instructions(equations: Equations) -> int:
    """Return the number of instructions of v and the rate together."""
    rate = ca.cse(ca.densify(ca.vertcat(equations.v, equations.rate)))
    return int(ca.Function("rate", [ca.vertcat(*ca.symvar(rate))], [rate]).n_instructions())


def by_recursion(mechanics: Mechanics, frame: str | Frame | None, default: str) -> str | None:
    """Return the name of the frame if the equations come from a recursion in it, None if from the metric.

    Args:
        mechanics: machine and effects.
        frame: as given by the user.
        default: name of the frame if the user gives none.
    """
    if mechanics.recursion is None or isinstance(frame, Frame):
        return None
    name = default if frame is None else frame
    return name if name in ("coordinate", *FRAMES) else None


def _pushed(mechanics: Mechanics, v: ca.SX, p: ca.SX | None) -> ca.SX:
    """Return p' = dT/dq - dU/dq + forces at velocities v."""
    recursion = _of(mechanics)
    return recursion.kinetic_gradient(v, p) - recursion.gravity(mechanics.field) + _forces(mechanics, v)


def _forces(mechanics: Mechanics, v: ca.SX) -> ca.SX:
    """Return the forces (n,) that are not the weight of links, at velocities v."""
    forces = mechanics.force - mechanics.other_potential_gradient
    return ca.substitute(forces, mechanics.machine.v, v)


def _of(mechanics: Mechanics) -> Recursion:
    recursion = mechanics.recursion
    assert recursion is not None
    return recursion
