"""Content of values as a sequence of byte strings: numbers, containers, objects, graphs."""

from __future__ import annotations

import copyreg
import functools
import types
import weakref
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

import casadi as ca
import numpy as np

from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.studies import code_content, origins
from ocp.studies.graph_digits import hidden_digits
from ocp.system import System

MOST = 200_000  # byte strings, beyond which values that occur again are written as references
GRAPHS = ca.SX | ca.MX | ca.DM


class UnidentifiedError(ValueError):
    """A value whose content cannot be read, such as a lock or an open file.

    Args:
        kind: type of the value.
        reason: why its content cannot be read.
        variable: name of the global or enclosed variable that holds it, "" if there is none.
    """

    def __init__(self, kind: str, reason: str, variable: str = "") -> None:
        where = f" in the variable {variable!r}" if variable else ""
        self.kind, self.reason, self.variable = kind, reason, variable
        super().__init__(
            f"the content of a {kind}{where} cannot be identified ({reason}), so a change of it would go unnoticed; "
            f"give settings={{{variable or 'NAME'!r}: ...}} with a text or number that stands for it, "
            "or do without it in the function"
        )


@dataclass(eq=False)
class Coverage:
    """What an identity covers, by kind: names of functions, classes, files, libraries, and variables left out."""

    functions: dict[str, None] = field(default_factory=dict)
    classes: dict[str, None] = field(default_factory=dict)
    files: dict[str, None] = field(default_factory=dict)
    libraries: dict[str, str] = field(default_factory=dict)  # name -> version
    left_out: dict[str, None] = field(default_factory=dict)
    signatures: set[str] = field(default_factory=set)  # names of functions and of their arguments

    def __str__(self) -> str:
        named = (("function", self.functions), ("class", self.classes), ("file", self.files))
        parts = [f"{kind} {name}" for kind, names in named for name in names]
        parts += [" ".join(filter(None, one)) for one in sorted(self.libraries.items())]
        text = ", ".join(parts)
        return f"{text}; by settings: {', '.join(self.left_out)}" if self.left_out else text


class TooLongError(Exception):
    """The content has more than MOST byte strings: the same values occur in it again and again."""


