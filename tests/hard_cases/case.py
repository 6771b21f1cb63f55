"""What a case of the stability suite is: a quantity at risk, measured at distances towards a degeneracy."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One measurement of the quantity at risk.

    Args:
        value: measured; a figure that is no number never passes.
        tolerance: largest value that passes.
        distance: from the degeneracy, as the case says; nan where there is none.
        condition: number of the problem measured, 1 at best; nan where none is meant.
        note: in words, such as the status of a solve or the reason of a refusal.
    """

    value: float
    tolerance: float
    distance: float = math.nan
    condition: float = math.nan
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is a number within the tolerance."""
        return abs(self.value) <= self.tolerance

    @property
    def share(self) -> float:
        """What the value takes of its tolerance; inf for no number, and for anything where nothing is allowed."""
        if math.isnan(self.value):
            return math.inf
        if self.tolerance == 0.0:
            return 0.0 if self.value == 0.0 else math.inf
        return abs(self.value) / self.tolerance


@dataclass(frozen=True)
class Case:
    """One way towards a degeneracy.

    Args:
        group: of cases, such as "frames".
        name: in words, unique in its group.
        quantity: at risk, with its unit or "relative".
        towards: what the distance is, such as "A / L_2"; empty if there is none.
        measure: yields the figures.
        fast: whether it belongs to the ordinary tests; all of them together take seconds.
        outside: why the case lies outside the declared domain; its failures are listed, not counted. Empty for inside.
    """

    group: str
    name: str
    quantity: str
    towards: str
    measure: Callable[[], Iterable[Figure]]
    fast: bool = True
    outside: str = ""

    def __str__(self) -> str:
        return f"{self.group}: {self.name}"


@dataclass(frozen=True)
class Finding:
    """What a case came to."""

    case: Case
    figures: tuple[Figure, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether there are figures and all pass."""
        return bool(self.figures) and all(figure.passed for figure in self.figures)

    @property
    def worst(self) -> Figure:
        """The figure that takes the largest share of its tolerance."""
        return max(self.figures, key=lambda figure: figure.share)


def run(case: Case) -> Finding:
    """Measure a case; an exception becomes a failing figure that names it."""
    begun = time.perf_counter()
    figures: list[Figure] = []
    try:
        for figure in case.measure():
            figures.append(figure)  # what came before an exception is kept
    except Exception as error:
        figures.append(Figure(math.nan, 0.0, note=f"{type(error).__name__}: {error}"))
    return Finding(case, tuple(figures), time.perf_counter() - begun)
