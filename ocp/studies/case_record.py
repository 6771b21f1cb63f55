"""The record of a case: what a store of studies keeps of it, as a row of texts and numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ocp import checks
from ocp.studies.designs import plain

COLUMNS = "id, parameters, status, way, message, results, timings, origin, structure, attempts, finished, host"


@dataclass(frozen=True, eq=False)
class Record:
    """What is stored about a case."""

    id: str
    parameters: Mapping[str, Any]
    status: str  # "solved", "failed", or the name of the status of a solution
    way: str
    message: str
    results: Mapping[str, float] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    origin: str | None = None
    structure: str | None = None
    attempts: int = 1
    finished: str = ""
    host: str = ""
    solutions: Mapping[str, bytes] = field(default_factory=dict)  # not read back with the record

    @property
    def ok(self) -> bool:
        """Whether the case was solved."""
        return self.status == "solved"


def row_of(record: Record) -> tuple[object, ...]:
    """Return the row of a record, in the order of COLUMNS.

    Raises:
        TypeError, ValueError: parameters, results or timings that are no named texts and numbers.
    """
    results = {name: None if value != value else value for name, value in record.results.items()}
    texts = (
        written("record.parameters", dict(record.parameters)),
        written("record.results", results),
        written("record.timings", dict(record.timings)),
    )
    return (
        record.id, texts[0], record.status, record.way, record.message, texts[1], texts[2],
        record.origin, record.structure, record.attempts, record.finished, record.host,
    )  # fmt: skip


def record_of(row: tuple[Any, ...]) -> Record:
    """Return the record of a row.

    Raises:
        TypeError, ValueError: a row that no `row_of` wrote.
    """
    name, parameters, status, way, message, results, timings, origin, structure, attempts, finished, host = row
    words = {"id": name, "status": status, "way": way, "message": message, "finished": finished, "host": host}
    for column, word in words.items():
        checks.text(column, word)
    for column, word in (("origin", origin), ("structure", structure)):
        checks.instance(column, word, str | None, "a text")
    checks.whole("attempts", attempts, 1)
    numbers = {key: math.nan if value is None else value for key, value in read("results", results).items()}
    seconds = read("timings", timings)
    for column, result in (("results", numbers), ("timings", seconds)):
        for key, value in result.items():
            checks.instance(f"{column}, {key}", value, int | float, "a number")
    given = {key: plain(f"parameters, {key}", value) for key, value in read("parameters", parameters).items()}
    return Record(name, given, status, way, message, numbers, seconds, origin, structure, attempts, finished, host)


def written(name: str, value: Mapping[str, Any]) -> str:
    """Return named values as JSON.

    Raises:
        TypeError, ValueError: something that JSON cannot hold.
    """
    checks.mapping(name, value, "name -> value")
    try:
        return json.dumps(dict(value))
    except (TypeError, ValueError, RecursionError):
        raise checks.refused(name, value, "names with numbers, texts, truth values and lists of them") from None


def read(name: str, text: object) -> dict[str, Any]:
    """Return named values from JSON.

    Raises:
        TypeError, ValueError: something else.
    """
    checks.text(name, text)
    try:
        result = json.loads(text)  # type: ignore[arg-type]
    except RecursionError:
        raise checks.refused(name, text, "JSON of few levels") from None
    checks.mapping(name, result, "name -> value")
    return result  # type: ignore[no-any-return]
