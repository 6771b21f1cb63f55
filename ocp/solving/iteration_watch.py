"""What watches a running NLP solver: it stops on request or at a deadline, and shows progress on the terminal."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.solving.deadline import overdue
from ocp.transcription.scaled_nlp import ScaledNlp

QUIET_SECONDS = 2.0  # a shorter solve shows no progress


class Watch(ca.Callback):  # type: ignore[misc]
    """Called by IPOPT at every iteration: stops on request, and shows progress once a solve has lasted a while.

    Args:
        nlp: that is solved.
        shown: whether to show progress; without it IPOPT passes no arrays to Python.
    """

    def __init__(self, nlp: ScaledNlp, shown: bool) -> None:
        ca.Callback.__init__(self)
        self._shapes = {"f": 1, "g": len(nlp.rows)} if shown else {}
        self._shown, self._cost = shown, nlp.cost
        self.reset()
        self.construct("watch", {})

    def reset(self, low: Array | None = None, high: Array | None = None) -> None:
        """Forget the last solve: no request to stop, no iterations.

        Args:
            low, high: (ng,) bounds of the rows, for the infeasibility in the line of progress.
        """
        self._low, self._high = low, high
        self.stop = False
        self.count, self._printed = 0, False
        self._begun = self._last = time.perf_counter()

    def interrupt(self, *_: object) -> None:
        """Ask the solver to stop after this iteration; asked twice, interrupt at once."""
        if self.stop:
            raise KeyboardInterrupt
        self.stop = True

    def get_n_in(self) -> int:
        """Return the number of inputs, those of a solver's results."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return the number of outputs."""
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Return the shape of input i; IPOPT does not pass empty ones."""
        rows = self._shapes.get(ca.nlpsol_out(i), 0)
        return ca.Sparsity.dense(rows, 1 if rows else 0)

    def has_eval_buffer(self) -> bool:
        """Return True: CasADi then calls `eval_buffer`, which takes a quarter of the time of `eval`."""
        return True

    def eval_buffer(self, arg: Sequence[memoryview], res: Sequence[memoryview]) -> int:
        """Write 1 to stop, on request or at a deadline, 0 to go on; show a line at most twice a second.

        Args:
            arg: results of the iteration so far; empty unless progress is shown.
            res: one number, the result.
        """
        now = time.perf_counter()
        self.count += 1
        if self._shown and now - self._begun > QUIET_SECONDS and now - self._last > 0.5:
            self._last, self._printed = now, True
            cost, g = float(np.frombuffer(arg[1])[0]), np.frombuffer(arg[2])
            beyond = (
                0.0
                if self._low is None or self._high is None
                else float(np.max([self._low - g, g - self._high], initial=0.0))
            )
            line = f"  iteration {self.count}, cost {self._cost * cost:.6g}, infeasibility {beyond:.1e}, "
            line += f"{now - self._begun:.0f} s"
            print(f"\r{line:76s}", end="", file=sys.stderr, flush=True)
        res[0].cast("d")[0] = float(self.stop or overdue())
        return 0

    def clear(self) -> None:
        """Wipe the line of progress, if there is one."""
        if self._printed:
            print(f"\r{'':76s}\r", end="", file=sys.stderr, flush=True)


@contextmanager
def interruptible(watch: Watch) -> Iterator[None]:
    """Let Ctrl-C ask the solver to stop, instead of throwing its last iterate away; in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, watch.interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
