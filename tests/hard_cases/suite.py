"""All cases of the stability suite, group by group."""

from __future__ import annotations

from hard_cases import (
    bad_input,
    extremes,
    frames,
    grids,
    horizon,
    inverse,
    pole,
    search,
    singular,
    stiff,
    stiff_optimal,
    tasks,
    units,
)
from hard_cases.case import Case

CASES: tuple[Case, ...] = (
    *frames.CASES,
    *pole.CASES,
    *singular.CASES,
    *units.CASES,
    *extremes.CASES,
    *grids.CASES,
    *horizon.CASES,
    *stiff.CASES,
    *stiff_optimal.CASES,
    *inverse.CASES,
    *search.CASES,
    *tasks.CASES,
    *bad_input.CASES,
)
