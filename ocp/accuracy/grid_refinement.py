"""The grid of the next step of a refinement: where the error arises, and where a control jumps."""

from __future__ import annotations

import numpy as np

from ocp.accuracy.tolerances import Tolerance
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.pointwise import controls_without_bounds
from ocp.solution.accuracy import Errors
from ocp.solution.solution import Solution
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.families import FAMILIES
from ocp.transcription.schemes.scheme import Control, Scheme

SPARE = 0.5  # share of the tolerance that the elements together may use
CONCENTRATED = 0.01  # elements with less than this share of the largest error are not split yet
EVEN = 0.1  # ratio of median to largest error of the elements above which the error counts as spread over the grid
NEGLIGIBLE = 1e-3  # two neighbours with less than this share of their allowance are merged
WIDEST = 0.1  # share of the horizon, of a merged element
NARROWEST = 1e-9  # share of the horizon
MOST_PARTS = 4  # that an element is split into
HIGHEST = 9  # degree
LONGEST_RUN = 3  # neighbouring elements that one jump of a control may disturb
GROWN = 2.0  # times as many elements from which constant controls without bounds become linear instead
ISOLATED = 0.34  # an element of a run is narrow below this share of the run


def refine(solution: Solution, wanted: Tolerance, errors: Errors) -> tuple[Scheme, Grid]:
    """Return the scheme and the grid of the next step.

    Args:
        solution: with its problem.
        wanted: the tolerance.
        errors: estimated errors of the solution.
    """
    parts, ends, count = wanted.parts(solution, errors), solution.grid.ends, len(solution.grid)
    allowed = SPARE * wanted.tol / count
    marked = parts > max(allowed, CONCENTRATED * float(np.max(parts)))
    if not marked.any():
        marked = parts >= np.max(parts)
    scheme = solution.scheme
    jumps = _jumps(solution, marked)
    even = np.median(parts) > EVEN * np.max(parts) and not jumps
    if even and scheme.control is Control.COLLOCATED and scheme.degree < HIGHEST and scheme.name in FAMILIES:
        return FAMILIES[scheme.name](min(scheme.degree + 2, HIGHEST), scheme.control), solution.grid
    kept, added = np.ones(count + 1, dtype=bool), []
    done = np.zeros(count, dtype=bool)
    for first, last, shares in jumps:
        kept[first + 1 : last] = False
        done[first:last] = True
        a, b = ends[first], ends[last]
        half = (b - a) * float(np.clip(2.0 * (b - a), 0.02, 0.125))
        around = [one for share in shares for one in (share - half, share + half) if 0.0 < one < 1.0]
        # The jump may lie elsewhere once the other jumps have moved: no part keeps more than half of the width.
        parts_of = np.unique([a, *(one for one in around if a < one < b), b])
        long = np.diff(parts_of) > 0.5 * (b - a)
        added += [*around, *((parts_of[:-1] + parts_of[1:])[long] / 2.0)]
    for k in np.flatnonzero(marked & ~done).tolist():
        count_k = int(np.clip(np.ceil((parts[k] / allowed) ** (1.0 / 3.0)), 2, MOST_PARTS))
        added += list(np.linspace(ends[k], ends[k + 1], count_k + 1)[1:-1])
    k = 1
    while k < count:
        pair = parts[k - 1] + parts[k]
        if not (marked[k - 1] or marked[k]) and pair < NEGLIGIBLE * allowed and ends[k + 1] - ends[k - 1] < WIDEST:
            kept[k] = False
            k += 1
        k += 1
    nodes = np.unique(np.concatenate([ends[kept], added]))
    apart = np.append(True, np.diff(nodes) > NARROWEST)
    apart[-1] = True
    assert solution.problem is not None
    # Controls that expressions hold vary while one of these is at its limit.
    varying = scheme.control is Control.CONSTANT and len(controls_without_bounds(solution.problem)) > 0
    if varying and np.sum(apart) - 1 > GROWN * count:
        return FAMILIES[scheme.name](scheme.degree, Control.SEGMENTS), solution.grid
    return scheme, Grid(nodes[apart])


def _jumps(solution: Solution, marked: Array) -> list[tuple[int, int, list[float]]]:
    """Find controls that jump from limit to limit within a few marked elements.

    Returns:
        first and last index of the elements, and the shares of the horizon at which controls jump.
    """
    problem = solution.problem
    assert problem is not None
    nodes, weights = np.polynomial.legendre.leggauss(8)
    means = np.einsum("s,sc,kca->ka", weights / 2.0, solution.scheme.control_at((nodes + 1.0) / 2.0), solution.controls)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    widths_of_limits = np.where(np.isfinite(high - low), high - low, np.ptp(means, axis=0))
    ends, widths, count = solution.grid.ends, solution.grid.widths, len(solution.grid)
    results = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(int), [0]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first > LONGEST_RUN or first == 0 or last == count:
            continue
        shares = []
        for i in range(means.shape[1]):
            before, after = means[first - 1, i], means[last, i]
            if abs(after - before) < 0.5 * widths_of_limits[i]:
                continue
            share = np.clip((means[first:last, i] - after) / (before - after), 0.0, 1.0)
            shares.append(float(ends[first] + share @ widths[first:last]))
        # A jump that a narrow element holds already leaves no error in its neighbours: the control turns quickly there.
        inner, whole = slice(first, last), ends[last] - ends[first]
        held = [np.any((ends[inner] <= s) & (s <= ends[first + 1 : last + 1]) & (widths[inner] < ISOLATED * whole))
                for s in shares]  # fmt: skip
        if shares and not all(held):
            results.append((int(first), int(last), shares))
    return results
