"""How a command ends: its exit status, also when the program that reads its output has ended first."""

from __future__ import annotations

import argparse
import difflib
import os
import sys
from collections.abc import Callable
from typing import NoReturn

INTERRUPTED = 130  # as of a program that Ctrl-C ends: 128 + SIGINT
CLOSED = 141  # as of a program that the closed pipe ends: 128 + SIGPIPE


def command_parser(description: str, examples: str) -> argparse.ArgumentParser:
    """Return a parser that answers a wrong option with one line, and --help with examples.

    Args:
        description: what the command does.
        examples: and what else stands below the options.
    """
    parser = argparse.ArgumentParser(
        description=description, epilog=examples, formatter_class=argparse.RawDescriptionHelpFormatter
    )

    def error(message: str) -> NoReturn:
        options = [option for action in parser._actions for option in action.option_strings]
        unknown = [word for word in message.split() if word.startswith("--")] if "unrecognized" in message else []
        near = [match for word in unknown for match in difflib.get_close_matches(word.partition("=")[0], options, 1)]
        advice = f"; did you mean {near[0]}?" if near else ""
        parser.exit(2, f"{parser.prog}: {message}{advice} ({parser.prog} --help lists the options)\n")

    parser.error = error  # type: ignore[method-assign]
    return parser


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
    except KeyboardInterrupt:
        print("\ninterrupted; nothing more is written", file=sys.stderr)
        status = INTERRUPTED
    except BrokenPipeError:
        # Python flushes standard output once more when it ends, into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = CLOSED
    sys.exit(status)
