"""Progress of a study on the terminal: a bar where tqdm is installed, else a line every few seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ocp.studies.plan import Progress

EVERY = 5.0  # seconds between two lines


@contextmanager
def progress_of(total: int, shown: bool) -> Iterator[Callable[[Progress], None] | None]:
    """Yield the function that `Study.run` calls after every case.

    Args:
        total: number of cases.
        shown: False shows nothing and yields None.
    """
    if not shown:
        yield None
        return
    try:
        from tqdm import tqdm
    except ImportError:
        yield lines_of()
        return
    with tqdm(total=total, unit="case", dynamic_ncols=True) as bar:

        def watch(progress: Progress) -> None:
            if progress.last is None:
                bar.initial = bar.n = bar.last_print_n = progress.done
            bar.set_postfix(failed=progress.failed, refresh=False)
            bar.update(progress.done - bar.n)

        yield watch


def lines_of(every: float = EVERY) -> Callable[[Progress], None]:
    """Return a function that writes a line with cases done, failed, and the time that is left.

    Args:
        every: seconds between two lines, at least; the first and the last line are always written.
    """
    begun, last, before = time.monotonic(), -every, 0

    def watch(progress: Progress) -> None:
        nonlocal begun, last, before
        now = time.monotonic()
        if progress.last is None:
            begun, before = now, progress.done
        elif now - last < every and progress.done < progress.total:
            return
        last = now
        failed = f", {progress.failed} failed" if progress.failed else ""
        computed = progress.done - before
        rate = (now - begun) / computed if computed else 0.0
        left = f", {rate:.2g} s for a case, about {rate * (progress.total - progress.done):.0f} s left" if rate else ""
        print(f"study: {progress.done} of {progress.total} cases{failed}{left}", file=sys.stderr, flush=True)

    return watch
