"""The arrows between the packages, the words they use, and what their files never do; read from the sources."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("ocp", "models", "scripts")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
LIBRARIES = {"casadi", "numpy"}
# Libraries of an extra, imported where they are needed.
OPTIONAL = {
    "models/motions/recording.py": {"yaml"},
    "ocp/studies/designs.py": {"scipy"},
    "ocp/studies/table.py": {"pandas", "pyarrow", "xarray"},
}
# Words of one kind of system only; the toolkit knows none of them.
FOREIGN = re.compile(r"\b(robot|arm|joint|manipulator|torque)s?\b", re.IGNORECASE)
SOURCE = re.compile(r"^ *Source: .*?(?=\n *\n|\"\"\")", re.MULTILINE | re.DOTALL)
LONGEST = 300


def of(package):
    return [path for path in FILES if path.relative_to(ROOT).parts[0] == package]


def name(path):
    return path.relative_to(ROOT).as_posix()


def imported(source, package=""):
    """Return the dotted names of all modules that a source imports, also in functions and for type checkers."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join([*package.split(".")[: -node.level + 1 or None], node.module or ""]) if node.level else ""
            found.add(base.strip(".") or node.module)
            # "from ocp import solver" names a module as well.
            found |= {f"{base.strip('.') or node.module}.{alias.name}" for alias in node.names}
    return found


def forbidden(source):
    """Return calls and imports that run text or objects from files."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec"):
            found.append(f"{node.func.id}( in line {node.lineno}")
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            allowed = isinstance(node.value, ast.Constant) and node.value.value is False
            found += [] if allowed else [f"allow_pickle in line {node.value.lineno}"]
    risky = {"pickle", "cPickle", "dill", "marshal", "shelve", "joblib", "cloudpickle"}
    return found + sorted({module.split(".")[0] for module in imported(source)} & risky)


def top_levels(path):
    return {module.split(".")[0] for module in imported(path.read_text(encoding="utf-8"), path.parent.name)}


def test_the_walk_sees_what_it_looks_for():
    source = "import a.b, c\nfrom ocp import solver\nfrom ocp.system import System\ndef f():\n    from d import e\n"
    assert imported(source) == {
        "a.b", "c", "ocp", "ocp.solver", "ocp.system", "ocp.system.System", "d", "d.e"
    }  # fmt: skip
    assert imported("from .terms import Terms", "models") >= {"models.terms"}
    assert imported("from . import terms", "models") >= {"models", "models.terms"}
    assert forbidden("import pickle\neval('1')\nexec('2')\nnp.load(f, allow_pickle=True)") == [
        "eval( in line 2",
        "exec( in line 3",
        "allow_pickle in line 4",
        "pickle",
    ]
    assert forbidden("np.load(f, allow_pickle=False)\nfunction.eval(1)\ndef eval(x): ...") == []
    assert FOREIGN.findall("Robots have an arm. alarm, harm, jointly, torque") == ["Robot", "arm", "torque"]
    assert len(of("ocp")) > 10
    assert len(of("models")) > 10


@pytest.mark.parametrize("path", of("ocp"), ids=name)
def test_ocp_imports_nothing_but_itself_and_its_libraries(path):
    allowed = LIBRARIES | {"ocp"} | OPTIONAL.get(name(path), set())
    assert top_levels(path) - set(sys.stdlib_module_names) <= allowed


@pytest.mark.parametrize("path", of("models"), ids=name)
def test_models_import_from_ocp_the_system_only(path):
    allowed = LIBRARIES | {"models", "ocp"} | OPTIONAL.get(name(path), set())
    assert top_levels(path) - set(sys.stdlib_module_names) <= allowed
    modules = {module for module in imported(path.read_text(encoding="utf-8")) if module.split(".")[0] == "ocp"}
    assert all(module == "ocp.system" or module.startswith("ocp.system.") for module in modules), modules


@pytest.mark.parametrize("path", of("ocp"), ids=name)
def test_ocp_has_no_word_of_the_models(path):
    text = SOURCE.sub(lambda match: "\n" * match.group().count("\n"), path.read_text(encoding="utf-8"))
    hits = [
        f"{name(path)}:{number}: {line.strip()}"
        for number, line in enumerate(text.splitlines(), 1)
        if FOREIGN.search(line)
    ]
    assert not hits, "\n".join(hits)


@pytest.mark.parametrize("path", FILES, ids=name)
def test_files_are_short(path):
    lines = path.read_text(encoding="utf-8").count("\n")
    assert lines <= LONGEST, f"{name(path)} has {lines} lines"


@pytest.mark.parametrize("path", FILES, ids=name)
def test_nothing_is_executed_from_text_or_files(path):
    assert forbidden(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", of("ocp") + of("models"), ids=name)
def test_no_module_is_named_like_what_it_defines(path):
    defined = {
        node.name
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }
    assert path.stem not in defined
