"""How a command ends: its exit status, also when the program that reads its output has ended first."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

CLOSED = 141  # as of a program that the closed pipe ends: 128 + SIGPIPE


def exit_with(main: Callable[[], int]) -> None:
    """Run a command and leave Python with its exit status; end quietly if its output is read no further.

    Args:
        main: returns the exit status.
    """
    status: int | str | None
    try:
        try:
            status = main()
        except SystemExit as ended:  # of --help, or of wrong options
            status = ended.code
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes standard output once more when it ends, into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = CLOSED
    sys.exit(status)
