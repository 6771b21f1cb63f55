"""Tree over the cases of a study: which case starts from the solution of which other one."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

BLOCK = 256  # cases whose distances to all others are computed at a time


def parents(cases: Sequence[Mapping[str, Any]]) -> list[int | None]:
    """Return for each case the number of the case that it starts from, None for a cold start.

    Numbers on an axis are replaced by their ranks, so that neighbours on a grid are one step apart. Cases are ordered
    by their distance from the median; each starts from the nearest case before it. Cases with different texts, truth
    values or tuples are never neighbours. The tree depends on nothing but the cases.

    Args:
        cases: with the same names.
    """
    if not cases:
        return []
    ranks, groups = _ranks(cases)
    result: list[int | None] = [None] * len(cases)
    for group in range(int(groups.max()) + 1):
        members = np.flatnonzero(groups == group)
        away = np.sum(np.abs(ranks[members] - np.median(ranks[members], axis=0)), axis=1)
        order = members[np.argsort(away, kind="stable")]
        for first in range(1, len(order), BLOCK):
            block = order[first : first + BLOCK]
            distances = np.sum(np.abs(ranks[block][:, None, :] - ranks[order[: first + len(block)]]), axis=2)
            for k, case in enumerate(block):
                result[int(case)] = int(order[int(np.argmin(distances[k, : first + k]))])
    return result


def nearest(cases: Sequence[Mapping[str, Any]], number: int, candidates: Sequence[int]) -> int | None:
    """Return the candidate that is nearest to a case, with equal texts; None if there is none.

    Args:
        cases: with the same names.
        number: of the case.
        candidates: numbers of other cases.
    """
    ranks, groups = _ranks(cases)
    members = [k for k in candidates if groups[k] == groups[number]]
    if not members:
        return None
    distances = np.sum(np.abs(ranks[members] - ranks[number]), axis=1)
    return int(members[int(np.argmin(distances))])


def between(first: Mapping[str, Any], last: Mapping[str, Any], share: float) -> dict[str, Any]:
    """Return the case on the straight line between two cases; only floating point numbers change along it.

    Args:
        first, last: cases with the same names.
        share: 0 at the first one, 1 at the last one.
    """
    if share >= 1.0:
        return dict(last)
    moving = {name for name in last if isinstance(first[name], float) and isinstance(last[name], float)}
    return {name: first[name] + share * (last[name] - first[name]) if name in moving else last[name] for name in last}


def neighbours(cases: Sequence[Mapping[str, Any]]) -> list[tuple[int, int]]:
    """Return the pairs of cases that differ in one number, by one step on its axis.

    Args:
        cases: with the same names.
    """
    numbers = {tuple(case.values()): number for number, case in enumerate(cases)}
    results = []
    for name in cases[0] if cases else ():
        if not all(_is_number(case[name]) for case in cases):
            continue
        values = sorted({case[name] for case in cases})
        following = dict(itertools.pairwise(values))
        for number, case in enumerate(cases):
            if case[name] in following:
                other = numbers.get(tuple({**case, name: following[case[name]]}.values()))
                results += [(number, other)] if other is not None else []
    return results


def _ranks(cases: Sequence[Mapping[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the ranks of the numbers (n, axes), and a number (n,) for each group of cases with equal texts."""
    columns, others = [], []
    for name in cases[0]:
        values = [case[name] for case in cases]
        if all(map(_is_number, values)):
            columns.append(np.unique(np.array(values, dtype=float), return_inverse=True)[1].ravel())
        else:
            others.append([repr(value) for value in values])
    keys = list(zip(*others, strict=True)) if others else [()] * len(cases)
    number = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    ranks = np.array(columns, dtype=float).T if columns else np.zeros((len(cases), 1))
    return ranks, np.array([number[key] for key in keys])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
