"""Designs of experiments: which cases a study has."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

Value = float | int | bool | str | tuple[Any, ...]
Case = dict[str, Value]


class Design(Protocol):
    """Something that lists cases, each a mapping name -> value with the same names."""

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        ...


@dataclass(frozen=True, eq=False)
class Product:
    """Every combination of the values on all axes; the last axis runs fastest.

    Args:
        axes: name -> values: numbers, texts, truth values, or tuples of numbers.

    Raises:
        ValueError: no axis, an empty one, or a value that is not plain.
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
        axes: name -> values, equally many on every axis.

    Raises:
        ValueError: as for Product, or axes of different length.
    """

    axes: Mapping[str, Sequence[Any]]

    def __post_init__(self) -> None:
        axes = _axes("Zip", self.axes)
        lengths = {name: len(values) for name, values in axes.items()}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{name} {count}" for name, count in lengths.items())
            raise ValueError(f"Zip: the axes have different numbers of values ({counts}), expected equally many")
        object.__setattr__(self, "axes", axes)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return [dict(zip(self.axes, point, strict=True)) for point in zip(*self.axes.values(), strict=True)]


@dataclass(frozen=True, eq=False)
class Listed:
    """Cases one by one.

    Args:
        rows: mappings name -> value, all with the same names.

    Raises:
        ValueError: no row, a row with other names, or a value that is not plain.
    """

    rows: Sequence[Mapping[str, Any]]

    def __post_init__(self) -> None:
        rows = list(self.rows)
        if not rows or not all(isinstance(row, Mapping) for row in rows):
            raise ValueError(f"Listed: got {self.rows!r}, expected at least one mapping name -> value")
        for number, row in enumerate(rows):
            if set(row) != set(rows[0]):
                raise ValueError(f"Listed: case {number} has {', '.join(row)}, the first one {', '.join(rows[0])}")
        plain_rows = tuple({name: plain(f"Listed: {name}", row[name]) for name in rows[0]} for row in rows)
        object.__setattr__(self, "rows", plain_rows)

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
        ValueError: a range that is no pair of numbers lower < upper, count < 1.
    """

    ranges: Mapping[str, tuple[float, float]]
    count: int
    seed: int = 0

    def __post_init__(self) -> None:
        _check_box(self)

    def cases(self) -> list[Case]:
        """Return the cases in order."""
        return _stretched(self, np.random.default_rng(self.seed).random((self.count, len(self.ranges))))


@dataclass(frozen=True, eq=False)
class LatinHypercube:
    """Points that lie in `count` different slices of every axis.

    Args:
        ranges: name -> (lower, upper).
        count: number of points.
        seed: the same seed gives the same points.

    Raises:
        ValueError: as for Random.
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
        return _stretched(self, _sampler("LatinHypercube")(len(self.ranges), seed=self.seed).random(self.count))


@dataclass(frozen=True, eq=False)
class Sobol:
    """The first points of a scrambled Sobol sequence; balanced where `count` is a power of two.

    Args:
        ranges: name -> (lower, upper).
        count: number of points.
        seed: the same seed gives the same points.

    Raises:
        ValueError: as for Random.
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
        return _stretched(self, points[: self.count])


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
    if isinstance(value, int | float) and math.isfinite(value):
        return value
    raise ValueError(f"{name}: got {value!r}, expected a finite number, a text, a truth value or a tuple of numbers")


def _axes(design: str, axes: Mapping[str, Sequence[Any]]) -> dict[str, tuple[Value, ...]]:
    if not isinstance(axes, Mapping) or not axes:
        raise ValueError(f"{design}: got {axes!r}, expected at least one axis, name -> values")
    found = {}
    for name, values in axes.items():
        if not isinstance(name, str):
            raise ValueError(f"{design}: the axis {name!r} has no text as a name")
        if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or len(values) == 0:
            raise ValueError(f"{design}: the axis {name!r} is {values!r}, expected a list with at least one value")
        found[name] = tuple(plain(f"{design}: axis {name!r}", value) for value in values)
    return found


def _check_box(design: Random | LatinHypercube | Sobol) -> None:
    kind = type(design).__name__
    if not isinstance(design.ranges, Mapping) or not design.ranges:
        raise ValueError(f"{kind}: ranges is {design.ranges!r}, expected name -> (lower, upper)")
    for name, pair in design.ranges.items():
        try:
            low, high = (float(side) for side in pair)
        except (TypeError, ValueError):
            raise ValueError(f"{kind}: the range of {name!r} is {pair!r}, expected (lower, upper)") from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"{kind}: the range of {name!r} is {pair!r}, expected finite numbers lower < upper")
    for name, value, least in (("count", design.count, 1), ("seed", design.seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise ValueError(f"{kind}: {name} is {value!r}, expected a whole number >= {least}")


def _stretched(design: Random | LatinHypercube | Sobol, points: np.ndarray) -> list[Case]:
    """Return points of the unit cube as cases."""
    low, high = np.array(list(design.ranges.values()), dtype=float).T
    return [dict(zip(design.ranges, row, strict=True)) for row in (low + points * (high - low)).tolist()]


def _sampler(name: str) -> Callable[..., Any]:
    try:
        from scipy.stats import qmc
    except ImportError:
        raise ImportError(f'{name} comes from SciPy: pip install "hamel[study]", or take Random') from None
    sampler: Callable[..., Any] = getattr(qmc, name)
    return sampler