class ContentWalk:
    """The walk through the content of a value; `brief` writes what occurs again as a reference."""

    def __init__(
        self, settings: Mapping[str, Any], strict: bool, brief: bool, of_graph: Callable[[System | Problem], str]
    ) -> None:
        self.coverage = Coverage()
        self._settings, self._strict, self._brief = settings, strict, brief
        self._of_graph = of_graph
        self._count = 0
        self._in_program = 0  # functions and machines of this program whose parts are being walked
        self._seen: dict[int, tuple[int, object]] = {}  # keeps the values alive, so that no id is used twice
        self._hashed: set[str] = set()  # libraries whose version is part of the content already

    def note(self, kind: str, name: str) -> None:
        """Note that something belongs to the content; a "module" is a library that stands there with its version."""
        names = {"function": self.coverage.functions, "class": self.coverage.classes, "file": self.coverage.files}
        if kind in names:
            names[kind][name] = None
            if kind == "function":
                head, bracket, arguments = name.partition("(")
                self.coverage.signatures.add(f"{head.rpartition('.')[2]}{bracket}{arguments}")
        elif name not in (*origins.OWN, "builtins") and origins.is_third_party(name):
            self.coverage.libraries[name] = origins.version_of(name)
            if kind == "module" or name == "casadi":
                self._hashed.add(name)

    def versions(self) -> dict[str, str]:
        """Return the versions of libraries that are not yet part of the content."""
        return {name: version for name, version in self.coverage.libraries.items() if name not in self._hashed}

    def named(self, values: Mapping[str, object], above: tuple[int, ...]) -> Iterator[bytes]:
        """Yield the content of global variables by name; the settings may stand for one that cannot be read."""
        yield b"dict"
        for name in sorted(values, key=repr):
            yield b"tuple"
            yield from self.chunks(name, above)
            try:
                yield from list(self.chunks(values[name], above))
            except UnidentifiedError as error:
                if name not in self._settings:
                    raise error if error.variable else UnidentifiedError(error.kind, error.reason, name) from None
                self.coverage.left_out[name] = None
                yield b"by settings"

    def chunks(self, value: object, above: tuple[int, ...]) -> Iterator[bytes]:
        """Yield the content of a value; `above` are the ids of the values that it is part of, so that circles end."""
        if id(value) in above:
            yield b"circle"
            return
        self._count += 1
        if self._brief and not isinstance(value, str | bytes | int | float):
            if id(value) in self._seen:
                yield f"as {self._seen[id(value)][0]}".encode()
                return
            self._seen[id(value)] = self._count, value
        elif self._count > MOST and not self._brief:
            raise TooLongError
        inside = (*above, id(value))
        yield type(value).__name__.encode()
        yield from self._content(value, inside)
        if origins.is_of_user(type(value)):
            yield from self.chunks(type(value), inside)

    def _content(self, value: Any, inside: tuple[int, ...]) -> Iterator[bytes]:
        if isinstance(value, str | bytes | int | float | complex | type(None) | Enum | PurePath):
            yield repr(value).encode()
        elif isinstance(value, np.ndarray | np.generic):
            yield from self._array(value, inside)
        elif isinstance(value, System | Problem):
            yield self._of_graph(value).encode()
        elif isinstance(value, Sequence):
            yield from self.chunks((value.problems, value.links), inside)
        elif isinstance(value, ca.Function):
            yield value.serialize().encode()
        elif isinstance(value, GRAPHS):
            yield str(value).encode()
            if not self._in_program:
                yield from hidden_digits(value)
        elif isinstance(value, functools.partial):
            yield from self.chunks((value.func, value.args, value.keywords), inside)
        elif isinstance(value, types.CodeType):
            yield value.co_code
            yield from self.chunks((value.co_names, value.co_consts), inside)
        elif isinstance(value, types.FunctionType):
            own = str(value.__module__).split(".")[0] in origins.OWN
            self._in_program += own
            yield from code_content.of_function(value, inside, self)
            self._in_program -= own
        elif isinstance(value, types.MethodType):
            yield from self.chunks((value.__func__, value.__self__), inside)
        elif isinstance(value, types.ModuleType):
            yield from code_content.of_module(value, self)
        elif isinstance(value, type):
            yield from code_content.of_class(value, inside, self)
        elif isinstance(value, types.BuiltinFunctionType | np.ufunc):
            yield from self._compiled(value, inside)
        elif isinstance(value, weakref.WeakKeyDictionary | weakref.WeakValueDictionary):
            yield b"a cache"
        elif isinstance(value, Mapping):
            for key in sorted(value, key=repr):
                yield from self.chunks((key, value[key]), inside)
            yield from self._extras(value, inside)
        elif isinstance(value, set | frozenset):
            for one in sorted(value, key=repr):
                yield from self.chunks(one, inside)
        elif isinstance(value, list | tuple):
            for one in value:
                yield from self.chunks(one, inside)
            yield from self._extras(value, inside)
        elif is_dataclass(value):
            yield type(value).__qualname__.encode()
            derived = "nominal" in (origins.released_parts(type(value)) or ())
            self._in_program += derived  # its graphs follow from the numbers in `nominal`
            for one in _counting(value):
                yield from self.chunks((one, getattr(value, one)), inside)
            self._in_program -= derived
            yield from self._extras(value, inside)
        else:
            yield origins.qualified_name(type(value)).encode()
            yield from self._object(value, inside)

    def _array(self, value: Any, inside: tuple[int, ...]) -> Iterator[bytes]:
        array = np.asarray(value)
        yield f"{array.dtype} {array.shape}".encode()
        if array.dtype.kind in "biufc":
            yield array.tobytes()
        elif array.dtype.hasobject and not all(isinstance(one, str | float | int | None) for one in array.flat):
            yield from self.chunks(array.tolist(), inside)
        else:
            yield repr(array.tolist()).encode()
        if isinstance(value, np.ma.MaskedArray):
            yield from self.chunks((np.ma.getmaskarray(value), value.fill_value), inside)

    def _compiled(self, value: Any, inside: tuple[int, ...]) -> Iterator[bytes]:
        """Yield the content of a compiled function: its name, and the object that it is a method of."""
        if isinstance(value, np.ufunc) and "(vectorized)" in value.__name__:
            yield from self._refused(value, "numpy.frompyfunc hides the function; use numpy.vectorize")
        yield origins.qualified_name(value).encode()
        self.note("library", str(getattr(value, "__module__", None) or "builtins").split(".")[0])
        owner = getattr(value, "__self__", None)
        if owner is not None and not isinstance(owner, types.ModuleType | type):
            yield from self.chunks(owner, inside)

    def _extras(self, value: Any, inside: tuple[int, ...]) -> Iterator[bytes]:
        """Yield what a container or dataclass has beside its items or fields."""
        kind = type(value)
        if kind.__module__ == "builtins" or kind.__module__.split(".")[0] in origins.OWN:
            return
        if isinstance(value, Mapping) and origins.is_third_party(kind.__module__.split(".")[0]):
            yield from self._object(value, inside)
            return
        known = {one.name for one in fields(value)} if is_dataclass(value) else set()
        rest = {name: one for name, one in _attributes(value).items() if name not in known}
        if isinstance(value, defaultdict):
            rest["default_factory"] = value.default_factory
        if rest and (origins.is_of_user(kind) or not is_dataclass(value)):
            yield from self.chunks(rest, inside)

    def _object(self, value: Any, inside: tuple[int, ...]) -> Iterator[bytes]:
        """Yield the attributes of an object, or what would be pickled where that is more or less than these."""
        kind, attributes = type(value), _attributes(value)
        self.note("library", kind.__module__.split(".")[0])
        if "__wrapped__" in attributes:  # a function behind functools.lru_cache
            attributes["__module__"] = origins.released_module(value)
            yield from self.chunks(attributes, inside)
            return
        if isinstance(value, range) and self._in_program:
            yield from self.chunks({}, inside)  # a count of coordinates, which the program derives from other values
            return
        registered = copyreg.dispatch_table.get(kind)
        try:
            made = registered(value) if registered else value.__reduce_ex__(4)
        except Exception as error:
            yield from self._refused(value, " ".join(str(error).split()))
            yield from self.chunks(attributes, inside)
            return
        if isinstance(made, str):
            yield made.encode()
        elif _is_plain(value, made):
            yield from self.chunks(attributes, inside)
        else:
            items = [list(part) if part is not None else None for part in made[3:5]]
            yield from self.chunks((*made[:3], *items), inside)

    def _refused(self, value: object, reason: str) -> Iterator[bytes]:
        if self._strict:
            raise UnidentifiedError(type(value).__name__, reason)
        yield b"not identified"


