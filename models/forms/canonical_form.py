"""Canonical form: the state is (q, p) with momenta p = dT/dw in a frame."""

from __future__ import annotations

from collections.abc import Sequence

from models.forms.loaded_equations import canonical_by_links, with_links
from models.forms.state_space import Equations, as_system, symbols
from models.forms.tree_equations import by_recursion, canonical_equations
from models.machines.factorisation import factorise
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import Mechanics, assemble, momentum_rate
from models.mechanics.partials import Partials
from models.mechanics.terms import Effect
from ocp.system import System


def canonical(machine: Manipulator, effects: Sequence[Effect] = (), frame: str | Frame | None = None) -> System:
    """Return the canonical equations in a frame of quasi-velocities.

    q' = S(q) w,  w = g'^-1 p = dH/dp,  p' = -dH/dw-direction - p A w + S' tau,  x = [q; p], u = tau

    Args:
        machine: such as spherical(), or any arm.
        effects: such as [Gravity()]; an effect that is not listed leaves no trace.
        frame: name of a frame of the machine, or a Frame; None is "regular", for a machine of
            links "coordinate".

    Raises:
        TypeError: no machine, or no effect.
        ValueError: no such frame, or one that is singular for these parameters.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (2.3); (3.5), (4.7), (5.7).
    """

    def equations(mechanics: Mechanics) -> Equations:
        named = by_recursion(mechanics, frame, "coordinate")
        if named is not None:
            return canonical_equations(mechanics, named)
        basis = mechanics.frame(frame)
        p = symbols("p", basis.q.numel())
        w = factorise(basis.metric).solve(p)
        rate = momentum_rate(mechanics, basis, w, p, Partials.of(basis))
        closed = Equations(basis, p, w, basis.inverse @ w, rate)
        return with_links(mechanics, closed, canonical_by_links(mechanics, basis, p))

    return as_system(assemble(machine, effects), equations)
