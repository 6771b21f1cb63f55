"""Content of functions, classes and modules of the user: their code and everything that the code refers to.

Code of libraries counts by the version of the library, code of this program by its own version.
"""

from __future__ import annotations

import ast
import dis
import functools
import importlib
import importlib.metadata
import importlib.util
import sys
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from ocp.studies.origins import (
    OWN,
    is_installed,
    is_library,
    is_of_user,
    qualified_name,
    released_module,
    released_name,
    released_parts,
)

# Attributes of a class that do not change what it computes.
IGNORED = {
    "__abstractmethods__", "__annotations__", "__dataclass_fields__", "__dataclass_params__", "__dict__", "__doc__",
    "__firstlineno__", "__match_args__", "__module__", "__parameters__", "__qualname__", "__slots__",
    "__static_attributes__", "__weakref__", "_abc_impl",
}  # fmt: skip
Chunks = Iterator[bytes]


class Walk(Protocol):
    """The walk through the content of a value."""

    def chunks(self, value: object, above: tuple[int, ...]) -> Chunks:
        """Yield the content of a value that is part of the values `above`."""
        ...

    def named(self, values: Mapping[str, object], above: tuple[int, ...]) -> Chunks:
        """Yield the content of global variables by name."""
        ...

    def note(self, kind: str, name: str) -> None:
        """Note that something belongs to the content; `kind` is "function", "class", "file" or "library"."""
        ...


def of_function(function: types.FunctionType, above: tuple[int, ...], walk: Walk) -> Chunks:
    """Yield the content of a function: name, enclosed values, code, defaults, named globals, imports in its body."""
    yield f"{released_module(function).split('.')[0]}.{released_name(function)}".encode()
    cells = [_cell_content(cell) for cell in function.__closure__ or ()]
    enclosed = dict(zip(function.__code__.co_freevars, cells, strict=True))
    released = released_parts(function)
    yield from walk.named({k: v for k, v in enclosed.items() if not released or k in released}, above)
    if is_installed(function.__module__):
        walk.note("library", function.__module__.split(".")[0])
        return
    code, scope = function.__code__, function.__globals__
    arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    walk.note("function", f"{function.__module__}.{function.__qualname__}({', '.join(arguments)})")
    yield from walk.chunks(code, above)
    yield from walk.chunks((function.__defaults__, function.__kwdefaults__), above)
    names = _names(code)
    results = {name: scope[name] for name in sorted(names & scope.keys())}
    yield from walk.named(results, above)
    attributes = {name: value for name, value in vars(function).items() if name != "__wrapped__"}
    if attributes:
        yield from walk.chunks(attributes, above)
    for name, value in results.items():
        if isinstance(value, types.ModuleType) and not is_installed(value.__name__):
            yield from _members(name, value, names, above, walk)
    for name in sorted(_imports(code, str(scope.get("__package__") or ""))):
        yield from _imported(name, names, above, walk)


def of_class(kind: type, above: tuple[int, ...], walk: Walk) -> Chunks:
    """Yield the content of a class: its name, methods, other attributes and base classes."""
    yield qualified_name(kind).encode()
    if is_installed(kind.__module__):
        walk.note("library", kind.__module__.split(".")[0])
        return
    yield from walk.chunks({k: v for k, v in vars(kind).items() if isinstance(v, types.FunctionType)}, above)
    if not is_of_user(kind):
        return
    walk.note("class", f"{kind.__module__}.{kind.__qualname__}")
    others = {name: _unwrapped(value) for name, value in vars(kind).items() if name not in IGNORED}
    slots = (types.FunctionType, types.MemberDescriptorType, types.GetSetDescriptorType)
    others = {name: value for name, value in others.items() if not isinstance(vars(kind)[name], slots)}
    bases = [base for base in kind.__mro__[1:] if is_of_user(base)]
    if others or bases:
        yield from walk.chunks((others, bases), above)


def of_module(module: types.ModuleType, walk: Walk) -> Chunks:
    """Yield the content of a module: name and version; of one of the user all its files and those that it imports."""
    version = getattr(module, "__version__", "")
    yield f"{module.__name__} {version}".encode()
    if is_installed(module.__name__):
        walk.note("module" if version else "library", module.__name__.split(".")[0])
        return
    file = getattr(module, "__file__", None)
    yield Path(file).read_bytes() if file else b""
    files = _files(module.__name__)
    for path in sorted(files):
        walk.note("file", path.name)
    others = {path for path in files if file is None or path != Path(file)}
    if others:
        yield from (path.read_bytes() for path in sorted(others, key=lambda path: path.as_posix()))


