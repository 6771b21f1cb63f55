"""Checks of arguments. Each raises an error whose message names the argument, its value and what is expected."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

Array = np.ndarray
LONGEST = 60  # characters of a value in a message
# Finite numbers beyond this range are mistakes, and their powers overflow.
SMALLEST, LARGEST = 1e-40, 1e40
RANGE = f"from {SMALLEST:g} to {LARGEST:g} in size"
PATH = 240  # characters of a path in a message
FAR = float(np.finfo(float).max)


def shown(value: object) -> str:
    """Return a value as one short line for a message."""
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an array of shape {value.shape}"
    if isinstance(value, os.PathLike):
        return repr(str(value))[:PATH]
    try:
        words = " ".join(repr(value).split())
    except Exception:  # integers with too many digits, objects whose repr fails
        words = f"a {type(value).__name__}"
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 4]} ..."


def refused(name: str, value: object, expected: str) -> ValueError:
    """Return the ValueError for an argument with a wrong value.

    Args:
        name: of the argument, such as "Free: guess" or "x0".
        value: what was given.
        expected: what is valid, after the word "expected".
    """
    return ValueError(_message(name, value, expected))


def instance(name: str, value: object, kind: Any, expected: str) -> None:
    """Raise TypeError unless a value is of a kind.

    Args:
        name: of the argument.
        value: what was given.
        kind: a class, or several joined by `|`.
        expected: what is valid, after the word "expected".
    """
    if not isinstance(value, kind):
        raise TypeError(_message(name, value, expected))


def number(
    name: str,
    value: object,
    expected: str = "one finite number",
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    finite: bool = True,
) -> float:
    """Return one real number.

    Args:
        name: of the argument.
        value: what was given.
        expected: what is valid.
        above, at_least: limits of it; a number above 0 is at least `SMALLEST`.
        finite: whether it must be finite, and at most `LARGEST` in size; else it may be infinite within its limits.

    Raises:
        ValueError: not a number (strings and truth values are refused), or outside its range.
    """
    array = real(value)
    if array is None or array.size != 1 or (array.ndim and not isinstance(value, ca.DM)):
        raise refused(name, value, expected)
    result = float(array.item())
    # Infinity is above every finite limit, and minus infinity lies above none.
    low = result > above or (math.isinf(above) and not math.isnan(result))
    if not (low and result >= at_least) or (finite and not math.isfinite(result)):
        raise refused(name, value, expected)
    if (finite and abs(result) > LARGEST) or (above == 0.0 and result < SMALLEST):
        raise refused(name, value, f"{expected}, {RANGE}")
    return result


def whole(name: str, value: object, least: int, most: int | None = None, of: str = "") -> int:
    """Return a whole number from `least` to `most`.

    Args:
        name: of the argument.
        value: what was given.
        least, most: smallest and largest that fit; None for no largest but that of machine integers.
        of: what it counts, such as "elements".
    """
    top = 2**31 - 1 if most is None else most
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer) or not least <= value <= top:
        counted = f"a whole number{f' of {of}' if of else ''} "
        raise refused(name, value, counted + (f">= {least}" if most is None else f"from {least} to {most}"))
    return int(value)


def numbers(name: str, value: object, expected: str = "finite numbers", *, finite: bool = True) -> Array:
    """Return real numbers as an array of the shape in which they were given.

    Args:
        name: of the argument.
        value: what was given.
        expected: what is valid.
        finite: whether they must be finite, and at most `LARGEST` in size; else they may be infinite, never NaN.
    """
    array = real(value)
    if array is None or np.any(np.isnan(array)) or (finite and not np.all(np.isfinite(array))):
        raise refused(name, value, expected)
    if finite and np.any(np.abs(array) > LARGEST):
        raise refused(name, value, f"{expected}, {RANGE}")
    return array.copy() if array is value else array


def column(name: str, value: object, size: int | None = None, expected: str = "", *, finite: bool = True) -> Array:
    """Return real numbers as an array (n,).

    Args:
        name: of the argument.
        value: what was given; a scalar is one number.
        size: how many there must be; None for at least one.
        expected: what would fit; empty for as many finite numbers.
        finite: whether they must be finite; else they may be infinite, never NaN.
    """
    wanted = expected or f"{'finite numbers' if size is None else f'{size} finite number' + 's' * (size != 1)}"
    array = np.atleast_1d(numbers(name, value, wanted, finite=finite))
    if array.ndim == 2 and 1 in array.shape and isinstance(value, ca.DM):
        array = array.ravel()
    if array.ndim != 1 or (len(array) != size if size is not None else not len(array)):
        raise refused(name, value, wanted)
    return array


def points(name: str, value: object, expected: str, low: float = -FAR, high: float = FAR, *, least: int = 0) -> Array:
    """Return one number or several, (K,), within a closed interval.

    Args:
        name: of the argument.
        value: what was given.
        expected: what is valid.
        low, high: ends of the interval; by default all finite numbers.
        least: smallest number of values.
    """
    array = real(value)
    fits = array is not None and array.ndim <= 1 and array.size >= least
    if array is None or not fits or not np.all((array >= low) & (array <= high)):
        raise refused(name, value, expected)
    return np.atleast_1d(array)


def several(name: str, value: object, expected: str) -> list[Any]:
    """Return the items of an iterable as a list.

    Raises:
        TypeError: not iterable, or a string, mapping, array or CasADi symbol (iterable, but never meant as a list).
    """
    single = str | bytes | Mapping | np.ndarray | ca.SX | ca.MX | ca.DM | type  # type: ignore[type-arg]
    if isinstance(value, single) or not isinstance(value, Iterable):
        raise TypeError(_message(name, value, expected))
    return list(value)


def mapping(name: str, value: object, expected: str) -> None:
    """Raise TypeError unless a value is a mapping, such as a dict."""
    instance(name, value, Mapping, expected)


def text(name: str, value: object, expected: str = "a text") -> None:
    """Raise TypeError unless a value is a string."""
    instance(name, value, str, expected)


def truth(name: str, value: object) -> None:
    """Raise TypeError unless a value is True or False."""
    instance(name, value, bool | np.bool_, "True or False")


def expression(name: str, value: object, expected: str = "an expression such as system['q']") -> None:
    """Raise TypeError unless a value is a CasADi SX expression."""
    instance(name, value, ca.SX, expected)


def path(name: str, value: object) -> Path:
    """Return the path of a file, not empty and not that of a folder."""
    instance(name, value, str | os.PathLike, "the path of a file")
    if not os.fspath(value) or "\0" in str(value) or Path(value).is_dir():  # type: ignore[arg-type, call-overload]
        raise refused(name, value, "the path of a file")
    return Path(value)  # type: ignore[arg-type]


def real(value: object) -> Array | None:
    """Return real numbers as an array (a float array itself, to be read only), None for anything else."""
    if type(value) is float:
        return np.array(value)
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value  # a frequent case, and read only
    if isinstance(value, list | tuple) and any(isinstance(part, bool | str | bytes) for part in value):
        return None
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        return None  # a masked entry is no number
    if isinstance(value, ca.SX | ca.MX | str | bytes | dict | set | type(None)) or callable(value):
        return None
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O":
            if any(isinstance(part, str | bytes | bool | complex | type(None)) for part in array.ravel()):
                return None
            array = np.array(value, dtype=float)
    except Exception:  # numpy and CasADi raise their own for ragged lists, symbols, numbers of too many digits
        return None
    return array.astype(float) if array.dtype.kind in "fiu" else None


def _message(name: str, value: object, expected: str) -> str:
    return f"{name}{' is' if ': ' in name else ': got'} {shown(value)}, expected {expected}"
