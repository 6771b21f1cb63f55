"""Least-recently-used caches of objects that take long to make, one for each thread.

CasADi's solvers hold the state of a running solve, so that two threads must not share one.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import TypeVar

from ocp import checks

Value = TypeVar("Value")


class ThreadCache:
    """Objects by key; the one that was not asked for longest is dropped first.

    Args:
        most: number of objects kept in each thread.
    """

    def __init__(self, most: int) -> None:
        self._most = checks.whole("ThreadCache: most", most, 1)
        self._local = threading.local()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return the object kept under a key, or make and keep it.

        Args:
            key: of everything that the object depends on.
            make: called without arguments if nothing is kept under the key.
        """
        kept = self._kept
        if key in kept:
            kept.move_to_end(key)
        else:
            kept[key] = make()
            while len(kept) > self._most:
                kept.popitem(last=False)
        value: Value = kept[key]  # type: ignore[assignment]
        return value

    def clear(self) -> None:
        """Forget the objects of this thread."""
        self._kept.clear()

    @property
    def _kept(self) -> OrderedDict[Hashable, object]:
        if not hasattr(self._local, "kept"):
            self._local.kept = OrderedDict[Hashable, object]()
        kept: OrderedDict[Hashable, object] = self._local.kept
        return kept
