"""A scene as one value: machine, effects, form and frame of its equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from models.forms import canonical, hamel, inverse
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect, name_of
from models.scenes.card import scene_card
from models.scenes.effect_prices import Price, instructions, prices
from ocp import checks
from ocp.system import System

Form = Callable[[Manipulator, Sequence[Effect], str | Frame | None], System]


@dataclass(frozen=True, eq=False)
class Scene:
    """A machine with the effects that its task calls for, and the form in which its equations are wanted.

    Args:
        machine: such as spherical().
        effects: such as [Gravity(), Viscous(0.5)], in an order in which each finds what it reads.
        form: canonical, hamel, inverse or lagrange.
        frame: name of a frame of the machine, or a Frame; None is "regular".

    Raises:
        TypeError: no machine, no effect, no form.
        ValueError: no such frame, or effects that do not go together.
    """

    machine: Manipulator
    effects: tuple[Effect, ...] = ()
    form: Form = canonical
    frame: str | Frame | None = None
    system: System = field(init=False, repr=False)  # x' = f(x, u, p) with its signals

    def __post_init__(self) -> None:
        if not callable(self.form) or isinstance(self.form, type):
            shown = checks.shown(self.form)
            raise TypeError(f"Scene: form is {shown}, expected canonical, hamel, inverse or lagrange")
        system = self.form(self.machine, self.effects, self.frame)
        checks.instance(
            "Scene: system of the form", system, System, "a System, as canonical, hamel, inverse or lagrange give"
        )
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "system", system)

    def __repr__(self) -> str:
        return f"Scene({self.machine.name}, {', '.join(map(name_of, self.effects)) or 'no effects'}, {self.form_name})"

    def __str__(self) -> str:
        return self.card()

    @property
    def form_name(self) -> str:
        """Name of the form."""
        return getattr(self.form, "__name__", repr(self.form))

    @property
    def frame_name(self) -> str:
        """Name of the frame."""
        if self.form is inverse:
            return "coordinate"
        if self.frame is None and self.form is hamel and self.machine.recursion is not None:
            return "innovations"
        return self.frame.name if isinstance(self.frame, Frame) else self.frame or self.machine.default_frame

    @cached_property
    def instructions(self) -> int:
        """Instructions of x' = f(x, u, p), all numbers folded in."""
        return instructions(self.system)

    @cached_property
    def prices(self) -> tuple[Price, ...]:
        """Instruction count of each effect: that of the rate with it minus that without."""
        return prices(self.system, self.effects, lambda effect: self.without(effect).system)

    def without(self, effect: Effect) -> Scene:
        """Return the scene that never heard of one of its effects.

        Raises:
            ValueError: the scene has no such effect, or another effect cannot be without it.
        """
        kept = tuple(other for other in self.effects if other is not effect)
        if len(kept) == len(self.effects):
            names = ", ".join(map(name_of, self.effects))
            raise ValueError(f"this scene has no effect {checks.shown(effect)}; it has {names or 'none'}")
        return Scene(self.machine, kept, self.form, self.frame)

    def card(self) -> str:
        """Return the scene as a page of text: states, controls, parameters, limits, signals, instruction counts."""
        title = f"{self.machine.name} manipulator, {self.form_name} form, frame {self.frame_name}"
        bare = self.form(self.machine, (), self.frame)
        return scene_card(title, self.frame_name, self.system, self.machine.nominal, self.prices, bare)
