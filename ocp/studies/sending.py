"""Sending functions to worker processes, and ending these when the process that started them is gone."""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.connection import wait
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

ADVICE = "move it to a module, a .py file that is imported, or pip install cloudpickle"


STAY = 5.0  # seconds that a process waits for the others of its pool at most


class NotSentError(TypeError):
    """A function that another process cannot receive: a lambda, a closure, one that was typed into a notebook."""


class _Sent:
    """An object as the content that cloudpickle made of it: functions with their code instead of their name."""

    def __init__(self, content: bytes) -> None:
        self.content = content

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[bytes]]:
        return _received, (self.content,)


@functools.lru_cache(maxsize=4)
def _received(content: bytes) -> Any:
    import cloudpickle

    return cloudpickle.loads(content)


def sendable(value: Any, executor: Executor | None) -> Any:
    """Return a value in a form that arrives in the processes of an executor as what it is.

    Threads take it as it is, Dask and MPI have a pickle of their own. For a pool of processes, what pickle cannot send
    goes through cloudpickle, if that is installed.

    Args:
        value: settings of a study.
        executor: that computes the cases; None computes in this process.

    Raises:
        NotSentError: it cannot be sent; one sentence with what to do.
    """
    if not isinstance(executor, ProcessPoolExecutor):
        return value
    try:
        content = bytes(ForkingPickler.dumps(value))
        if b"__main__" not in content or _has_file() or _is_forked(executor):
            return value
        reason = "it was typed into a notebook or a shell, which worker processes do not see"
    except Exception as error:
        reason = " ".join(str(error).split())
    try:
        import cloudpickle

        return _Sent(cloudpickle.dumps(value))
    except ImportError:
        raise NotSentError(f"the function cannot be sent to another process ({reason}); {ADVICE}") from None
    except Exception as error:
        words = " ".join(str(error).split())
        raise NotSentError(f"the function cannot be sent to another process ({words}); move it to a module") from None


def _has_file() -> bool:
    """Return whether the main program is a file, which worker processes can read."""
    main = sys.modules.get("__main__")
    file = getattr(main, "__file__", None)
    return getattr(main, "__spec__", None) is not None or (file is not None and Path(file).exists())


def _is_forked(executor: ProcessPoolExecutor) -> bool:
    context = getattr(executor, "_mp_context", None)
    return context is not None and context.get_start_method() == "fork"


def let_end_with_parent(executor: Executor | None) -> None:
    """Let all processes of a forked pool end with this one, also those that never get a case.

    A forked pool starts all its processes at once; each holds the pipes of the others open, so that none of them would
    notice that this process is gone. Other pools start a process only when there is a case for it.

    Args:
        executor: that computes the cases.
    """
    if isinstance(executor, ProcessPoolExecutor) and _is_forked(executor):
        count = getattr(executor, "_max_workers", 1)
        folder = tempfile.mkdtemp(prefix="hamel-")
        calls = [executor.submit(_stay, os.getpid(), folder, count) for _ in range(count)]

        def tidy(_: object) -> None:
            if all(call.done() for call in calls):
                shutil.rmtree(folder, ignore_errors=True)

        for call in calls:
            call.add_done_callback(tidy)


def _stay(owner: int, folder: str, count: int) -> None:
    """Watch the parent, and stay until every other process of the pool has taken a call of its own."""
    end_with_parent(owner)
    with contextlib.suppress(OSError):
        Path(folder, str(os.getpid())).touch()
        deadline = time.monotonic() + STAY
        while len(list(Path(folder).iterdir())) < count and time.monotonic() < deadline:
            time.sleep(0.01)


_watching = threading.Lock()


def end_with_parent(owner: int) -> None:
    """End this process within a second of its parent, however that ends; nothing in the process of the study itself.

    Args:
        owner: id of the process that runs the study.
    """
    parent = multiprocessing.parent_process()
    if parent is None or os.getpid() == owner or not _watching.acquire(blocking=False):
        return

    above = os.getppid()
    _end_with_pipe(parent.sentinel)

    def watch() -> None:
        # A process forked later may hold the sentinel open; then the id of the parent changes.
        with contextlib.suppress(OSError):
            while not wait([parent.sentinel], 1.0) and os.getppid() == above:
                pass
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()


def _end_with_pipe(pipe: int) -> None:
    """Let the kernel end this process when the other end of a pipe is closed, where the system can.

    A thread of this process would have to wait until a solver returns, which holds the lock of the interpreter.

    Args:
        pipe: file descriptor of its end for reading.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return
    with contextlib.suppress(OSError):
        fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
        if hasattr(fcntl, "F_SETSIG"):  # Linux; elsewhere SIGIO, which ends a process, too
            fcntl.fcntl(pipe, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(pipe, fcntl.F_SETFL, fcntl.fcntl(pipe, fcntl.F_GETFL) | os.O_ASYNC)
