"""What an effect adds to a machine. Terms only add: nothing removes or overrides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from models.manipulator import Body, Manipulator


@dataclass(frozen=True, eq=False)
class Quantity:
    """A named scalar that an effect publishes, with its unit."""

    expression: ca.SX
    unit: str


@dataclass(frozen=True, eq=False)
class State:
    """A state of an effect: its symbol z, its rate dz/dt and its unit."""

    symbol: ca.SX
    rate: ca.SX
    unit: str


@dataclass(frozen=True, eq=False)
class Terms:
    """Contributions, written in the symbols q, v and tau of the machine."""

    metric: ca.SX | None = None  # (n, n) added to g(q)
    potential: ca.SX = field(default_factory=lambda: ca.SX(0))  # U(q) [J]
    acceleration: ca.SX | None = None  # (3,) of a homogeneous field that acts on every mass [m/s^2]
    bodies: tuple[Body, ...] = ()  # that the effect attaches; their inertia is in `metric`
    force: ca.SX | None = None  # (n,) generalised force beside the drives, along +q [N m or N]
    states: Mapping[str, State] = field(default_factory=dict)
    signals: Mapping[str, Quantity] = field(default_factory=dict)
    symbols: Mapping[str, ca.SX] = field(default_factory=dict)  # parameters that stay symbols
    nominal: Mapping[str, float] = field(default_factory=dict)  # their values

    def __add__(self, other: Terms) -> Terms:
        return Terms(
            metric=_sum(self.metric, other.metric),
            potential=self.potential + other.potential,
            acceleration=_sum(self.acceleration, other.acceleration),
            bodies=self.bodies + other.bodies,
            force=_sum(self.force, other.force),
            states=_union("state", self.states, other.states),
            signals=_union("signal", self.signals, other.signals),
            symbols=_union("parameter", self.symbols, other.symbols),
            nominal={**self.nominal, **other.nominal},
        )


Effect = Callable[["Manipulator", Terms], Terms]  # called with the terms so far, returns its own


def gather(machine: Manipulator, effects: Sequence[Effect]) -> Terms:
    """Return the sum of the terms of all effects, each called with the sum so far.

    Raises:
        TypeError: something that is no effect.
        ValueError: two effects define the same state, signal or parameter.
    """
    if callable(effects) or isinstance(effects, str | bytes):
        raise TypeError(f"effects: got {effects!r}, expected a list of effects such as [Gravity()]")
    total = Terms()
    for effect in effects:
        if isinstance(effect, type) or not callable(effect):
            raise TypeError(f"effects: got {effect!r}, expected an effect such as Gravity()")
        total = total + effect(machine, total)
    return total


def _sum(one: ca.SX | None, other: ca.SX | None) -> ca.SX | None:
    if one is None or other is None:
        return other if one is None else one
    return one + other


def _union(kind: str, one: Mapping, other: Mapping) -> dict:  # type: ignore[type-arg]
    for name in other:
        if name in one:
            raise ValueError(f"two effects define the {kind} {name!r}; keep one of them")
    return {**one, **other}
