"""Bad input: one valid call of everything public, every argument in turn replaced by what does not fit it."""

from __future__ import annotations

import linecache
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
LONGEST = 400  # characters of a sentence
REFUSALS = (ValueError, TypeError, KeyError, OSError)
# What no user should see first: lines of compiled sources, words of other libraries' own errors.
# What fits, or what there is, or why it cannot be.
CURE = re.compile(
    r"expected|give|use |there (is|are)|(it|this system) has|must|needs?|leaves nothing|at least|cannot|runs from|lasts"
)
FOREIGN = re.compile(r"Traceback|\.cpp|\.hpp|casadi::|Assertion|broadcast|NoneType|dtype|object is not|unsupported")

NAN, INF = math.nan, math.inf
BAD: Mapping[str, object] = {
    "none": None, "text": "abc", "no_text": "", "bytes": b"abc", "nan": NAN, "inf": INF, "minus_inf": -INF,
    "negative": -1.5, "zero": 0, "half": 0.5, "true": True, "complex": 1.0 + 2.0j, "huge": 10**400,
    "empty": [], "nans": [NAN, NAN, NAN], "infs": [INF, INF, INF], "words": ["a", "b", "c"], "nones": [None, None],
    "truths": [1.0, True, 0.5],
    "long": [float(k) for k in range(1, 18)], "falling": [1.0, 0.5, 0.0], "ragged": [[1.0], [2.0, 3.0]],
    "table": np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, NAN]]), "cube": np.ones((2, 3, 4)), "map": {},
    "names": {"no such": 1.0}, "thing": object(), "kind": dict, "function": math.hypot,
    "symbol": ca.SX.sym("foreign"), "symbols": ca.MX.sym("foreign", 3),
}  # fmt: skip

EXTREMES = (1e300, -1e300, 1e40, -1e40, 1e20, 1e-40, 1e-300, 5e-324)
# What fits an argument, by the names above.
REAL = frozenset({"negative", "zero", "half"})
POSITIVE = frozenset({"half"})
AT_LEAST_ZERO = frozenset({"zero", "half"})
BOUND = POSITIVE | {"inf"}  # a positive number, maybe without end
LIMIT = REAL | {"none", "inf", "minus_inf", "infs", "falling"}
ANY_TEXT = frozenset({"text", "no_text"})
OPTIONAL = frozenset({"none"})
NOTHING: frozenset[str] = frozenset()
TRUTH = frozenset({"true"})
LIST = frozenset({"empty"})
MAP = frozenset({"none", "map"})


@dataclass(frozen=True)
class Argument:
    """One argument of a call.

    Args:
        valid: a value that fits.
        fits: names of the values of BAD that fit as well.
        called: other words by which a sentence may name the argument.
    """

    valid: object
    fits: frozenset[str] = NOTHING
    called: tuple[str, ...] = ()


@dataclass(frozen=True)
class Call:
    """A valid call of something public.

    Args:
        name: such as "ocp.solve" or "Motion.quintic".
        function: what is called, with keyword arguments.
        arguments: of the call, by name.
        read: what is done with the result, such as taking the first rung of an iterator.
        needs: optional library without which the function raises ImportError, or "".
    """

    name: str
    function: Callable[..., object]
    arguments: Mapping[str, Argument] = field(default_factory=dict)
    read: Callable[..., object] = lambda result: result
    needs: str = ""

    def __call__(self, **changes: object) -> object:
        """Return what the call returns, with some arguments replaced."""
        given = {name: argument.valid for name, argument in self.arguments.items()}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return self.read(self.function(**(given | changes)))


@dataclass(frozen=True)
class Fault:
    """An error that does not help the user: of which call, argument and bad value, and what is wrong with it."""

    call: str
    argument: str
    bad: str
    what: str

    def __str__(self) -> str:
        return f"{self.call}({self.argument} = {self.bad}): {self.what}"


def refusals(call: Call) -> Iterator[tuple[str, str, Fault | None]]:
    """Yield argument, bad value and what is wrong with the error, None where nothing is."""
    for name, argument in call.arguments.items():
        for bad, value in BAD.items():
            if bad not in argument.fits:
                what = fault(partial(call, **{name: value}), (name, *argument.called), _evidence(value))
                yield name, bad, Fault(call.name, name, bad, what) if what else None


