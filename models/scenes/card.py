"""The card of a scene: everything that a user or a reader wants to know before it is solved."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass

import numpy as np

from models.machines.parameters import Parameter
from models.mechanics.terms import Effect, name_of
from models.scenes.effect_prices import Price, instructions
from ocp.system import Label, System

WIDTH, INDENT = 110, 14


def scene_card(
    title: str, frame: str, system: System, machine: Mapping[str, float], prices: Sequence[Price], bare: System
) -> str:
    """Return the card of a scene, lines of at most WIDTH characters.

    Args:
        title: machine, form and frame in words.
        frame: name of the frame.
        system: with all effects.
        machine: name -> value of the parameters of the machine, SI and radians.
        prices: instructions, states and controls that each effect adds, one for each effect.
        bare: the system without effects.
    """
    lines = [
        *entry("scene", title),
        *entry(f"states {system.x.numel()}", _labels(system, "x", system.x.numel())),
        *entry(f"controls {system.u.numel()}", _labels(system, "u", system.u.numel())),
        *entry("parameters", _open(system)),
        *entry("machine", ", ".join(f"{name} {value:.6g}" for name, value in machine.items())),
    ]
    for number, effect in enumerate(prices):
        lines += entry("" if number else "effects", f"{describe(effect.effect)}: {effect}")
    if not prices:
        lines += entry("effects", "none")
    lines += [
        *entry("limits", "; ".join(_limits(system)) or "none of the effects; those of the task come on top"),
        *entry("signals", ", ".join(f"{k} ({s.numel()})" if s.numel() > 1 else k for k, s in system.signals.items())),
        *entry("instructions", f"{instructions(system)} for x' = f(x, u, p); {instructions(bare)} without effects"),
        *entry("metric", metric(system, frame)),
    ]
    return "\n".join(lines)


def entry(heading: str, text: str) -> list[str]:
    """Return a heading and a text beside it, as lines."""
    return textwrap.wrap(
        text or "none", WIDTH, initial_indent=f"{heading:<{INDENT}}", subsequent_indent=" " * INDENT,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def describe(effect: Effect) -> str:
    """Return an effect with its parameters and their units: payload (mass 2 kg)."""
    name = name_of(effect)
    if not is_dataclass(effect):
        return name
    shown = []
    for field in fields(effect):
        value = getattr(effect, field.name)
        if value is not None and (
            field.default is MISSING or value != field.default or field.name == fields(effect)[0].name
        ):
            shown.append(f"{field.name} {_shown(value)} {field.metadata.get('unit', '')}".strip())
    return f"{name} ({', '.join(shown)})" if shown else name


def metric(system: System, frame: str) -> str:
    """Return whether the metric is diagonal in the frame, and if not, which effect couples it and what that costs."""
    return "; ".join(system.notes) or f"diagonal in the frame {frame!r}: one division for each degree of freedom"


def _labels(system: System, name: str, size: int) -> str:
    return ", ".join(map(str, system.label(name, size)))


def _open(system: System) -> str:
    if not system.nominal:
        return "all are numbers, folded into the graph"
    return ", ".join(f"{name} (symbol, nominal {value:.6g})" for name, value in system.nominal.items())


def _limits(system: System) -> Iterable[str]:
    for name, sides in system.limits.items():
        size = system[name].numel()
        low, high = (
            np.broadcast_to(missing if side is None else np.asarray(side, dtype=float), size)
            for side, missing in zip(sides, (-np.inf, np.inf), strict=True)
        )
        for label, lower, upper in zip(system.label(name, size), low, high, strict=True):
            yield interval(label, lower, upper)


def interval(label: Label, lower: float, upper: float) -> str:
    """Return limits of one component in words: -2 <= tau_phi <= 3 N m."""
    unit = f" {label.unit}" if label.unit not in ("", "1") else ""
    if lower == upper:
        return f"{label.name} = {lower:.6g}{unit}"
    if np.isfinite(upper) and lower == -upper:
        return f"|{label.name}| <= {upper:.6g}{unit}"
    left = f"{lower:.6g} <= " if np.isfinite(lower) else ""
    right = f" <= {upper:.6g}" if np.isfinite(upper) else ""
    return f"{left}{label.name}{right}{unit}" if left or right else f"{label.name} free"


def _shown(value: object) -> str:
    if isinstance(value, Parameter):
        return f"{value.value:.6g} (symbol)"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_shown(one)}" for key, one in value.items()) + "}"
    if value is None:
        return "none"
    if isinstance(value, tuple | list | np.ndarray):
        return f"({', '.join(map(_shown, value))})"
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:.6g}"
    return getattr(value, "__name__", str(value))