def _cell_content(cell: types.CellType) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _unwrapped(value: object) -> object:
    """Return the functions behind a property, static method, class method or cached property."""
    if isinstance(value, property):
        return value.fget, value.fset, value.fdel
    if isinstance(value, staticmethod | classmethod):
        return value.__func__
    return value.func if isinstance(value, functools.cached_property) else value


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield a code object and those of the functions and classes inside of it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _names(code: types.CodeType) -> set[str]:
    """Return the names of variables and attributes that a code object and those inside of it look up."""
    return {name for one in _codes(code) for name in one.co_names}


def _imports(code: types.CodeType, package: str) -> set[str]:
    """Return the absolute names of the modules that a code object imports."""
    results = set()
    for one in _codes(code):
        steps = list(dis.get_instructions(one))
        for k, step in enumerate(steps):
            if step.opname == "IMPORT_NAME":
                level = steps[k - 2].argval if isinstance(steps[k - 2].argval, int) else 0
                results |= set(_absolute(str(step.argval), level, package, steps[k - 1].argval or ()))
    return results


def _absolute(name: str, level: int, package: str, parts: Any) -> Iterator[str]:
    """Yield the absolute name of an imported module, and the names that its parts have if they are modules."""
    base = package.rsplit(".", level - 1)[0] if level > 1 else package
    name = ".".join(filter(None, (base, name))) if level else name
    yield name
    yield from (f"{name}.{part}" for part in parts if isinstance(part, str))


def _members(prefix: str, module: types.ModuleType, names: set[str], above: tuple[int, ...], walk: Walk) -> Chunks:
    """Yield the present values of those attributes of a module of the user that a code object names."""
    inside = (*above, id(module))
    values, modules = {}, {}
    for name in sorted(names - {"__name__", "__file__"}):
        value = vars(module).get(name, sys.modules.get(f"{module.__name__}.{name}"))
        if isinstance(value, types.ModuleType):
            modules[name] = value
        elif name in vars(module):
            values[f"{prefix}.{name}"] = value
    if values:
        yield from walk.named(values, inside)
    for name, inner in modules.items():
        if id(inner) not in inside:
            yield from walk.chunks(inner, inside)
            if not is_installed(inner.__name__):
                yield from _members(f"{prefix}.{name}", inner, names, inside, walk)


def _imported(name: str, names: set[str], above: tuple[int, ...], walk: Walk) -> Chunks:
    """Yield the content of a module that is imported in the body of a function."""
    top = name.split(".")[0]
    if top in (*OWN, "casadi") or top in sys.stdlib_module_names:
        return
    try:
        module = importlib.import_module(name)
    except Exception:  # an attribute that is no module, or a module that is not there: the function finds out
        return
    if is_installed(name):
        walk.note("library", top)
        return
    yield from walk.chunks(module, above)
    yield from _members(name, module, names, above, walk)


def _files(module: str) -> set[Path]:
    """Return the Python file of a module of the user and those of all modules of the user that it imports."""
    results: set[Path] = set()
    waiting, known = [module], {module}
    while waiting:
        result = _file(waiting.pop())
        if result is not None and result[0] not in results:
            results.add(result[0])
            more = _imported_by(*result) - known
            known |= more
            waiting += sorted(more)
    return results


def _file(name: str) -> tuple[Path, str] | None:
    """Return the Python file of a module of the user and the package that it is in; None for any other module."""
    if is_installed(name) or name.split(".")[0] in OWN:
        return None
    try:
        spec = importlib.util.find_spec(name)
    except Exception:  # of a parent package that cannot be imported
        return None
    if spec is None or not spec.origin or not spec.origin.endswith(".py") or is_library(Path(spec.origin)):
        return None
    is_package = spec.submodule_search_locations is not None
    return Path(spec.origin), name if is_package else name.rpartition(".")[0]


def _imported_by(path: Path, package: str) -> set[str]:
    """Return the absolute names that a Python file imports, anywhere in it."""
    results: set[str] = set()
    try:
        tree = ast.parse(path.read_bytes())
    except SyntaxError:
        return results
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            results |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parts = [alias.name for alias in node.names]
            results |= set(_absolute(node.module or "", node.level, package, parts))
    return results
