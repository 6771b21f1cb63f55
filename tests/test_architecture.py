"""The arrows between packages, rooms and files, and what files never do; read from the sources, nothing is imported."""

import ast
import re
import sys
import tomllib
from functools import lru_cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# Rooms of each package, lowest floor first: a room imports only from itself and from rooms before it.
ROOMS = {
    "ocp": (
        "checks", "system", "numerics", "problem", "transcription", "solution", "integrators", "solving", "accuracy",
        "arcs", "sensitivities", "studies",
    ),
    "models": ("machines", "rigid_bodies", "mechanics", "effects", "forms", "torques", "motions", "scenes", "plots"),
    "scripts": ("reports", "benchmarks", "accuracy_bill", "html_reports"),
}  # fmt: skip
# Packages that files of a package may import; of ocp, models take statements of tasks and nothing that solves.
PACKAGES = {"ocp": {"ocp"}, "models": {"models", "ocp"}, "scripts": {"scripts", "models", "ocp"}}
MODELS_TAKE = {"checks", "system", "numerics", "problem"}
LOOKS = "plots"  # the one room of models that looks at results, and may read them and draw with Matplotlib
FLOORS = 10
LIBRARIES = {"ocp": {"casadi", "numpy"}, "models": {"casadi", "numpy"}}
# Libraries of an extra, imported where they are needed.
OPTIONAL = {
    "models/motions/ros_messages.py": {"yaml"},
    "ocp/studies/designs.py": {"scipy"},
    "ocp/studies/executors.py": {"distributed", "mpi4py"},
    "ocp/studies/sending.py": {"cloudpickle"},
    "ocp/studies/table.py": {"pandas", "pyarrow", "xarray"},
}
# Words of one kind of system only; the toolkit knows none of them.
FOREIGN = re.compile(r"\b(robot|arm|joint|manipulator|torque)s?\b", re.IGNORECASE)
SOURCE = re.compile(r"^ *Source: .*?(?=\n *\n|\"\"\")", re.MULTILINE | re.DOTALL)
LONGEST = 300
FILES = sorted(path for package in ROOMS for path in (ROOT / package).rglob("*.py"))


def of(package):
    return [path for path in FILES if path.relative_to(ROOT).parts[0] == package]


def name(path):
    return path.relative_to(ROOT).as_posix()


def module_of(path):
    """Return the dotted name of a file, a package by its own name."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in FILES}


def imported(source, package=""):
    """Return dotted name -> first line of all that a source imports, also in functions and for type checkers."""
    found = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join([*package.split(".")[: -node.level + 1 or None], node.module or ""]) if node.level else ""
            base = base.strip(".") or node.module
            # "from ocp.solving import solver" names a module as well.
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        else:
            continue
        for one in names:
            found.setdefault(one, node.lineno)
    return found


@lru_cache
def graph():
    """Return file -> files of the project that it imports, by dotted names; files in scripts go without "scripts."."""
    arrows = {}
    for module, path in MODULES.items():
        names = imported(path.read_text(encoding="utf-8"), ".".join(module.split(".")[:-1]))
        if module.startswith("scripts"):
            names |= {f"scripts.{one}": line for one, line in names.items() if f"scripts.{one}" in MODULES}
        targets = {one for one in names if one in MODULES and one != module}
        # "from a.b import c" with a module c goes to c; the package b is only on the way there.
        arrows[module] = {one for one in targets if not any(other.startswith(f"{one}.") for other in targets)}
    return arrows


def circles(arrows):
    """Return the circles of a graph, each as a list of its members in order."""
    state, found, way = {}, [], []

    def visit(module):
        state[module] = "open"
        way.append(module)
        for target in sorted(arrows.get(module, ())):
            if state.get(target) == "open":
                found.append(way[way.index(target) :])
            elif target not in state:
                visit(target)
        way.pop()
        state[module] = "done"

    for module in sorted(arrows):
        if module not in state:
            visit(module)
    return found


def room(module):
    """Return (package, room) of a file; a file of the package itself, such as a command, has the room ""."""
    package, *rest = module.split(".")
    return package, rest[0] if rest and rest[0] in ROOMS[package] else ""


def wrong_arrows(arrows):
    """Return the arrows that go to a higher room, or to a package that may not be imported."""
    found = []
    for module, targets in arrows.items():
        package, own = room(module)
        for target in targets:
            other, there = room(target)
            floors = ROOMS[package]
            if other not in PACKAGES[package]:
                found.append((module, target))
            elif other != package:
                if package == "models" and own != LOOKS and there not in MODELS_TAKE:
                    found.append((module, target))
            elif own and (not there or floors.index(there) > floors.index(own)):
                found.append((module, target))
    return found


def floors(arrows, package):
    """Return room -> floor: one above the highest room of the same package that it imports from."""
    below = {one: set() for one in ROOMS[package]}
    for module, targets in arrows.items():
        if room(module)[0] == package and room(module)[1]:
            rooms = {there for other, there in map(room, targets) if other == package}
            below[room(module)[1]] |= rooms - {room(module)[1], ""}
    height = {}
    for one in ROOMS[package]:
        height[one] = 1 + max((height[other] for other in below[one]), default=0)
    return height


def forbidden(source):
    """Return calls and imports that run text or objects from files."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec"):
            found.append(f"{node.func.id}( in line {node.lineno}")
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            allowed = isinstance(node.value, ast.Constant) and node.value.value is False
            found += [] if allowed else [f"allow_pickle in line {node.value.lineno}"]
    risky = {"pickle", "cPickle", "dill", "marshal", "shelve", "joblib"}
    return found + sorted({module.split(".")[0] for module in imported(source)} & risky)


