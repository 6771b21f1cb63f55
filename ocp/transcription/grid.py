"""Grids of [0, 1]: the ends of the elements as shares of the horizon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp import checks

ROUNDING = 1e-12  # distance from 0 and 1 within which an end of a grid counts as there


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of [0, 1].

    Args:
        ends: (N + 1,) strictly increasing shares of the horizon, first 0, last 1.

    Raises:
        ValueError: not a grid of [0, 1]; the message names the first wrong end.
    """

    ends: np.ndarray

    def __post_init__(self) -> None:
        given = checks.real(self.ends)
        if given is None:
            raise ValueError(f"Grid: got {checks.shown(self.ends)}, expected increasing numbers from 0 to 1")
        ends = given.copy()
        if ends.ndim != 1 or len(ends) < 2:
            raise ValueError(f"Grid: got shape {ends.shape}, expected at least the two numbers 0 and 1")
        # Sums of widths miss 0 and 1 by rounding.
        for end, exact in ((0, 0.0), (-1, 1.0)):
            if abs(ends[end] - exact) <= ROUNDING:
                ends[end] = exact
        if not (np.all(np.isfinite(ends)) and ends[0] == 0.0 and ends[-1] == 1.0):
            raise ValueError(f"Grid: runs from {ends[0]} to {ends[-1]}, expected 0 to 1 exactly")
        if not np.all(np.diff(ends) > 0.0):
            k = int(np.argmin(np.diff(ends) > 0.0))
            raise ValueError(f"Grid: not increasing at index {k + 1}: {ends[k]} is followed by {ends[k + 1]}")
        ends.flags.writeable = False
        object.__setattr__(self, "ends", ends)

    def __len__(self) -> int:
        return len(self.ends) - 1

    def __repr__(self) -> str:
        return f"Grid({len(self)} elements)"

    @property
    def widths(self) -> np.ndarray:
        """(N,) widths of the elements."""
        return np.diff(self.ends)

    def locate(self, share: np.ndarray) -> np.ndarray:
        """Return the element (len(share),) of each share of the horizon; an inner end belongs to the right."""
        checks.points("share", share, "shares of the horizon, finite numbers")
        return np.clip(np.searchsorted(self.ends, share, side="right") - 1, 0, len(self) - 1)


def uniform(elements: int) -> Grid:
    """Return the grid of `elements` equal elements.

    Raises:
        ValueError: not a whole number >= 1.
    """
    return Grid(np.linspace(0.0, 1.0, checks.whole("uniform", elements, 1, of="elements") + 1))


def given(ends: Sequence[float]) -> Grid:
    """Return the grid with the given ends of elements, shares of the horizon from 0 to 1."""
    return Grid(ends)  # type: ignore[arg-type]
