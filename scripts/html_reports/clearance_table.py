"""Table of the least distances of the links along a motion."""

from __future__ import annotations

from reports.motion_clearance import Clearances

from html_reports import page


def clearance_table(clear: Clearances) -> str:
    """Return the least distances as a table of a page, the nearest first."""
    rows = [(one.body, one.other, one.least, wanted, t) for one, t, wanted in clear]
    return page.table(("link", "from", "least distance [m]", "to keep [m]", "at [s]"), rows)