def _attributes(value: object) -> dict[str, object]:
    """Return the attributes of an object without the results of cached properties."""
    cached = {
        name for kind in type(value).__mro__ for name, one in vars(kind).items()
        if isinstance(one, functools.cached_property)
    }  # fmt: skip
    return {name: one for name, one in getattr(value, "__dict__", {}).items() if name not in cached}


def _is_plain(value: object, made: tuple[Any, ...]) -> bool:
    """Return whether pickling an object stores its class and its attributes and nothing else."""
    if made[0] is not copyreg.__newobj__ or len(made[1]) != 1 or any(part is not None for part in made[3:5]):  # type: ignore[attr-defined]
        return False
    state, attributes = made[2] or {}, getattr(value, "__dict__", {})
    return (
        isinstance(state, dict)
        and state.keys() == attributes.keys()
        and all(state[name] is attributes[name] for name in state)
    )


def _counting(value: Any) -> list[str]:
    """Return the names of those fields of a dataclass that are part of its content."""
    released, results = origins.released_parts(type(value)), []
    for one in fields(value):
        default = one.default_factory() if one.default_factory is not MISSING else one.default
        if not released or one.name in released or not _equal(getattr(value, one.name), default):
            results.append(one.name)
    return results


def _equal(value: object, default: object) -> bool:
    """Return whether a value is a default; arrays and graphs, which have no truth value, never are."""
    try:
        return type(value) is type(default) and bool(value == default)
    except (TypeError, ValueError, RuntimeError):
        return False
