"""Executor that sends several calls at once: many cheap cases on a cluster, whose scheduler would be the bottleneck."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from typing import Any

from ocp import checks

PAUSE = 0.05  # seconds after which an incomplete batch is sent

Call = tuple[Callable[..., Any], tuple[Any, ...]]


class Batches(Executor):
    """Executor that collects calls and hands them to another executor in batches.

    A call that raises fails alone. If a whole batch is lost, as with a worker that died, its calls are sent again one
    by one.

    Args:
        executor: such as `client.get_executor()` of Dask.
        size: calls of a batch.

    Raises:
        TypeError, ValueError: no executor, or a size below 1.
    """

    def __init__(self, executor: Executor, size: int = 25) -> None:
        checks.instance("executor", executor, Executor, "a concurrent.futures.Executor")
        checks.whole("size", size, 1)
        self._inner, self._size = executor, size
        self._lock = threading.Lock()
        self._waiting: list[tuple[Future[Any], Call]] = []
        self._timer: threading.Timer | None = None

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        """Return the future of a call, which is sent with others."""
        if keywords:
            raise TypeError("Batches: calls have no keyword arguments")
        future: Future[Any] = Future()
        with self._lock:
            self._waiting.append((future, (function, arguments)))
            full = len(self._waiting) >= self._size
            if not full and self._timer is None:
                self._timer = threading.Timer(PAUSE, self._send)
                self._timer.daemon = True
                self._timer.start()
        if full:
            self._send()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Send what is collected, and shut the other executor down."""
        self._send()
        self._inner.shutdown(wait=wait, cancel_futures=cancel_futures)

    def _send(self) -> None:
        with self._lock:
            batch, self._waiting = self._waiting, []
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
        if not batch:
            return
        try:
            whole = self._inner.submit(_each, [call for _, call in batch])
        except BaseException as error:
            for future, _ in batch:
                future.set_exception(error)
            return
        whole.add_done_callback(lambda done: self._arrived(done, batch))

    def _arrived(self, done: Future[Any], batch: Sequence[tuple[Future[Any], Call]]) -> None:
        error = done.exception()
        if error is None:
            for (future, _), (result, problem) in zip(batch, done.result(), strict=True):
                future.set_result(result) if problem is None else future.set_exception(problem)
        elif len(batch) == 1:
            batch[0][0].set_exception(error)
        else:
            for item in batch:
                try:
                    single = self._inner.submit(_each, [item[1]])
                except BaseException as broken:
                    item[0].set_exception(broken)
                    continue
                single.add_done_callback(lambda one, item=item: self._arrived(one, [item]))  # type: ignore[misc]


def _each(calls: Sequence[Call]) -> list[tuple[Any, Exception | None]]:
    """Return the result of every call, or what it raised."""
    results: list[tuple[Any, Exception | None]] = []
    for function, arguments in calls:
        try:
            results.append((function(*arguments), None))
        except Exception as error:
            results.append((None, error))
    return results
