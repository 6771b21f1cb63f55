"""Designs of experiments: which cases a study has."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ocp import checks

MOST = 10_000_000  # points of a random design
PLAIN = "a finite number, a text, a truth value or a tuple of them"
Value = float | int | bool | str | tuple[Any, ...]
Case = dict[str, Value]


class Design(Protocol):
    """A list of cases, each a mapping name -> value with the same names."""

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        ...


@dataclass(frozen=True, eq=False)
class Product:
    """Every combination of the values on all axes; the last axis runs fastest.

    Args:
        axes: name -> values: numbers, texts, truth values, or tuples of numbers.

    Raises:
        TypeError, ValueError: no axis, an axis without values, or another kind of value.
    """

    axes: Mapping[str, Sequence[Any]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", _axes("Product", self.axes))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on every axis."""
        return tuple(len(values) for values in self.axes.values())

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return [dict(zip(self.axes, point, strict=True)) for point in itertools.product(*self.axes.values())]


@dataclass(frozen=True, eq=False)
class Zip:
    """The first values of all axes, then the second ones, and so on.

    Args:
        axes: name -> values, the same number on every axis.

    Raises:
        TypeError, ValueError: as for Product, or axes of different lengths.
    """

    axes: Mapping[str, Sequence[Any]]

    def __post_init__(self) -> None:
        axes = _axes("Zip", self.axes)
        if len({len(values) for values in axes.values()}) > 1:
            counts = ", ".join(f"{name} {len(values)}" for name, values in axes.items())
            raise ValueError(f"Zip: the axes have different numbers of values ({counts}), expected equally many")
        object.__setattr__(self, "axes", axes)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return [dict(zip(self.axes, point, strict=True)) for point in zip(*self.axes.values(), strict=True)]


