"""A deadline for all solves within a block of code, however deep they are nested."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_DEADLINE: ContextVar[float] = ContextVar("deadline", default=float("inf"))


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Stop every solve of this thread at its next iteration once `seconds` of wall-clock time have passed [s].

    The solves end with `Status.LIMIT`, and no further initial guess is tried. Of nested deadlines the earliest counts.

    Args:
        seconds: from now on; inf for no deadline.
    """
    token = _DEADLINE.set(min(_DEADLINE.get(), time.perf_counter() + seconds))
    try:
        yield
    finally:
        _DEADLINE.reset(token)


def overdue() -> bool:
    """Return whether a deadline has passed."""
    return time.perf_counter() > _DEADLINE.get()
