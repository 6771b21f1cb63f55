"""All cases of the stability suite, group by group."""

from __future__ import annotations

from stability_case import Case

CASES: tuple[Case, ...] = ()