def test_the_reading_sees_what_it_looks_for():
    source = "import a.b, c\nfrom ocp import solver\nfrom ocp.system import System\ndef f():\n    from d import e\n"
    assert set(imported(source)) == {
        "a.b", "c", "ocp", "ocp.solver", "ocp.system", "ocp.system.System", "d", "d.e"
    }  # fmt: skip
    assert set(imported("from .terms import Terms", "models")) >= {"models.terms"}
    assert forbidden("import pickle\neval('1')\nexec('2')\nnp.load(f, allow_pickle=True)") == [
        "eval( in line 2",
        "exec( in line 3",
        "allow_pickle in line 4",
        "pickle",
    ]
    assert forbidden("np.load(f, allow_pickle=False)\nfunction.eval(1)\ndef eval(x): ...") == []
    assert FOREIGN.findall("Robots have an arm. alarm, harm, jointly, torque") == ["Robot", "arm", "torque"]
    assert graph()["ocp.solving.solver"] >= {"ocp.solving.prepared_nlp"}
    assert graph()["scripts.time_optimal"] >= {"scripts.reports.motion_table", "ocp"}


def test_every_file_stands_in_a_room():
    lost = [one for one in MODULES if "." in one and not one.startswith("scripts.") and not room(one)[1]]
    assert lost == []
    assert all(any(room(one) == (package, own) for one in MODULES) for package in ROOMS for own in ROOMS[package])
    assert all((ROOT / package / own / "__init__.py").exists() or (ROOT / package / f"{own}.py").exists()
               for package in ROOMS for own in ROOMS[package])  # fmt: skip


def test_no_arrow_runs_back_up():
    assert wrong_arrows(graph()) == []


def test_no_circles():
    assert circles(graph()) == []


@pytest.mark.parametrize("package", ROOMS)
def test_at_most_ten_floors(package):
    height = floors(graph(), package)
    assert max(height.values()) <= FLOORS, height


@pytest.mark.parametrize(
    ("module", "target"),
    [
        ("ocp.problem.problem", "ocp.solving.solver"),
        ("ocp.numerics.files", "ocp.studies.study"),
        ("ocp.checks", "ocp.system"),
        ("ocp.solving.solver", "ocp"),
        ("ocp.system", "models.machines.frames"),
        ("models.machines.frames", "models.forms"),
        ("models.scenes.task", "ocp.solving.solver"),
        ("models.scenes.task", "scripts.study"),
        ("scripts.reports.motion_table", "scripts.benchmarks.problems"),
    ],
)
def test_an_arrow_turned_round_is_noticed(module, target):
    turned = {**graph(), module: graph()[module] | {target}}
    assert (module, target) in wrong_arrows(turned)


def test_a_circle_is_noticed():
    inside = {**graph(), "ocp.problem.problem": graph()["ocp.problem.problem"] | {"ocp.problem.hamiltonian"}}
    assert any(set(one) == {"ocp.problem.hamiltonian", "ocp.problem.problem"} for one in circles(inside))


@pytest.mark.parametrize("path", of("ocp") + of("models"), ids=name)
def test_libraries(path):
    package = path.relative_to(ROOT).parts[0]
    tops = {module.split(".")[0] for module in imported(path.read_text(encoding="utf-8"))}
    drawing = {"matplotlib", "mpl_toolkits"} if room(module_of(path)) == ("models", LOOKS) else set()
    allowed = LIBRARIES[package] | drawing | set(ROOMS) | OPTIONAL.get(name(path), set()) | set(sys.stdlib_module_names)
    assert tops <= allowed


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
def test_no_function_is_hidden_by_its_module(path):
    """`from package import name` must not mean a module here and a function there."""
    defined = {
        node.name
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }
    assert path.stem not in defined


def test_every_room_is_installed():
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["tool"]["setuptools"]["packages"]
    rooms = {path.parent.relative_to(ROOT) for package in ROOMS for path in (ROOT / package).rglob("__init__.py")}
    names = {".".join(room.parts) for room in rooms} | {"scripts"}
    assert sorted(listed) == sorted(name.replace("scripts", "hamel_commands") for name in names)
