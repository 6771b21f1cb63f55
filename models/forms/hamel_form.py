"""Boltzmann-Hamel form: the state is (q, w) with quasi-velocities w = F(q) v."""

from __future__ import annotations

from collections.abc import Sequence

from models.forms.loaded_equations import hamel_by_links, with_links
from models.forms.state_space import Equations, as_system, symbols
from models.forms.tree_equations import by_recursion, hamel_equations
from models.machines.factorisation import factorise
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import Mechanics, assemble, momentum_rate
from models.mechanics.partials import Partials
from models.mechanics.terms import Effect
from ocp.system import System


def hamel(machine: Manipulator, effects: Sequence[Effect] = (), frame: str | Frame | None = None) -> System:
    """Return the Boltzmann-Hamel equations in a frame of quasi-velocities.

    q' = S(q) w,  g' w' + Lambda(q)(w, w) = S' (tau - dU/dq + forces of effects),  x = [q; w], u = tau

    Args:
        machine: such as spherical(), or any arm.
        effects: such as [Gravity()]; an effect that is not listed leaves no trace.
        frame: name of a frame of the machine, or a Frame; None is "regular", for a machine of
            links "innovations".

    Raises:
        TypeError: no machine, or no effect.
        ValueError: no such frame, or one that is singular for these parameters.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (1.6a); (3.4), (4.6), (5.6).
    """

    def equations(mechanics: Mechanics) -> Equations:
        named = by_recursion(mechanics, frame, "innovations")
        if named is not None:
            return hamel_equations(mechanics, named)
        basis = mechanics.frame(frame)
        w = symbols("w", basis.q.numel())
        v = basis.inverse @ w
        partials = Partials.of(basis)
        moved = momentum_rate(mechanics, basis, w, basis.metric @ w, partials) - partials.metric_rate(v, w)
        closed = Equations(basis, w, w, v, factorise(basis.metric).solve(moved))
        return with_links(mechanics, closed, hamel_by_links(mechanics, basis, w))

    return as_system(assemble(machine, effects), equations)
