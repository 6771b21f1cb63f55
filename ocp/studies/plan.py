"""The cases of a study in their order, and how far their computation is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from ocp.studies.case_result import CaseResult
from ocp.studies.case_solver import StudySettings
from ocp.studies.designs import Case


@dataclass(frozen=True)
class Progress:
    """Progress of a study.

    Args:
        total: number of cases.
        done: cases that are finished, in this run or before.
        failed: cases of them that failed.
        last: result that was finished last, None before the first one.
    """

    total: int
    done: int
    failed: int
    last: CaseResult | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """The cases of a study and the order between them.

    Args:
        settings: of the study.
        cases: all of them.
        ids: identity of each case.
        parents: number of the case that each one starts from, None for a cold start.
    """

    settings: StudySettings
    cases: Sequence[Case]
    ids: Sequence[str]
    parents: Sequence[int | None]

    @cached_property
    def children(self) -> dict[int, list[int]]:
        """Case -> the cases that start from it."""
        results: dict[int, list[int]] = {}
        for number, parent in enumerate(self.parents):
            if parent is not None:
                results.setdefault(parent, []).append(number)
        return results