def extremes(call: Call) -> Iterator[tuple[str, str, Fault | None]]:
    """Yield argument, number and what is wrong with the error for numbers of extreme size, where a number fits.

    Such a number is refused with a sentence, or taken without a warning and without NaN in the result.
    """
    for name, argument in call.arguments.items():
        for number in EXTREMES if "half" in argument.fits else ():
            try:
                result = call(**{name: number})
                broken = isinstance(result, np.ndarray) and result.dtype.kind == "f" and bool(np.any(np.isnan(result)))
                what = "accepted, with NaN in the result" if broken else ""
            except REFUSALS as error:
                what = sentence(error, (name, *argument.called))
            except BaseException as error:  # anything else, warnings included, is a fault
                what = f"{type(error).__name__}: {error}"[:300]
            yield name, f"{number:g}", Fault(call.name, name, f"{number:g}", what) if what else None


def fault(attempt: Callable[[], object], names: tuple[str, ...], value: tuple[str, ...] = ()) -> str:
    """Return what is wrong with the error of an attempt, empty for one sentence that names the argument.

    Args:
        attempt: that should be refused.
        names: words by which the sentence may name the argument.
        value: words of which one must stand in it, as they show the value; empty for no such demand.
    """
    try:
        result = attempt()
    except REFUSALS as error:
        return sentence(error, names, value)
    except BaseException as error:  # anything else is a fault
        return f"{type(error).__name__}: {error}"[:300]
    return f"accepted, {type(result).__name__}"


def sentence(error: BaseException, names: tuple[str, ...], value: tuple[str, ...] = ()) -> str:
    """Return what is wrong with an error that a user sees, empty for nothing.

    Args:
        error: raised.
        names: words of which one must stand in it.
        value: words of which one must stand in it, as they show the value; empty if neither this nor what is expected
            is demanded, as of files.
    """
    text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    quoted = f"{type(error).__name__}: {text[:200]!r}"
    if isinstance(error, OSError) and error.filename:
        names = (*names, str(error.filename))
    if not isinstance(error, OSError) and not _raised_here(error):
        return f"not said by the product: {quoted}"
    if "\n" in text or not text.strip() or len(text) > LONGEST:
        return f"no one sentence ({len(text)} characters): {quoted}"
    if FOREIGN.search(text):
        return f"words of another library: {quoted}"
    if not any(re.search(rf"(?<!\w){re.escape(name)}(_\d+)*(?!\w)", text) for name in names):
        return f"does not name {' or '.join(names)}: {quoted}"
    if value and not any(word.lower() in text.lower() for word in value):
        return f"does not show the value: {quoted}"
    cured = not value or isinstance(error, OSError) or CURE.search(text)
    return "" if cured else f"does not say what is expected: {quoted}"


def _evidence(value: object) -> tuple[str, ...]:
    """Return words that show a value: how it is written, its kind, its size, its parts."""
    words = [type(value).__name__, "shape (", "the function" if callable(value) else type(value).__name__]
    if isinstance(value, list | np.ndarray):
        words += [f"has {len(value)}", f"of {len(value)} "]
    with suppress(ValueError):  # of integers with more digits than Python writes
        words += [" ".join(repr(value).split())[:12], str(value)[:12]]
    if isinstance(value, ca.SX | ca.MX):
        return (*words, "foreign", "has 1")
    if isinstance(value, np.ndarray):
        return (*words, str(value.shape), f"{value.size} ", "nan")
    if isinstance(value, list | dict):
        parts = [repr(part) for part in value if part is not None]
        numbers = [f"{part:g}" for part in value if isinstance(part, float)]
        return (
            *words,
            *parts,
            *numbers,
            f"{len(value)} ",
            "none" if None in value else "no " if not value else repr(value),
        )
    return (*words, "10000") if isinstance(value, int) and value > 1 else (*words, "1 numbers", "has 1")


def _raised_here(error: BaseException) -> bool:
    """Return whether an error comes from a `raise` of the product, not from an operation that went wrong."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return False
    source = Path(trace.tb_frame.f_code.co_filename)
    line = linecache.getline(str(source), trace.tb_lineno).strip()
    return ROOT in source.parents and line.startswith("raise ")
