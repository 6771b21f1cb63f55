"""ROS messages in text files: JSON, JSON lines, and YAML with any number of documents."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ocp import checks

DEEPEST = 6  # levels of mappings in which a message is looked for


def read_messages(path: str | os.PathLike[str]) -> list[Any]:
    """Return the messages of a file as plain data.

    Args:
        path: of the file, .json, .jsonl, .yaml or .yml; YAML needs the extra `ros`.

    Raises:
        OSError: no such file.
        ValueError: no JSON or YAML.
        ImportError: YAML without PyYAML.
    """
    file = checks.path("path", path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{file}: no UTF-8 text") from None
    if not text.strip():
        raise ValueError(f"{file}: the file is empty")
    documents = _json(file, text) if file.suffix.lower() in (".json", ".jsonl") else _yaml(file, text)
    messages = [document for document in documents if document is not None]
    return messages[0] if len(messages) == 1 and isinstance(messages[0], list) else messages


def inside(message: Any, wanted: tuple[str, ...], deep: int = DEEPEST) -> Iterator[Mapping[str, Any]]:
    """Yield the mappings in a message that have all wanted keys, from the outside to the inside, in order.

    Args:
        message: plain data.
        wanted: keys.
        deep: levels that are searched.
    """
    if isinstance(message, Mapping):
        if all(key in message for key in wanted):
            yield message
            return
        parts = list(message.values())
    elif isinstance(message, list):
        parts = message
    else:
        return
    if deep > 0:
        for part in parts:
            if isinstance(part, Mapping | list):
                yield from inside(part, wanted, deep - 1)


def _json(file: Path, text: str) -> list[Any]:
    try:
        return [json.loads(text)]
    except RecursionError as error:
        raise ValueError(f"{file}: no JSON ({error})") from None
    except json.JSONDecodeError as error:
        try:
            return [json.loads(line) for line in text.splitlines() if line.strip()]
        except (json.JSONDecodeError, RecursionError):
            raise ValueError(f"{file}: no JSON ({error})") from None


def _yaml(file: Path, text: str) -> list[Any]:
    try:
        import yaml
    except ImportError:
        raise ImportError(
            f"{file}: reading YAML needs PyYAML; install it with pip install pyyaml, or give the trajectory as JSON"
        ) from None
    try:
        return list(yaml.load_all(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"{file}: no YAML ({' '.join(str(error).split())})") from None