@dataclass(frozen=True, eq=False)
class Listed:
    """Cases given one by one.

    Args:
        rows: mappings name -> value, all with the same names.

    Raises:
        TypeError, ValueError: no row, a row with other names, or another kind of value than on an axis of Product.
    """

    rows: Sequence[Mapping[str, Any]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", plain_rows("Listed: rows", self.rows))

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return [dict(row) for row in self.rows]


@dataclass(frozen=True, eq=False)
class Random:
    """Independent points, evenly distributed over a box.

    Args:
        ranges: name -> (lower, upper).
        count: number of points.
        seed: the same seed gives the same points.

    Raises:
        TypeError, ValueError: a range that is not a pair of numbers lower < upper, count < 1 or beyond ten million.
    """

    ranges: Mapping[str, tuple[float, float]]
    count: int
    seed: int = 0

    def __post_init__(self) -> None:
        _check_box(self)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return _scaled(self, np.random.default_rng(self.seed).random((self.count, len(self.ranges))))


@dataclass(frozen=True, eq=False)
class LatinHypercube:
    """Random points, exactly one in each of `count` slices of every axis.

    Args:
        ranges: name -> (lower, upper).
        count: number of points.
        seed: the same seed gives the same points.

    Raises:
        TypeError, ValueError: as for Random.
        ImportError: SciPy is missing.

    Source: McKay, Beckman, Conover, A comparison of three methods for selecting values of input variables,
        Technometrics 21, 1979; scipy.stats.qmc.
    """

    ranges: Mapping[str, tuple[float, float]]
    count: int
    seed: int = 0

    def __post_init__(self) -> None:
        _check_box(self)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return _scaled(self, _sampler("LatinHypercube")(len(self.ranges), seed=self.seed).random(self.count))


@dataclass(frozen=True, eq=False)
class Sobol:
    """The first points of a scrambled Sobol sequence; evenly distributed if `count` is a power of two.

    Args:
        ranges: name -> (lower, upper).
        count: number of points.
        seed: the same seed gives the same points.

    Raises:
        TypeError, ValueError: as for Random.
        ImportError: SciPy is missing.

    Source: I. M. Sobol, USSR Comput. Math. Math. Phys. 7, 1967; Owen scrambling; scipy.stats.qmc.
    """

    ranges: Mapping[str, tuple[float, float]]
    count: int
    seed: int = 0

    def __post_init__(self) -> None:
        _check_box(self)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        power = max(0, math.ceil(math.log2(self.count)))
        points = _sampler("Sobol")(len(self.ranges), seed=self.seed).random_base2(power)
        return _scaled(self, points[: self.count])


def plain(name: str, value: object) -> Value:
    """Return a value of an axis as a Python number, text, truth value or tuple of them.

    Raises:
        ValueError: something else, or a number that is not finite.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(plain(name, one) for one in value)
    if isinstance(value, bool | str):
        return value
    if not isinstance(value, int | float):
        raise checks.refused(name, value, PLAIN)
    checks.number(name, value, PLAIN)
    return value


def plain_rows(name: str, rows: object) -> tuple[Case, ...]:
    """Return cases with values as `plain` returns them.

    Args:
        name: of the argument.
        rows: mappings name -> value, all with the same names, at least one.

    Raises:
        TypeError, ValueError: something else.
    """
    wanted = "a list of at least one mapping name -> value"
    result = checks.several(name, rows, wanted)
    if not result or not all(isinstance(row, Mapping) and row for row in result):
        raise checks.refused(name, rows, wanted)
    first = [str(one) for one in result[0]]
    for number, row in enumerate(result):
        for one in row:
            checks.text(f"{name}, names of case {number}", one)
        if row.keys() != result[0].keys():
            raise ValueError(
                f"{name}: case {number} has {', '.join(row)}, the first one {', '.join(first)}; give the same"
            )
    return tuple({one: plain(f"{name}, {one!r}", row[one]) for one in result[0]} for row in result)


def _axes(design: str, axes: Mapping[str, Sequence[Any]]) -> dict[str, tuple[Value, ...]]:
    if not isinstance(axes, Mapping) or not axes:
        raise checks.refused(f"{design}: axes", axes, "at least one axis, name -> values")
    results = {}
    for name, values in axes.items():
        checks.text(f"{design}: axes, each name", name)
        axis = f"{design}: axis {name!r}"
        values = values.tolist() if isinstance(values, np.ndarray) else values
        if not isinstance(values, Sequence) or isinstance(values, str | bytes) or not values:
            raise checks.refused(axis, values, "a list with at least one value")
        results[name] = tuple(plain(axis, value) for value in values)
    return results


def _check_box(design: Random | LatinHypercube | Sobol) -> None:
    kind = type(design).__name__
    if not isinstance(design.ranges, Mapping) or not design.ranges:
        raise checks.refused(f"{kind}: ranges", design.ranges, "name -> (lower, upper)")
    ranges = {}
    for name, pair in design.ranges.items():
        checks.text(f"{kind}: ranges, each name", name)
        wanted = "(lower, upper), finite numbers lower < upper"
        low, high = checks.column(f"{kind}: range of {name!r}", pair, 2, wanted)
        if not low < high:
            raise checks.refused(f"{kind}: range of {name!r}", pair, wanted)
        ranges[name] = float(low), float(high)
    object.__setattr__(design, "ranges", ranges)
    checks.whole(f"{kind}: count", design.count, 1, MOST)
    checks.whole(f"{kind}: seed", design.seed, 0)


def _scaled(design: Random | LatinHypercube | Sobol, points: np.ndarray) -> list[Case]:
    """Return points (count, axes) of the unit cube as cases, scaled to the ranges."""
    low, high = np.array(list(design.ranges.values()), dtype=float).T
    return [dict(zip(design.ranges, row, strict=True)) for row in (low + points * (high - low)).tolist()]


def _sampler(name: str) -> Callable[..., Any]:
    try:
        from scipy.stats import qmc
    except ImportError:
        raise ImportError(f"{name} comes from SciPy: pip install scipy, or take Random") from None
    sampler: Callable[..., Any] = getattr(qmc, name)
    return sampler
