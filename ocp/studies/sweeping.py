"""Call of a function for many cases, here or on any executor; an exception becomes part of the result."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import islice
from typing import Any

from ocp import checks
from ocp.studies.sending import end_with_parent, sendable

AHEAD = 64  # cases submitted to an executor before the first result is waited for


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of the call of a function for one case.

    Args:
        case: name -> value.
        value: what the function returned; None if it raised.
        error: "" or the exception in words.
        seconds: wall-clock time of the call [s].
    """

    case: Mapping[str, Any]
    value: Any
    error: str
    seconds: float

    @property
    def ok(self) -> bool:
        """Whether the function returned, and did not return a failed solution."""
        return not self.error and bool(getattr(self.value, "ok", True))


def sweep(
    function: Callable[..., Any], cases: Iterable[Mapping[str, Any]], executor: Executor | None = None
) -> Iterator[Outcome]:
    """Call a function for every case, function(**case), and yield the results in the order of the cases.

    Nothing is stored, and no case starts from the solution of another one; `Study` does both.

    Args:
        function: of keyword arguments; for executors with processes a function of a module, which can be pickled.
        cases: mappings name -> value, or `Product({...}).cases()`.
        executor: any concurrent.futures.Executor; None calls here, one after the other.

    Raises:
        TypeError: function cannot be called or sent to the processes of the executor, a case is no mapping, or executor
            has no submit.
    """
    check_function("sweep: function", function)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        shown = checks.shown(executor)
        raise TypeError(f"sweep: executor is {shown}, expected a concurrent.futures.Executor or None")
    rows = checks.several("sweep: cases", cases, "a list of mappings name -> value")
    for number, case in enumerate(rows):
        checks.mapping(f"sweep: case {number} of cases", case, "a mapping name -> value")
        for name in case:
            checks.text(f"sweep: cases, names of case {number}", name)
    return _results(sendable(function, executor), rows, executor)


def _results(
    function: Callable[..., Any], rows: list[Mapping[str, Any]], executor: Executor | None
) -> Iterator[Outcome]:
    if executor is None:
        for case in rows:
            yield attempt(function, case)
        return
    waiting = iter(rows)
    running = deque(
        (case, executor.submit(_attempt_for, os.getpid(), function, case)) for case in islice(waiting, AHEAD)
    )
    while running:
        case, future = running.popleft()
        try:
            result = future.result()
        except Exception as error:  # the worker died, or the case or its result could not be sent
            result = Outcome(case, None, in_words(error), 0.0)
        running += [(case, executor.submit(_attempt_for, os.getpid(), function, case)) for case in islice(waiting, 1)]
        yield result


def attempt(function: Callable[..., Any], case: Mapping[str, Any]) -> Outcome:
    """Call a function for one case; an exception becomes a sentence.

    Args:
        function: of keyword arguments.
        case: name -> value.
    """
    begun = time.perf_counter()
    try:
        value, error = function(**case), ""
    except (Exception, SystemExit) as raised:
        value, error = None, in_words(raised)
    return Outcome(dict(case), value, error, time.perf_counter() - begun)


def _attempt_for(owner: int, function: Callable[..., Any], case: Mapping[str, Any]) -> Outcome:
    end_with_parent(owner)
    return attempt(function, case)


def in_words(error: BaseException) -> str:
    """Return type and message of an exception as one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def check_function(name: str, function: object) -> None:
    """Raise TypeError if an argument that should be a function cannot be called."""
    if not callable(function):
        shown = checks.shown(function)
        raise TypeError(f"{name} is {shown}, expected one that can be called with a case")
