"""A TOML document whose tables know their file and line, for messages."""

from __future__ import annotations

import difflib
import math
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ocp.system import Label

DEGREE = math.pi / 180.0
NOTHING = re.compile(r"\"[^\"]*\"|'[^']*'|#.*")  # strings and comments, in which brackets count for nothing
HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\],]+?)\s*\]\]?\s*(?:#.*)?$")
ENTRY = re.compile(r"\s*((?:\"[^\"]*\"|'[^']*'|[\w\-. ])+?)\s*=")
PART = re.compile(r"\"[^\"]*\"|'[^']*'|[^.\s]+")
KINDS = {int: "a number", float: "a number", str: "a text", list: "a list", dict: "a table"}


class SceneError(ValueError):
    """A scene file that cannot be used; the message is one sentence that names the file, the line and the key."""


@dataclass(frozen=True)
class Table:
    """A table of a document: its entries, its key in dots, and where the keys stand in the file."""

    file: str
    lines: Mapping[str, int]  # key in dots -> line
    key: str
    entries: Mapping[str, object]

    def error(self, name: str, sentence: str) -> SceneError:
        """Return the error that `sentence` is about the entry `name` of this table; "" for the table itself."""
        full = self.full(name)
        line = next((self.lines[known] for known in _outwards(full) if known in self.lines), None)
        source = self.file if line is None else f"{self.file}, line {line}"
        return SceneError(f"{source}: {full}: {sentence}" if full else f"{source}: {sentence}")

    def full(self, name: str) -> str:
        """Return the key of an entry in dots."""
        return ".".join(part for part in (self.key, name) if part)

    def only(self, known: Iterable[str]) -> None:
        """Raise SceneError for the first key that is not among the known ones."""
        names = list(known)
        for name in self.entries:
            if name not in names:
                raise self.error(name, unknown("key", name, names))

    def require(self, *names: str) -> None:
        """Raise SceneError for the first key that is missing."""
        for name in names:
            if name not in self.entries:
                raise self.error("", f"the key {name!r} is missing")

    def text(self, name: str, choices: Iterable[str], default: str | None = None) -> str:
        """Return an entry that is one of the texts in `choices`."""
        if name not in self.entries and default is not None:
            return default
        self.require(name)
        value, right = self.entries[name], list(choices)
        if not isinstance(value, str):
            raise self.error(name, f"got {describe(value)}, expected one of {quoted(right)}")
        if value not in right:
            raise self.error(name, unknown("choice", value, right))
        return value

    def table(self, name: str) -> Table:
        """Return an entry that is a table; an empty one if there is none."""
        value = self.entries.get(name, {})
        if not isinstance(value, dict):
            raise self.error(name, f"got {describe(value)}, expected a table")
        return self.inner(name, value)

    def tables(self, name: str) -> tuple[Table, ...]:
        """Return the entries of a list of tables, counted from 1 in messages; none if there is no such key."""
        value = self.entries.get(name, [])
        if not isinstance(value, list):
            raise self.error(name, f"got {describe(value)}, expected a list of tables, [[{self.full(name)}]]")
        for number, one in enumerate(value, 1):
            if not isinstance(one, dict):
                raise self.error(f"{name}[{number}]", f"got {describe(one)}, expected a table")
        return tuple(self.inner(f"{name}[{number}]", one) for number, one in enumerate(value, 1))

    def inner(self, name: str, entries: Mapping[str, object]) -> Table:
        """Return a table inside of this one."""
        return Table(self.file, self.lines, self.full(name), entries)

    def number(self, name: str, unit: str, default: float | None = None) -> float:
        """Return an entry that is one finite number, in `unit`; `name`_deg for an angle in degrees."""
        if default is not None and not self.has(name):
            return default
        return self.column(name, (Label(name, unit),))[0]

    def has(self, name: str) -> bool:
        """Whether there is an entry `name`, in degrees or not."""
        return name in self.entries or f"{name}_deg" in self.entries

    def column(self, name: str, parts: Sequence[Label], missing: float | None = None) -> tuple[float, ...]:
        """Return an entry that gives one number for each part: a list, a table by name, or one number for all.

        Args:
            name: of the entry; with `_deg` behind it angles are in degrees, and lengths stay in metres.
            parts: what the components are called, and their units.
            missing: value of the parts that a table does not name; None if it must name all.

        Returns:
            (len(parts),) in SI and radians.

        Raises:
            SceneError: no such entry or two, another number of components, no finite numbers, a wrong name, degrees
                where nothing is an angle.
        """
        degrees = f"{name}_deg" in self.entries
        spelled = f"{name}_deg" if degrees else name
        if degrees and name in self.entries:
            raise self.error(spelled, f"stands beside {name!r}; keep one of them")
        self.require(spelled)
        if degrees and not any(is_angle(part.unit) for part in parts):
            raise self.error(spelled, f"degrees are for angles, and this is in {parts[0].unit}; write {name!r}")
        value = self.entries[spelled]
        if isinstance(value, dict):
            return self._by_name(spelled, self.inner(spelled, value), parts, missing, degrees)
        if isinstance(value, list):
            if len(value) != len(parts):
                count = f"{len(value)} number{'' if len(value) == 1 else 's'}"
                raise self.error(spelled, f"got {count}, expected {len(parts)}: {', '.join(map(str, parts))}")
            numbers = [self.finite(spelled, one, part.unit) for one, part in zip(value, parts, strict=True)]
        else:
            only = self.finite(spelled, value, "/".join(dict.fromkeys(part.unit for part in parts)))
            if degrees and not all(is_angle(part.unit) for part in parts):
                raise self.error(spelled, f"one number for angles and lengths; list {', '.join(map(str, parts))}")
            numbers = [only] * len(parts)
        return tuple(
            DEGREE * one if degrees and is_angle(part.unit) else one for one, part in zip(numbers, parts, strict=True)
        )

    def finite(self, name: str, value: object, unit: str) -> float:
        """Return one value of the entry `name` as a float, or raise SceneError if it is no finite number."""
        expected = f"expected a finite number{f' in {unit}' if unit else ''}"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(name, f"got {describe(value)}, {expected}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(name, f"got {number}, {expected}")
        return number

    def _by_name(
        self, name: str, inner: Table, parts: Sequence[Label], missing: float | None, degrees: bool
    ) -> tuple[float, ...]:
        if degrees:
            raise self.error(name, f"in a table each angle has its own suffix: {name.removesuffix('_deg')} = "
                             f"{{ {parts[0].name}_deg = ... }}")  # fmt: skip
        inner.only(spellings(parts))
        absent = [part.name for part in parts if not inner.has(part.name)]
        if absent and missing is None:
            raise inner.error("", f"names no {', no '.join(absent)}; expected {', '.join(map(str, parts))}")
        return tuple(
            inner.number(part.name, part.unit) if inner.has(part.name) else float(missing or 0.0) for part in parts
        )


def read_document(path: str | os.PathLike[str]) -> Table:
    """Read a TOML file; nothing in it is executed.

    Args:
        path: of the file.

    Raises:
        SceneError: there is no such file, it is no text in UTF-8, or no TOML; the message names file and line.
    """
    file = os.fspath(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{file}: is no text in UTF-8") from None
    return parse(text, file)


def parse(text: str, file: str) -> Table:
    """Return the document that a TOML text is.

    Args:
        text: TOML 1.0.
        file: what messages call it.

    Raises:
        SceneError: no TOML; the message names the line.
    """
    try:
        entries = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{file}: is nested too deeply for a scene") from None
    except ValueError as error:
        raise SceneError(f"{file}: is no TOML: {error}") from None
    return Table(file, _lines(text), "", entries)


def spellings(parts: Iterable[Label]) -> list[str]:
    """Return the keys that name the parts: each name, and with `_deg` behind it where it is an angle."""
    return [
        spelled
        for part in parts
        for spelled in ((part.name, f"{part.name}_deg") if is_angle(part.unit) else (part.name,))
    ]


def is_angle(unit: str) -> bool:
    """Whether a quantity in this unit is an angle or its rate."""
    return unit.split("/")[0].strip() == "rad"


def unknown(what: str, name: str, right: Sequence[str]) -> str:
    """Return the sentence that there is no such name, with the right ones, and the nearest if one is near."""
    near = difflib.get_close_matches(name, right, n=1)
    meant = f"; did you mean {near[0]!r}?" if near else ""
    return f"no {what} {name!r}, expected {'one of ' if len(right) > 1 else ''}{quoted(right) or 'none'}{meant}"


def describe(value: object) -> str:
    """Return a value of a document as a message shows it."""
    if isinstance(value, bool):
        return str(value).lower()
    shown = f"{value!r}" if isinstance(value, str) else str(value)
    kind = KINDS.get(type(value), "a date or time")
    return kind if isinstance(value, dict) else f"{kind}, {shown if len(shown) < 60 else shown[:57] + '...'}"


def quoted(names: Iterable[str]) -> str:
    """Return names as they stand in a sentence."""
    return ", ".join(names)


def _outwards(key: str) -> list[str]:
    """Return a key and those of the tables around it, from the inside."""
    parts = key.split(".")
    keys = [".".join(parts[: len(parts) - k]) for k in range(len(parts))]
    return [spelled for one in keys for spelled in dict.fromkeys((one, re.sub(r"\[\d+\]$", "", one)))]


def _lines(text: str) -> dict[str, int]:
    """Return the line on which each key of a document stands; keys inside of a value are left to that value's line."""
    results: dict[str, int] = {}
    many: dict[str, int] = {}
    table, depth = "", 0
    for number, line in enumerate(text.splitlines(), 1):
        bare = NOTHING.sub("", line)
        header, entry = HEADER.match(line), ENTRY.match(line)
        if depth == 0 and header:
            table = _dotted(header.group(2))
            if header.group(1) == "[[":
                many[table] = many.get(table, 0) + 1
                table = f"{table}[{many[table]}]"
            results.setdefault(table, number)
            continue
        if depth == 0 and entry:
            results.setdefault(".".join(part for part in (table, _dotted(entry.group(1))) if part), number)
        depth += sum(bare.count(one) for one in "[{") - sum(bare.count(one) for one in "]}")
    return results


def _dotted(key: str) -> str:
    return ".".join(part.strip("\"'") for part in PART.findall(key))
