"""An initial guess: a motion given at some instants, interpolated linearly between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array


@dataclass(frozen=True, eq=False)
class Guess:
    """A motion on shares of the horizon, interpolated linearly.

    Args:
        share: (K,) increasing, from 0 to 1.
        x: (K, nx) states.
        u: (K, nu) controls.
        duration: [s].
        free: (nf,) values of the free parameters, empty for their nominal ones.
    """

    share: Array
    x: Array
    u: Array
    duration: float
    free: Array

    def __post_init__(self) -> None:
        share = checks.real(self.share)
        if (
            share is None
            or share.ndim != 1
            or len(share) < 2
            or not np.all(np.isfinite(share))
            or not (np.all(np.diff(share) >= 0.0) and share[0] == 0.0 and share[-1] == 1.0)
        ):
            raise checks.refused("Guess: share", self.share, "increasing numbers from 0 to 1")
        object.__setattr__(self, "share", share.copy())
        for name in ("x", "u"):
            table = checks.real(getattr(self, name))  # the solve reports a guess that is not finite
            if table is None:
                raise checks.refused(f"Guess: {name}", getattr(self, name), "numbers, one row for each share")
            object.__setattr__(self, name, table.copy())
            rows = table.shape
            if len(rows) != 2 or rows[0] != len(share):
                raise ValueError(f"Guess: {name} has shape {rows}, expected {len(share)} rows, one for each share")
        checks.number("Guess: duration", self.duration, "a finite number of seconds >= 0", at_least=0.0)
        free = checks.points("Guess: free", self.free, "values of the free parameters, or no numbers at all")
        object.__setattr__(self, "free", free)

    def state(self, share: Array) -> Array:
        """Return x at shares of the horizon, shape (..., nx)."""
        checks.numbers("share", share, "shares of the horizon, numbers")
        return _interpolate(share, self.share, self.x)

    def control(self, share: Array) -> Array:
        """Return u at shares of the horizon, shape (..., nu)."""
        checks.numbers("share", share, "shares of the horizon, numbers")
        return _interpolate(share, self.share, self.u)


def _interpolate(share: Array, known: Array, values: Array) -> Array:
    columns = [np.interp(share, known, column) for column in values.T]
    return np.stack(columns, axis=-1) if columns else np.zeros((*np.shape(share), 0))
