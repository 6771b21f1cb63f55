"""Lagrange form: the state is (q, v) with v = dq/dt."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from models.forms.loaded_equations import lagrange_by_links, with_links
from models.forms.state_space import Equations, as_system
from models.forms.tree_equations import by_recursion, lagrange_equations
from models.machines.factorisation import factorise
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import Mechanics, assemble, momentum_rate
from models.mechanics.partials import Partials
from models.mechanics.terms import Effect
from ocp.system import System


def lagrange(machine: Manipulator, effects: Sequence[Effect] = (), frame: str | Frame | None = None) -> System:
    """Return the Lagrange equations solved for the accelerations.

    g(q) v' + Gamma(q)(v, v) = tau - dU/dq + (forces of effects),  x = [q; v], u = tau

    Args:
        machine: such as spherical(), or any arm.
        effects: such as [Gravity()]; an effect that is not listed leaves no trace.
        frame: through which g is inverted, g^-1 = S g'^-1 S'; None is the machine's "regular" frame. A
            machine of links needs none.

    Raises:
        TypeError: no machine, or no effect.
        ValueError: no such frame, or one that is singular for these parameters.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (3.1), (4.1), (5.4).
    """

    def equations(mechanics: Mechanics) -> Equations:
        named = by_recursion(mechanics, frame, "coordinate")
        if named is not None:
            return lagrange_equations(mechanics)
        basis = mechanics.frame(frame)
        v = machine.v
        w = basis.matrix @ v
        partials = Partials.of(basis)
        moved = momentum_rate(mechanics, basis, w, basis.metric @ w, partials) - partials.metric_rate(v, w)
        w_rate = factorise(basis.metric).solve(moved)
        turning = ca.jtimes(w, basis.q, v)  # (dF/dt) v
        closed = Equations(basis, v, w, v, basis.inverse @ (w_rate - turning))
        return with_links(mechanics, closed, lagrange_by_links(mechanics, basis))

    return as_system(assemble(machine, effects), equations)
