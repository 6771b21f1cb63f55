"""Where classes, functions and modules come from: Python, a library, this program, or the user."""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import re
import sys
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Packages of this program -> module that lists where release 0.1.0 kept their classes and functions.
OWN = {
    "models": "models.scenes.released_modules",
    "ocp": "ocp.studies.released_modules",
    "reports": "reports.released_modules",
}
# Libraries whose version is hashed already, with the versions of the program or with a module value.
KNOWN = ("builtins", "casadi", "models", "numpy", "ocp")
COMMANDS = Path(__file__).parents[2] / "scripts"  # of this program; their classes count like those of ocp and models


def is_installed(module: str) -> bool:
    """Return whether a module belongs to Python, to this program or to an installed library."""
    top = str(module).split(".")[0]
    if top == "__main__":
        return False
    if top in KNOWN or top in sys.stdlib_module_names:
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is not None and is_library(Path(file))


def is_third_party(top: str) -> bool:
    """Return whether a top-level module is an installed library, no part of Python nor of this program."""
    return top not in (*OWN, *sys.stdlib_module_names) and is_installed(top)


def is_of_user(kind: type) -> bool:
    """Return whether a class was written by the user, not by this program nor by a library."""
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    return not is_installed(kind.__module__) and not (file and Path(file).is_relative_to(COMMANDS))


def qualified_name(value: Any) -> str:
    """Return the name of a class or a compiled function: with its module, but within this program without it.

    A file of the program may be moved; what was in release 0.1.0 keeps the module that it had then.
    """
    module, name = released_module(value), getattr(value, "__qualname__", value.__name__)
    top = module.split(".")[0]
    return f"{top}.{name}" if top in OWN and name not in _released(top) else f"{module}.{name}"


def released_module(value: Any) -> str:
    """Return the module of a class or function; for what release 0.1.0 had, its module in that release."""
    released = _in_release(value)
    return released.module if released else str(getattr(value, "__module__", ""))


def released_name(function: types.FunctionType) -> str:
    """Return the qualified name of a function; for what release 0.1.0 had, its name in that release."""
    released = _in_release(function)
    return released.name if released else function.__qualname__


def released_parts(value: Any) -> tuple[str, ...] | None:
    """Return the fields of a dataclass, or enclosed variables of a function, in release 0.1.0; None if not listed."""
    released = _in_release(value)
    return released.parts if released else None


def version_of(library: str) -> str:
    """Return the version of an installed library."""
    version = getattr(sys.modules.get(library), "__version__", None)
    if isinstance(version, str):
        return version
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        names = importlib.metadata.packages_distributions().get(library, ())
        return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)


@dataclass(frozen=True)
class _Released:
    """A class or function of release 0.1.0."""

    module: str
    name: str
    parts: tuple[str, ...]


def _in_release(value: Any) -> _Released | None:
    top = str(getattr(value, "__module__", "")).split(".")[0]
    return _released(top).get(getattr(value, "__qualname__", "")) if top in OWN else None


@functools.cache
def _released(top: str) -> dict[str, _Released]:
    """Return present name -> what a package of this program had in release 0.1.0."""
    try:
        text: str = importlib.import_module(OWN[top]).RELEASED
    except ImportError:  # a package of the user with the same name
        return {}
    results = {}
    for line in text.replace("\n    ", " ").strip().splitlines():
        module, _, names = line.partition(": ")
        for name, inner in re.findall(r"([^\s(]+)(?:\(([^)]*)\))?", names):
            present, _, former = name.partition("=")
            results[present] = _Released(module, former or present, tuple(inner.split()))
    return results


def is_library(path: Path) -> bool:
    """Return whether a file belongs to an installed library."""
    return bool({"site-packages", "dist-packages"} & set(path.parts))
