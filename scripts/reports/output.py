"""Where a command writes its files, and what it shows while it works."""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

DEFAULT = Path("results")
PATIENCE = 2.0  # seconds of work from which elapsed time is shown
NEEDS_PLOTLY = "a report needs Plotly: pip install plotly"
FORMATS = ("png", "svg", "pdf")
WIDTH = 76  # of a line of progress, so that it replaces what stood there


def add_output(parser: argparse.ArgumentParser, what: str) -> None:
    """Give a command its options --output, --force and --formats.

    Args:
        parser: of the command.
        what: what is written there, for the help.
    """
    parser.add_argument("--output", type=Path, metavar="DIR", help=f"folder for {what} (default: {DEFAULT})")
    parser.add_argument("--force", action="store_true", help=f"replace files in the default folder {DEFAULT} unasked")
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=["png"], help="of the pictures (default: png)")


def output_folder(options: argparse.Namespace, stem: str) -> Path:
    """Return the folder for the files of a command, made if need be; called before the work, so that none is lost.

    Files in a folder that was named by --output are replaced. In the default folder they are kept unless --force is
    given or the user, asked on a terminal, agrees.

    Args:
        options: with output and force, and maybe report.
        stem: with which the names of all files of the command begin.

    Raises:
        FileExistsError: files would be replaced and nobody agreed; the message says how to go on.
        OSError: the folder cannot be made or written to.
        ImportError: a report is asked for, and Plotly is not installed.
    """
    if getattr(options, "report", False) and find_spec("plotly") is None:
        raise ImportError(NEEDS_PLOTLY)
    folder = options.output or DEFAULT
    if options.output is None and not options.force and folder.is_dir():
        there = sorted(path.name for path in folder.iterdir() if path.name.startswith(stem))
        if there and not _agreed(folder, there):
            raise FileExistsError(
                f"{folder / there[0]}{f' and {len(there) - 1} more files' if len(there) > 1 else ''} would be "
                "replaced; use --force, or --output DIR for another folder"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # a folder without write permission, or a full disk, is noticed here
            return folder
    except FileExistsError:
        raise FileExistsError(f"--output: {folder} is a file, expected a folder") from None
    except OSError as error:
        raise OSError(f"--output: {folder} cannot be written to: {error.strerror or error}") from None


def _agreed(folder: Path, names: Sequence[str]) -> bool:
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    print(f"{folder} holds {', '.join(names[:4])}{' ...' if len(names) > 4 else ''}", file=sys.stderr)
    print("replace them? [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


@contextmanager
def working(what: str, shown: bool = True, own_line: bool = False) -> Iterator[None]:
    """Show what is going on and for how long, once it takes more than two seconds.

    On a terminal the line is renewed every second; elsewhere one line says that the work goes on, and one how long it
    took.

    Args:
        what: is going on, such as "polishing".
        shown: False shows nothing.
        own_line: whether the work renews a line of its own on a terminal, as solvers do; then only its end is shown.
    """
    begun, ended, terminal = time.perf_counter(), threading.Event(), sys.stderr.isatty()

    def watch() -> None:
        wait = PATIENCE
        while not ended.wait(wait):
            seconds = time.perf_counter() - begun
            line = f"{what} ... {seconds:.0f} s"
            print(f"\r{line:{WIDTH}}" if terminal else f"{what} ...\n", end="", file=sys.stderr, flush=True)
            wait = 1.0 if terminal else 1e9

    watcher = threading.Thread(target=watch, daemon=True)
    renewed = shown and not (own_line and terminal)
    if renewed:
        watcher.start()
    try:
        yield
    finally:
        ended.set()
        if renewed:
            watcher.join()
        seconds = time.perf_counter() - begun
        if shown and seconds > PATIENCE:
            line = f"{what}: {seconds:.1f} s"
            print(f"\r{line:{WIDTH}}" if terminal else line, file=sys.stderr, flush=True)
