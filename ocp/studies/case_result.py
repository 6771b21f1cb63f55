"""The result of one case, and its row in the store: texts, numbers and JSON."""

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
class CaseResult:
    """Everything that is stored about one case.

    Args:
        id: identity of the case.
        parameters: name -> value of the case.
        status: "solved", "failed" (an exception), or the name of the status of a solution in lower case.
        way: how the solution was computed, such as "cold", "warm", "carried".
        message: of the solution, or the exception in words.
        results: name -> number, as returned by the measure or by the function.
        timings: name -> seconds.
        origin: identity of the case whose solution was the initial guess.
        structure: identity of the case whose switching structure the solution has.
        attempts: how often the case was tried.
        finished: time in UTC; filled in by the store.
        host: name of the computer; filled in by the store.
        solutions: name -> content of a solution file. Not read back together with the other fields.
    """

    id: str
    parameters: Mapping[str, Any]
    status: str
    way: str
    message: str
    results: Mapping[str, float] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    origin: str | None = None
    structure: str | None = None
    attempts: int = 1
    finished: str = ""
    host: str = ""
    solutions: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the case was solved."""
        return self.status == "solved"


def to_row(result: CaseResult) -> tuple[object, ...]:
    """Return a result as a row of the store, in the order of COLUMNS; NaN becomes null.

    Raises:
        TypeError, ValueError: parameters, results or timings that JSON cannot hold.
    """
    numbers = {name: None if math.isnan(value) else value for name, value in result.results.items()}
    return (
        result.id, to_json("result.parameters", result.parameters), result.status, result.way, result.message,
        to_json("result.results", numbers), to_json("result.timings", result.timings),
        result.origin, result.structure, result.attempts, result.finished, result.host,
    )  # fmt: skip


def from_row(row: tuple[Any, ...]) -> CaseResult:
    """Return the result that a row of the store holds.

    Raises:
        TypeError, ValueError: a row that `to_row` did not write.
    """
    name, parameters, status, way, message, results, timings, origin, structure, attempts, finished, host = row
    texts = {"id": name, "status": status, "way": way, "message": message, "finished": finished, "host": host}
    for column, value in texts.items():
        checks.text(column, value)
    for column, value in (("origin", origin), ("structure", structure)):
        checks.instance(column, value, str | None, "a text")
    checks.whole("attempts", attempts, 1)
    numbers = {key: math.nan if value is None else value for key, value in from_json("results", results).items()}
    seconds = from_json("timings", timings)
    for column, named in (("results", numbers), ("timings", seconds)):
        for key, value in named.items():
            checks.instance(f"{column}, {key}", value, int | float, "a number")
    case = {key: plain(f"parameters, {key}", value) for key, value in from_json("parameters", parameters).items()}
    return CaseResult(name, case, status, way, message, numbers, seconds, origin, structure, attempts, finished, host)


def to_json(name: str, value: Mapping[str, Any]) -> str:
    """Return named values as JSON.

    Args:
        name: of the argument, for the message.
        value: name -> number, text, truth value, None or a list of them.

    Raises:
        TypeError, ValueError: something that JSON cannot hold.
    """
    checks.mapping(name, value, "name -> value")
    try:
        return json.dumps(dict(value))
    except (TypeError, ValueError, RecursionError):
        raise checks.refused(name, value, "names with numbers, texts, truth values and lists of them") from None


def from_json(name: str, text: object) -> dict[str, Any]:
    """Return named values that were written as JSON.

    Args:
        name: of the column, for the message.
        text: JSON.

    Raises:
        TypeError, ValueError: no JSON, or JSON that is no object.
    """
    checks.text(name, text)
    try:
        result = json.loads(text)  # type: ignore[arg-type]
    except RecursionError:
        raise checks.refused(name, text, "JSON of few levels") from None
    checks.mapping(name, result, "name -> value")
    return result  # type: ignore[no-any-return]
