"""All cases of the stability suite, group by group."""

from __future__ import annotations

import stability_extremes
import stability_frames
import stability_grids
import stability_horizon
import stability_input
import stability_inverse
import stability_pole
import stability_search
import stability_singular
import stability_stiff
import stability_stiff_optimal
import stability_tasks
import stability_units
from stability_case import Case

CASES: tuple[Case, ...] = (
    *stability_frames.CASES,
    *stability_pole.CASES,
    *stability_singular.CASES,
    *stability_units.CASES,
    *stability_extremes.CASES,
    *stability_grids.CASES,
    *stability_horizon.CASES,
    *stability_stiff.CASES,
    *stability_stiff_optimal.CASES,
    *stability_inverse.CASES,
    *stability_search.CASES,
    *stability_tasks.CASES,
    *stability_input.CASES,
)
