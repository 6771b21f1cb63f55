"""Which case of a study starts from which other one: a tree over the cases, the same whatever is run where."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

BLOCK = 256  # cases compared at a time with all others


def parents(cases: Sequence[Mapping[str, Any]]) -> list[int | None]:
    """Return for each case the number of the one it starts from, None for those that start from nothing.

    Numbers on an axis are replaced by their rank, so that neighbours on a grid are one step apart. Cases are taken in
    the order of their distance from the middle; each starts from the nearest one taken before it. Texts, truth values
    and tuples must be equal for two cases to be neighbours.

    Args:
        cases: with the same names.
    """
    if not cases:
        return []
    places, kinds = _places(cases)
    result: list[int | None] = [None] * len(cases)
    for kind in range(int(kinds.max()) + 1):
        members = np.flatnonzero(kinds == kind)
        away = np.sum(np.abs(places[members] - np.median(places[members], axis=0)), axis=1)
        order = members[np.argsort(away, kind="stable")]
        for first in range(1, len(order), BLOCK):
            block = order[first : first + BLOCK]
            distances = np.sum(np.abs(places[block][:, None, :] - places[order[: first + len(block)]]), axis=2)
            for k, case in enumerate(block):
                result[int(case)] = int(order[int(np.argmin(distances[k, : first + k]))])
    return result


def neighbours(cases: Sequence[Mapping[str, Any]]) -> list[tuple[int, int]]:
    """Return the pairs of cases that differ in one number only, by one step on its axis.

    Args:
        cases: with the same names.
    """
    known = {tuple(case.values()): number for number, case in enumerate(cases)}
    results = []
    for name in cases[0] if cases else ():
        if not all(_is_number(case[name]) for case in cases):
            continue
        values = sorted({case[name] for case in cases})
        following = dict(itertools.pairwise(values))
        for number, case in enumerate(cases):
            if case[name] in following:
                other = known.get(tuple({**case, name: following[case[name]]}.values()))
                results += [(number, other)] if other is not None else []
    return results


def _places(cases: Sequence[Mapping[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the ranks (n, axes) of the numbers, and which cases share everything that is no number (n,)."""
    columns, others = [], []
    for name in cases[0]:
        values = [case[name] for case in cases]
        if all(map(_is_number, values)):
            columns.append(np.unique(np.array(values, dtype=float), return_inverse=True)[1].ravel())
        else:
            others.append([repr(value) for value in values])
    kinds = list(zip(*others, strict=True)) if others else [()] * len(cases)
    number = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    places = np.array(columns, dtype=float).T if columns else np.zeros((len(cases), 1))
    return places, np.array([number[kind] for kind in kinds])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
