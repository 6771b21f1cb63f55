"""What each effect of a scene costs: instructions of the right-hand side, states and controls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from models.mechanics.terms import Effect, name_of
from ocp.system import System


@dataclass(frozen=True, eq=False)
class Price:
    """What one effect adds to a scene: the scene with it minus the scene that never heard of it."""

    effect: Effect
    instructions: int | None  # of x' = f(x, u, p); None if the scene cannot be without the effect
    states: int
    controls: int
    reason: str = ""  # why the scene cannot be without the effect

    @property
    def name(self) -> str:
        """What the effect is called."""
        return name_of(self.effect)

    def __str__(self) -> str:
        if self.instructions is None:
            return f"not to be left out: {self.reason}"
        counts = ((self.instructions, "instruction"), (self.states, "state"), (self.controls, "control"))
        shown = [f"{n:+d} {what}{'' if abs(n) == 1 else 's'}" for n, what in counts if n or what == "instruction"]
        return ", ".join(shown)


def prices(system: System, effects: Sequence[Effect], without: Callable[[Effect], System]) -> tuple[Price, ...]:
    """Return what every effect adds to a system, in the order of the effects.

    Args:
        system: with all effects.
        effects: of the scene.
        without: effect -> the system that never heard of it; raises ValueError where another effect needs it.
    """
    total, result = instructions(system), []
    for effect in effects:
        try:
            bare = without(effect)
        except ValueError as error:
            result.append(Price(effect, None, 0, 0, str(error)))
            continue
        states, controls = system.x.numel() - bare.x.numel(), system.u.numel() - bare.u.numel()
        result.append(Price(effect, total - instructions(bare), states, controls))
    return tuple(result)


def instructions(system: System) -> int:
    """Return the number of instructions of x' = f(x, u, p)."""
    count: int = ca.Function("rate", [system.x, system.u, system.p], [system.rate]).n_instructions()
    return count
