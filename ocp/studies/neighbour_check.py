"""Check of neighbouring cases between which the cost leaves its trend: each is solved again from the other one.

Where the solution of a neighbour leads to a lower cost, that solution is kept; where it does not, the neighbours are
noted as compared, and nothing is reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ocp.studies.case_result import CaseResult
from ocp.studies.case_solver import BETTER
from ocp.studies.designs import Case
from ocp.studies.main_effects import jump_pairs

ROUNDS = 20  # a better optimum may spread from neighbour to neighbour
COMPARED = "compared"  # key of `timings`, followed by identity and cost of the other case


def open_comparisons(cases: Sequence[Case], results: Sequence[CaseResult | None]) -> list[tuple[int, int]]:
    """Return pairs (case, neighbour): the case is to be solved again from the solution of the neighbour.

    Args:
        cases: of the study.
        results: of the cases.
    """
    costs = [one.results.get("cost") if one is not None and one.ok else None for one in results]
    pairs = []
    for a, b in jump_pairs(cases, costs):
        for case, other in ((a, b), (b, a)):
            one, another = results[case], results[other]
            if one is not None and another is not None and not is_compared(one, another):
                pairs.append((case, other))
    return pairs


def is_compared(result: CaseResult, other: CaseResult) -> bool:
    """Return whether a case has been solved again from the present solution of another case."""
    return _note(other) in result.timings


def _note(other: CaseResult) -> str:
    return f"{COMPARED} {other.id[:12]} {other.results['cost']:.10g}"


def compared(old: CaseResult, new: CaseResult, neighbour: CaseResult, files: Mapping[str, bytes]) -> CaseResult:
    """Return the better one of two results of a case, with a note that it was solved from a neighbour as well.

    Args:
        old: result so far.
        new: from the solution of the neighbour.
        neighbour: result of that case.
        files: solution files of the old result.
    """
    seconds = {_note(neighbour): new.timings.get("total", 0.0)}
    lower = new.ok and new.results["cost"] < old.results["cost"] - BETTER * abs(old.results["cost"])
    if lower:
        way = f"{new.way}, better than {old.way.partition(', better')[0]}"
        return replace(new, way=way, attempts=old.attempts, timings={**new.timings, **seconds})
    # Finished when it was: the same row in every run, except for the note.
    return replace(old, timings={**old.timings, **seconds}, solutions=files)


def unchecked_jumps(cases: Sequence[Case], results: Sequence[CaseResult | None]) -> list[tuple[int, int]]:
    """Return the pairs of neighbours between which the cost jumps and that have not been compared with each other."""
    return sorted({(min(pair), max(pair)) for pair in open_comparisons(cases, results)})
