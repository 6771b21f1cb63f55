"""A small reader of XML files without entities, document types, and without files that cost memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from ocp import checks

LARGEST = 32 * 1024 * 1024  # bytes of a file
DEEPEST = 64  # levels of elements
MOST = 200_000  # elements


class XmlError(ValueError):
    """A file that cannot be read, with its line where there is one."""


@dataclass(eq=False)
class Element:
    """An element with its attributes and children; text between tags is not kept."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Element]:
        """Return the children with a tag."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """Return the first child with a tag, None if there is none."""
        return next(self.all(tag), None)


def read_xml(path: str | Path) -> Element:
    """Return the root element of a file.

    Args:
        path: of a regular file of at most 32 MB.

    Raises:
        XmlError: no such file, no well-formed XML, a document type or an entity, more than 64 levels.
    """
    file = checks.path("path", path)
    try:
        if not file.is_file():
            raise XmlError(f"{file}: there is no such file")
        with file.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except OSError as error:
        raise XmlError(f"{file}: cannot be read ({error.strerror})") from None
    if len(data) > LARGEST:
        raise XmlError(f"{file}: has more than {LARGEST // 1024**2} MB, expected a robot description")
    return parse_xml(data, str(file))


def parse_xml(data: bytes, name: str) -> Element:
    """Return the root element of the text of a file.

    Args:
        data: bytes in an encoding that the XML declaration states, UTF-8 without one.
        name: of the file, for messages.

    Raises:
        XmlError: as `read_xml`.
    """
    parser = expat.ParserCreate()
    roots: list[Element] = []
    open_elements: list[Element] = []
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) >= DEEPEST or count > MOST:
            raise XmlError(
                f"{name}, line {parser.CurrentLineNumber}: more than {DEEPEST} levels or {MOST} elements, "
                "expected a robot description"
            )
        element = Element(tag, attributes, parser.CurrentLineNumber)
        (open_elements[-1].children if open_elements else roots).append(element)
        open_elements.append(element)

    def refuse(*_: object) -> int:
        raise XmlError(
            f"{name}, line {parser.CurrentLineNumber}: has a DOCTYPE or an entity, which are not read; delete it"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        words = expat.ErrorString(error.code)
        raise XmlError(f"{name}, line {error.lineno}: is no well-formed XML ({words})") from None
    except (LookupError, ValueError) as error:
        if isinstance(error, XmlError):
            raise
        raise XmlError(f"{name}: has an encoding that cannot be read ({error})") from None
    if not roots:
        raise XmlError(f"{name}: is empty")
    return roots[0]
