"""Identity by content: the same settings give the same text of 64 hexadecimal digits, in every process."""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.metadata
import json
import sys
import types
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path, PurePath
from typing import Any

import casadi as ca
import numpy as np

from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence
from ocp.system import System

# Packages of this program -> module that lists where release 0.1.0 kept their classes and functions.
OWN = {
    "models": "models.scenes.released_modules",
    "ocp": "ocp.studies.released_modules",
    "reports": "reports.released_modules",
}
# Code of these is known by the version of the package.
KNOWN = ("builtins", "casadi", "models", "numpy", "ocp")


def digest(*parts: object) -> str:
    """Return the SHA-256 of the content of values, as 64 hexadecimal digits.

    Numbers, texts, arrays, containers, enumerations, dataclasses, systems and problems count by content; functions by
    their code, defaults, enclosed values and the globals that they name; classes and functions of the package by name.

    Args:
        parts: any values.
    """
    total = hashlib.sha256()
    for chunk in _chunks(parts, ()):
        total.update(len(chunk).to_bytes(8, "big"))
        total.update(chunk)
    return total.hexdigest()


def versions() -> dict[str, str]:
    """Return the versions that results depend on."""
    try:
        own = importlib.metadata.version("hamel")
    except importlib.metadata.PackageNotFoundError:
        own = "not installed"
    return {"hamel": own, "casadi": str(ca.CasadiMeta.version())}


def _chunks(value: object, above: tuple[int, ...]) -> Iterator[bytes]:
    """Yield the content of a value; `above` are the values it is part of, so that circles end."""
    if id(value) in above:
        yield b"circle"
        return
    inside = (*above, id(value))
    yield type(value).__name__.encode()
    if isinstance(value, str | bytes | int | float | complex | type(None) | Enum | PurePath):
        yield repr(value).encode()
    elif isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        yield f"{array.dtype} {array.shape}".encode()
        yield array.tobytes() if array.dtype.kind in "biufc" else repr(array.tolist()).encode()
    elif isinstance(value, System | Problem):
        yield _of_graph(value).encode()
    elif isinstance(value, Sequence):
        yield from _chunks((value.problems, value.links), inside)
    elif isinstance(value, ca.Function):
        yield value.serialize().encode()
    elif isinstance(value, ca.SX | ca.MX | ca.DM):
        yield str(value).encode()
    elif isinstance(value, functools.partial):
        yield from _chunks((value.func, value.args, value.keywords), inside)
    elif isinstance(value, types.CodeType):
        yield value.co_code
        yield from _chunks((value.co_names, value.co_consts), inside)
    elif isinstance(value, types.FunctionType):
        yield from _of_function(value, inside)
    elif isinstance(value, types.MethodType):
        yield from _chunks((value.__func__, value.__self__), inside)
    elif isinstance(value, types.ModuleType):
        yield f"{value.__name__} {getattr(value, '__version__', '')}".encode()
        if not _installed(value.__name__):
            yield Path(value.__file__).read_bytes() if value.__file__ else b""
    elif isinstance(value, type | types.BuiltinFunctionType | np.ufunc):
        yield _name(value).encode()
        if isinstance(value, type) and not _installed(value.__module__):
            yield from _chunks({k: v for k, v in vars(value).items() if isinstance(v, types.FunctionType)}, inside)
    elif isinstance(value, Mapping):
        for key in sorted(value, key=repr):
            yield from _chunks((key, value[key]), inside)
    elif isinstance(value, set | frozenset):
        for one in sorted(value, key=repr):
            yield from _chunks(one, inside)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _chunks(one, inside)
    elif is_dataclass(value):
        yield type(value).__qualname__.encode()
        for field in fields(value):
            yield from _chunks((field.name, getattr(value, field.name)), inside)
    else:
        yield _name(type(value)).encode()
        content = dict(getattr(value, "__dict__", {}))
        if "__wrapped__" in content:  # a function behind functools.lru_cache
            content["__module__"] = _module(value)
        yield from _chunks(content, inside)


def _of_function(function: types.FunctionType, above: tuple[int, ...]) -> Iterator[bytes]:
    yield f"{_module(function).split('.')[0]}.{function.__qualname__}".encode()
    cells = [_content(cell) for cell in function.__closure__ or ()]
    yield from _chunks(dict(zip(function.__code__.co_freevars, cells, strict=True)), above)
    if _installed(function.__module__):
        return
    yield from _chunks(function.__code__, above)
    yield from _chunks((function.__defaults__, function.__kwdefaults__), above)
    named = sorted(_names(function.__code__) & function.__globals__.keys())
    yield from _chunks({name: function.__globals__[name] for name in named}, above)


def _name(value: Any) -> str:
    """Return the name of a class or a compiled function: with its module, but within this package without it.

    A file of the package may move; classes keep the module that they had when their names first entered a store.
    """
    module, name = _module(value), getattr(value, "__qualname__", value.__name__)
    top = module.split(".")[0]
    if top in OWN and name not in _released(top):
        return f"{top}.{name}"
    return f"{module}.{name}"


def _module(value: Any) -> str:
    """Return the module of a class or function as identities have it: that of release 0.1.0, if it was in there."""
    module = str(getattr(value, "__module__", ""))
    top = module.split(".")[0]
    return _released(top).get(getattr(value, "__qualname__", ""), module) if top in OWN else module


@functools.cache
def _released(top: str) -> dict[str, str]:
    """Return qualified name -> module of release 0.1.0 for what that release had in a package."""
    try:
        modules: Mapping[str, str] = importlib.import_module(OWN[top]).MODULES
    except ImportError:  # a package of the user with the same name
        return {}
    return {name: module for module, names in modules.items() for name in names.split()}


def _installed(module: str) -> bool:
    """Return whether a module belongs to Python, to this package or to an installed one, known by its version."""
    top = module.split(".")[0]
    if top in KNOWN or top in sys.stdlib_module_names - {"__main__"}:
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is not None and bool({"site-packages", "dist-packages"} & set(Path(file).parts))


def _content(cell: types.CellType) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _names(code: types.CodeType) -> set[str]:
    """Return the names that a code and those inside of it look up."""
    result = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            result |= _names(constant)
    return result


@functools.lru_cache(maxsize=256)
def _of_graph(value: System | Problem) -> str:
    """Return the digest of a system or problem; its graph counts as the function that it would travel as."""
    return digest(_reduced(value))


def _reduced(value: Any) -> tuple[object, ...]:
    made = value.__reduce__()
    return tuple(made[1])


def as_json(case: Mapping[str, Any]) -> str:
    """Return a case as one line of JSON, with its names sorted."""
    return json.dumps(dict(case), sort_keys=True, allow_nan=False)
