"""Entries of a scene file as TOML text."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

BARE = re.compile(r"[A-Za-z0-9_-]+")


def as_toml(entries: Mapping[str, object]) -> str:
    """Return a document as TOML that parses to the same entries.

    Args:
        entries: of a document: numbers, texts, truth values, lists and tables of them.
    """
    return "\n".join(_table(entries, ())).strip() + "\n"


def _table(entries: Mapping[str, object], way: tuple[str, ...]) -> list[str]:
    inner = {name: value for name, value in entries.items() if _has_a_heading(value, way)}
    several = {name: value for name, value in entries.items() if _are_tables(value)}
    lines = [f"{key_of(k)} = {_value(value)}" for k, value in entries.items() if k not in inner and k not in several]
    for name, value in inner.items():
        assert isinstance(value, Mapping)
        below = [_has_a_heading(one, (*way, name)) for one in value.values()]
        heading = [] if below and all(below) else ["", f"[{_dotted(way, name)}]"]
        lines += [*heading, *_table(value, (*way, name))]
    for name, value in several.items():
        assert isinstance(value, list)
        for one in value:
            lines += ["", f"[[{_dotted(way, name)}]]", *_table(one, (*way, name))]
    return lines


def _has_a_heading(value: object, way: tuple[str, ...]) -> bool:
    """Return whether a value is written as a table with a heading; tables inside of other tables stand in a line."""
    return isinstance(value, Mapping) and (not way or way in (("effects",), ("study",)))


def _are_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _dotted(way: tuple[str, ...], name: str) -> str:
    return ".".join(map(key_of, (*way, name)))


def key_of(name: str) -> str:
    """Return a name as a key of TOML, in quotes if need be."""
    return name if BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key_of(name)} = {_value(one)}" for name, one in value.items()) + " }"
    if isinstance(value, float):
        return repr(float(value))
    return str(value)
