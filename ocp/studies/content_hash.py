"""Identity by content: equal content gives the same SHA-256, in every process and on every computer.

What a value is made of is written as a sequence of byte strings, which is hashed. Releases only add to this sequence
where an earlier one overlooked something, so that stored identities stay valid.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from typing import Any

import casadi as ca

from ocp.problem.problem import Problem
from ocp.studies.value_content import ContentWalk, Coverage, TooLongError
from ocp.system import System


def digest(*parts: object) -> str:
    """Return the SHA-256 of the content of values, as 64 hexadecimal digits.

    Numbers, texts, arrays, containers, enumerations, dataclasses, systems and problems count by content. Functions and
    classes of the user count by their code and everything that it refers to: enclosed values, globals, modules, base
    classes; those of libraries by name and version. Any other object counts by what would be pickled. A
    field that a dataclass of this program got after release 0.1.0 counts only if it differs from its default.

    Args:
        parts: any values.

    Raises:
        UnidentifiedError: a value whose content cannot be read.
    """
    return identify(parts)[0]


def identify(
    parts: tuple[object, ...], settings: Mapping[str, Any] | None = None, strict: bool = True
) -> tuple[str, Coverage]:
    """Return the digest of values, and what it covers.

    Args:
        parts: any values.
        settings: names of global variables for which a text or number stands whose content cannot be read.
        strict: whether a value whose content cannot be read is refused; otherwise its type counts.

    Raises:
        UnidentifiedError: such a value; the message names the variable and what to do.
    """
    for brief in (False, True):
        walk = ContentWalk(settings or {}, strict, brief, _of_graph)
        total = hashlib.sha256()
        try:
            for chunk in walk.chunks(parts, ()):
                total.update(len(chunk).to_bytes(8, "big"))
                total.update(chunk)
        except TooLongError:
            continue
        versions = walk.versions()
        if versions:
            total.update(json.dumps(versions, sort_keys=True).encode())
        return total.hexdigest(), walk.coverage
    raise AssertionError


def versions() -> dict[str, str]:
    """Return the versions of this program and of CasADi, on which results depend."""
    try:
        own = importlib.metadata.version("hamel")
    except importlib.metadata.PackageNotFoundError:
        own = "not installed"
    return {"hamel": own, "casadi": str(ca.CasadiMeta.version())}


def as_json(case: Mapping[str, Any]) -> str:
    """Return a case as one line of JSON, with its names sorted."""
    return json.dumps(dict(case), sort_keys=True, allow_nan=False)


@functools.lru_cache(maxsize=256)
def _of_graph(value: System | Problem) -> str:
    """Return the digest of a system or problem; its graph counts as the function that it would be pickled as."""
    return digest(tuple(value.__reduce__()[1]))  # type: ignore[arg-type]
