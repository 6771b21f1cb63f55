"""Equations of machines with a metric in closed form and loads on their links: by recursion where that is shorter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca

from models.forms.state_space import Equations
from models.forms.tree_equations import instructions
from models.machines.frames import Frame
from models.machines.recursion import Build, Recursion
from models.mechanics.mechanics import Mechanics

# recursion, algorithm -> velocities and rate of the second half of the state
Built = Callable[[Recursion, Build], Equations]


def with_links(mechanics: Mechanics, closed: Equations, built: Built) -> Equations:
    """Return the shortest of the equations from the metric and those by recursion over the links with their loads.

    Args:
        mechanics: machine and effects.
        closed: from the metric in closed form.
        built: returns the same equations by one of the algorithms of a recursion.
    """
    recursion = mechanics.links
    if recursion is None:
        return closed
    made = [(build.name, built(recursion, build)) for build in recursion.builds]
    counts = {name: instructions(equations) for name, equations in made}
    limit, (name, equations) = instructions(closed), min(made, key=lambda pair: counts[pair[0]])
    if counts[name] >= limit:
        return closed
    note = f"built by {name}, {counts[name]} instructions; the metric would take {limit}"
    return replace(equations, notes=(note,))


def canonical_by_links(mechanics: Mechanics, frame: Frame, p: ca.SX) -> Built:
    """Return the canonical equations in a frame: v = M^-1 F' p, p' = S' (dT/dq - dU/dq + forces - (dF'/dt) p).

    Args:
        mechanics: machine and effects.
        frame: of the quasi-velocities w = F v, v = S w.
        p: (n,) symbols of the momenta in the frame.
    """

    def built(recursion: Recursion, build: Build) -> Equations:
        momenta = frame.matrix.T @ p
        v = build.solve(momenta)
        pushed = recursion.kinetic_gradient(v, momenta) - recursion.gravity(mechanics.field)
        pushed = pushed + _forces(mechanics, v) - _turned(frame, frame.matrix.T, p, v)
        return Equations(frame, p, frame.matrix @ v, v, frame.inverse.T @ pushed, ca.dot(v, momenta) / 2)

    return built


def hamel_by_links(mechanics: Mechanics, frame: Frame, w: ca.SX) -> Built:
    """Return the equations of Boltzmann and Hamel in a frame: v = S w, w' = F a + (dF/dt) v.

    Args:
        mechanics: machine and effects.
        frame: of the quasi-velocities w = F v, v = S w.
        w: (n,) symbols of the quasi-velocities.
    """

    def built(recursion: Recursion, build: Build) -> Equations:
        v = frame.inverse @ w
        a = build.accelerations(v, ca.densify(_forces(mechanics, v)), mechanics.field)
        rate = frame.matrix @ a + _turned(frame, frame.matrix, v, v)
        return Equations(frame, w, w, v, rate, ca.dot(v, recursion.momentum(v)) / 2)

    return built


def lagrange_by_links(mechanics: Mechanics, frame: Frame) -> Built:
    """Return a = M^-1 (tau - h - dU/dq).

    Args:
        mechanics: machine and effects.
        frame: through which the metric would be inverted.
    """

    def built(recursion: Recursion, build: Build) -> Equations:
        v = mechanics.machine.v
        a = build.accelerations(v, ca.densify(_forces(mechanics, v)), mechanics.field)
        return Equations(frame, v, frame.matrix @ v, v, a, ca.dot(v, recursion.momentum(v)) / 2)

    return built


def _forces(mechanics: Mechanics, v: ca.SX) -> ca.SX:
    """Return the forces (n,) that are not the weight of links and loads, at velocities v."""
    forces = mechanics.force - mechanics.gradient_beside_links
    return ca.substitute(forces, mechanics.machine.v, v)


def _turned(frame: Frame, matrix: ca.SX, column: ca.SX, v: ca.SX) -> ca.SX:
    """Return (d matrix / dt) column (n,) at velocities v."""
    constant, moving = ca.SX.sym("c", column.numel()), ca.SX.sym("v", v.numel())
    turned = ca.jtimes(matrix @ constant, frame.q, moving)
    return ca.substitute(turned, ca.vertcat(constant, moving), ca.vertcat(column, v))
