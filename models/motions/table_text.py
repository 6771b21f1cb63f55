"""Text tables of numbers: which separator, which decimal mark, where the header is, and the columns that are needed."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ocp import checks
from ocp.checks import Array

LONGEST = 65_536  # bytes of one line
COMMENTS = ("#", "%", "//")
BRACKETS = re.compile(r"^(?P<name>[^\[\]()]*?)\s*(?:[\[(](?P<unit>[^\[\]()]*)[\])])?$")
SUFFIX = re.compile(r"^(?P<name>.+?)_(?P<unit>deg|rad|mm|cm|ms|us|ns)$", re.IGNORECASE)
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}


@dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    Args:
        separator: between columns.
        comma: whether numbers have decimal commas.
        header: name and unit of every column; the unit is empty where none is stated.
        start: bytes before the first row of numbers.
        line: line number of that row.
        notes: sentences about what was recognised.
    """

    separator: str
    comma: bool
    header: tuple[tuple[str, str], ...]
    start: int
    line: int
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return [name for name, _ in self.header]


def layout_of(stream: BinaryIO) -> Layout:
    """Recognise the layout of a table whose first line, after comments, is the header.

    Raises:
        ValueError: no text, or no header.
        UnicodeDecodeError: no UTF-8.
    """
    notes: list[str] = []
    number, comment = 1, ""
    text = _first_line(stream)
    text = text.lstrip("\ufeff")  # a byte order mark
    while text.lstrip().startswith(COMMENTS):
        comment, start = text, stream.tell()
        text, number = _line(stream, number + 1), number + 1
        if _is_row(text):
            # numpy.savetxt writes the header as a comment.
            stream.seek(start)
            text, number = comment.lstrip(" \t#%/"), number - 1
            notes.append("a header in a comment")
            break
    start = stream.tell()
    following = _line(stream, number + 1)
    separator = _separator(text)
    header = tuple(_heading(cell) for cell in _cells(text, separator))
    _check_header(header)
    comma = separator != "," and "," in following and "." not in following
    if separator != ",":
        notes.append(f"columns separated by {SEPARATORS[separator]}{', decimal commas' if comma else ''}")
    elif comma:
        notes.append("decimal commas")
    return Layout(separator, comma, header, start, number + 1, tuple(notes))


def read_columns(file: Path, stream: BinaryIO, layout: Layout, columns: Sequence[int]) -> Array:
    """Return columns of the table as numbers (K, len(columns)); other columns may hold anything.

    Args:
        file: its path, for errors of reading.
        stream: of the file.
        layout: of the table.
        columns: indices.

    Raises:
        ValueError: a cell of these columns that is no number, or a line with another number of columns.
    """
    stream.seek(layout.start)
    splitter = None if layout.separator == " " else layout.separator
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of a table without rows, which is an error below
            table = np.loadtxt(
                _lines(stream, layout), delimiter=splitter, usecols=list(columns), ndmin=2, dtype=float,
                comments=None, quotechar='"',
            )  # fmt: skip
    except UnicodeDecodeError:
        raise
    except ValueError as error:
        if str(error).startswith("line "):
            raise
        _explain(stream, layout, columns)
        raise ValueError(str(error)) from None
    if table.size == 0:
        raise ValueError("there is no row of numbers after the header")
    return table


def is_number(text: str) -> bool:
    """Whether a text is a number, with a decimal point."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _first_line(stream: BinaryIO) -> str:
    raw = stream.readline(LONGEST + 1)
    if not raw.strip():
        raise ValueError("the file is empty" if not raw else "the first line is empty, expected the header t,q1,...")
    if len(raw) > LONGEST:
        raise ValueError(f"the header line is longer than {LONGEST} bytes; this is no table of a motion")
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in raw:
        raise ValueError("no UTF-8 text (UTF-16 or binary); save it as UTF-8")
    return raw.decode("utf-8").rstrip("\r\n")


def _line(stream: BinaryIO, number: int) -> str:
    raw = stream.readline(LONGEST + 1)
    if len(raw) > LONGEST:
        raise ValueError(f"line {number} is longer than {LONGEST} bytes")
    return raw.decode("utf-8").rstrip("\r\n")


def _lines(stream: BinaryIO, layout: Layout) -> Iterator[str]:
    """Yield the rows with decimal points, each with as many columns as the header."""
    width, separator = len(layout.header), layout.separator
    for number, raw in enumerate(iter(lambda: stream.readline(LONGEST + 1), b""), layout.line):
        if len(raw) > LONGEST:
            raise ValueError(f"line {number} is longer than {LONGEST} bytes")
        line = raw.decode("utf-8")
        if separator != " " and '"' not in line and line.count(separator) != width - 1 and line.strip():
            raise ValueError(f"line {number} has {line.count(separator) + 1} columns, the header has {width}")
        yield line.replace(",", ".") if layout.comma else line


def _explain(stream: BinaryIO, layout: Layout, columns: Sequence[int]) -> None:
    """Raise ValueError with the line and the cell that is no number."""
    stream.seek(layout.start)
    for number, line in enumerate(_lines(stream, layout), layout.line):
        if not line.strip():
            continue
        cells = _cells(line, layout.separator)
        if len(cells) != len(layout.header):
            raise ValueError(f"line {number} has {len(cells)} columns, the header has {len(layout.header)}")
        bad = next((cells[k].strip() for k in columns if not is_number(cells[k])), None)
        if bad is not None:
            got = checks.shown(bad[:40]) if bad else "an empty cell"
            raise ValueError(f"line {number}: {got} is no number")


def _separator(text: str) -> str:
    """Return the separator of a header: a tab or a semicolon wins over commas, which may stand in names or units."""
    for mark in ("\t", ";", ","):
        if mark in text:
            return mark
    if len(text.split()) > 1 and all(part[0] not in "[(" for part in text.split()):
        return " "
    raise ValueError(f"the header {text.strip()[:40]!r} has one column; expected columns separated by commas, "
                     "semicolons, tabs or spaces")  # fmt: skip


def _cells(text: str, separator: str) -> list[str]:
    return text.split() if separator == " " else text.strip("\r\n").split(separator)


def _heading(cell: str) -> tuple[str, str]:
    """Return name and unit of a heading: theta [deg], theta (deg) or theta_deg."""
    bare = cell.strip().strip('"').strip()
    match = BRACKETS.match(bare)
    if match is None:
        raise ValueError(f"the heading {cell!r} cannot be read, expected a name and maybe a unit in brackets")
    name, unit = match["name"].strip(), (match["unit"] or "").strip()
    if not unit and (suffix := SUFFIX.match(name)):
        name, unit = suffix["name"], suffix["unit"].lower()
    unit = unit.replace("²", "^2").replace("°", "deg").replace("s2", "s^2")
    return name, {"degrees": "deg", "degree": "deg", "radians": "rad"}.get(unit.lower(), unit)


def _check_header(header: Sequence[tuple[str, str]]) -> None:
    names = [name for name, _ in header]
    if all(is_number(name.replace(",", ".")) for name in names):
        raise ValueError("the first line holds numbers, expected the header t,q1,...")
    double = next((name for name in names if name and names.count(name) > 1), None)
    if double is not None:
        raise ValueError(f"the column {double!r} stands twice in the header")


def _is_row(text: str) -> bool:
    """Whether a line is a row of numbers."""
    cells = re.split(r"[;\t, ]+", text.strip())
    return bool(text.strip()) and sum(is_number(cell) for cell in cells) > len(cells) / 2
