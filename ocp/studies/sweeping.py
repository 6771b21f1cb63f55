"""Sweep: a function over cases, here or on any executor; what goes wrong becomes an outcome."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import islice
from typing import Any

from ocp import checks

AHEAD = 64  # cases handed to an executor before the first of them is taken back


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of one case.

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
        """Whether the function returned, and what it returned is no failed solution."""
        return not self.error and bool(getattr(self.value, "ok", True))


def sweep(
    function: Callable[..., Any], cases: Iterable[Mapping[str, Any]], executor: Executor | None = None
) -> Iterator[Outcome]:
    """Call a function for every case, function(**case), and yield the outcomes in the order of the cases.

    Nothing is stored, and no case knows of another; see `Study` for both.

    Args:
        function: of keyword arguments; with processes one that can travel, such as a function of a module.
        cases: mappings name -> value, or `Product({...}).cases()`.
        executor: any concurrent.futures.Executor; None calls here, one after the other.

    Raises:
        TypeError: function cannot be called, a case is no mapping, or executor has no submit.
    """
    check_function("sweep: function", function)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        told = checks.shown(executor)
        raise TypeError(f"sweep: executor is {told}, expected a concurrent.futures.Executor or None")
    rows = checks.several("sweep: cases", cases, "a list of mappings name -> value")
    for number, case in enumerate(rows):
        checks.mapping(f"sweep: case {number} of cases", case, "a mapping name -> value")
        for name in case:
            checks.text(f"sweep: cases, names of case {number}", name)
    return _outcomes(function, rows, executor)


def _outcomes(
    function: Callable[..., Any], rows: list[Mapping[str, Any]], executor: Executor | None
) -> Iterator[Outcome]:
    if executor is None:
        for case in rows:
            yield attempt(function, case)
        return
    waiting = iter(rows)
    running = deque((case, executor.submit(attempt, function, case)) for case in islice(waiting, AHEAD))
    while running:
        case, future = running.popleft()
        try:
            outcome = future.result()
        except Exception as error:  # the worker died, or something could not travel
            outcome = Outcome(case, None, in_words(error), 0.0)
        running += [(case, executor.submit(attempt, function, case)) for case in islice(waiting, 1)]
        yield outcome


def attempt(function: Callable[..., Any], case: Mapping[str, Any]) -> Outcome:
    """Return what comes of one call; an exception becomes its words.

    Args:
        function: of keyword arguments.
        case: name -> value.
    """
    begun = time.perf_counter()
    try:
        value, error = function(**case), ""
    except Exception as raised:
        value, error = None, in_words(raised)
    return Outcome(dict(case), value, error, time.perf_counter() - begun)


def in_words(error: BaseException) -> str:
    """Return an exception as one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def check_function(name: str, function: object) -> None:
    """Raise TypeError if what is given as a function cannot be called."""
    if not callable(function):
        told = checks.shown(function)
        raise TypeError(f"{name} is {told}, expected one that can be called with a case")
