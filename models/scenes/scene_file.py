"""The part of a scene file that is the scene: machine, form, frame, parameters, effects."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from models.forms import inverse
from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter, unit_of
from models.mechanics.terms import Effect, gather
from models.scenes import catalogue
from models.scenes.collision_table import with_links
from models.scenes.robot_entry import read_robot
from models.scenes.scene import Scene
from models.scenes.toml_document import SceneError, Table, describe, is_angle, spellings
from ocp.system import Label

KEYS = ("machine", "form", "frame", "parameters", "effects")


def read_scene(document: Table, symbols: Collection[str] = ()) -> Scene:
    """Return the scene of a document; its other tables, such as those of the task, are left to others.

    Args:
        document: made by `read_document` or `parse`.
        symbols: keys of single numbers that stay symbols, as in "parameters.m_3" or "effects.payload.mass".

    Raises:
        SceneError: a wrong name, number or combination; the message names file, line and key.
    """
    machines, forms = catalogue.machines(), catalogue.forms()
    if isinstance(document.entries.get("machine"), dict):
        machine = read_robot(document)
    else:
        machine = _machine(machines[document.text("machine", machines)], document.table("parameters"), symbols)
    machine = with_links(document, machine)
    form = forms[document.text("form", forms, "canonical")]
    frame = document.entries.get("frame", "regular" if machine.recursion is None and form is not inverse else None)
    if frame is not None and form is inverse:
        raise document.error("frame", "the form inverse has none, its control is the acceleration; leave it out")
    if frame is not None and not isinstance(frame, str):
        raise document.error("frame", f"got {describe(frame)}, expected one of {', '.join(machine.frames)}")
    try:
        if frame is not None:
            machine.frame(frame)
    except ValueError as error:
        raise document.error("frame", str(error)) from None
    effects = _effects(machine, document.table("effects"), symbols)
    try:
        return Scene(machine, effects, form, frame)
    except (ValueError, TypeError) as error:
        raise _placed(document.table("effects"), error) from None


def _machine(make: Callable[..., Manipulator], table: Table, symbols: Collection[str]) -> Manipulator:
    known = inspect.signature(make).parameters
    table.only(known)
    given: dict[str, object] = {}
    for name, value in table.entries.items():
        if isinstance(known[name].default, bool):
            given[name] = _truth(table, name)
        else:
            given[name] = _symbol(table.finite(name, value, unit_of(name)), table.full(name), symbols)
    try:
        return make(**given)
    except (ValueError, TypeError) as error:
        raise _placed(table, error) from None


def _effects(machine: Manipulator, table: Table, symbols: Collection[str]) -> tuple[Effect, ...]:
    known = catalogue.effects()
    table.only(known)
    made: list[Effect] = []
    for name in table.entries:
        inner = table.table(name)
        try:
            made.append(_effect(known[name], machine, inner, symbols))
            gather(machine, made)
        except SceneError:
            raise
        except (ValueError, TypeError) as error:
            raise _placed(inner, error) from None
    return tuple(made)


def _effect(kind: type, machine: Manipulator, table: Table, symbols: Collection[str]) -> Effect:
    parts = {field.name: components(field, machine) for field in fields(kind)}
    degrees = [f"{name}_deg" for name, labels in parts.items() if any(is_angle(label.unit) for label in labels)]
    table.only([*parts, *degrees])
    given: dict[str, Any] = {}
    for field in fields(kind):
        if table.has(field.name):
            given[field.name] = _symbol(_value(field, parts[field.name], table), table.full(field.name), symbols)
        elif field.default is MISSING and field.default_factory is MISSING:
            unit = field.metadata.get("unit", "")
            raise table.error("", f"the key {field.name!r} is missing{f', in {unit}' if unit else ''}")
    made: Effect = kind(**given)
    return made


def _symbol(value: Any, key: str, symbols: Collection[str]) -> Any:
    return Parameter(value) if key in symbols and isinstance(value, float) else value


def components(field: Field[Any], machine: Manipulator) -> tuple[Label, ...]:
    """Return one label for each coordinate of the machine, with the unit that a field has there.

    A unit such as "rad/s or m/s" is the first for angles and the second for lengths.

    Args:
        field: of an effect, with its unit in the metadata.
        machine: whose coordinates.
    """
    units = field.metadata.get("unit", "").split(" or ")
    return tuple(Label(c.name, units[0] if c.unit == "rad" else units[-1]) for c in machine.coordinates)


def _value(field: Field[Any], parts: tuple[Label, ...], table: Table) -> object:
    name, unit, kind = field.name, field.metadata.get("unit"), str(field.type)
    spelled = name if name in table.entries else f"{name}_deg"
    if spelled != name and name in table.entries:
        raise table.error(spelled, f"stands beside {name!r}; keep one of them")
    value = table.entries[spelled]
    if unit is None and "bool" in kind:
        return _truths(table, name) if "Sequence[bool]" in kind else _truth(table, name)
    if unit is None:  # a field of an effect of the user may state no unit
        return _texts(table, name) if "str" in kind else _numbers(table, name, value, "")
    if field.metadata.get("scalar"):
        return table.number(name, unit)
    if isinstance(value, dict):
        inner = table.inner(spelled, value)
        if spelled != name:
            raise table.error(
                spelled, f"in a table each angle has the suffix: {name} = {{ {parts[0].name}_deg = ... }}"
            )
        inner.only(spellings(parts))
        return tuple(inner.number(p.name, p.unit) if inner.has(p.name) else None for p in parts)
    if spelled != name:
        return table.column(name, parts)
    return _numbers(table, name, value, unit)


def _numbers(table: Table, name: str, value: object, unit: str) -> object:
    if isinstance(value, list):
        return tuple(_numbers(table, name, one, unit) for one in value)
    return table.finite(name, value, unit)


def _texts(table: Table, name: str) -> object:
    value = table.entries[name]
    if isinstance(value, str):
        return value
    if isinstance(value, list) and value and all(isinstance(one, str) for one in value):
        return tuple(value)
    raise table.error(name, f"got {describe(value)}, expected a text")


def _truths(table: Table, name: str) -> bool | tuple[bool, ...]:
    value = table.entries[name]
    if isinstance(value, list) and value and all(isinstance(one, bool) for one in value):
        return tuple(value)
    return _truth(table, name)


def _truth(table: Table, name: str) -> bool:
    value = table.entries[name]
    if not isinstance(value, bool):
        raise table.error(name, f"got {describe(value)}, expected true or false")
    return value


def _placed(table: Table, error: Exception) -> SceneError:
    """Return an error of a machine or an effect with the place of the key that its message begins with."""
    message = str(error)
    head, colon, rest = message.partition(":")
    words = head.split(".")
    if colon and words[0] in table.entries:  # "m_3: ..." in parameters, "payload.mass: ..." in effects
        return table.error(".".join(_known(table.entries, words)), rest.strip())
    if colon and len(words) > 1 and table.key.endswith(words[0]):
        return table.error(".".join(_known(table.entries, words[1:])), rest.strip())
    return table.error("", message)


def _known(entries: Mapping[str, object], words: list[str]) -> list[str]:
    """Return a key without the number of a component, c for c_2, where only the field stands in the file."""
    last = words[-1].rpartition("_")
    inner: object = entries
    for word in words[:-1]:
        inner = inner.get(word, {}) if isinstance(inner, dict) else {}
    known = isinstance(inner, Mapping) and words[-1] not in inner and last[0] in inner and last[2].isdigit()
    return [*words[:-1], last[0]] if known else words
