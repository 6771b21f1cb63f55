"""What each effect of a scene costs: instructions of the right-hand side, states and controls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from models.mechanics.terms import Effect, name_of
from ocp.system import System

if TYPE_CHECKING:
    from models.scenes.scene import Scene


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


def prices(scene: Scene) -> tuple[Price, ...]:
    """Return the price of every effect of a scene, in their order."""
    found = []
    for effect in scene.effects:
        try:
            bare = scene.without(effect)
        except ValueError as error:
            found.append(Price(effect, None, 0, 0, str(error)))
            continue
        states = scene.system.x.numel() - bare.system.x.numel()
        controls = scene.system.u.numel() - bare.system.u.numel()
        found.append(Price(effect, scene.instructions - bare.instructions, states, controls))
    return tuple(found)


def instructions(system: System) -> int:
    """Return the number of instructions of x' = f(x, u, p)."""
    count: int = ca.Function("rate", [system.x, system.u, system.p], [system.rate]).n_instructions()
    return count
