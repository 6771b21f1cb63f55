"""Compiled functions: the same values, one library for all who need it, and a plain reason where there is none."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.problems import bryson_denham, cops, crane, two_link

from models import robots, spherical
from models.effects import Gravity, Payload
from models.forms import canonical
from ocp import Bolza, Sequence, along, point_to_point, prepare, uniform
from ocp.numerics import compilation
from ocp.numerics.compilation import compiled, directory, pays

ROOT = Path(__file__).resolve().parents[2]
COMPILER = next((found for name in ("gcc", "cc", "clang") if (found := shutil.which(name))), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc, clang) on this machine")


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A directory of libraries of the test's own, not there yet, and the compiler of the system."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("HAMEL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def counted(cache, tmp_path, monkeypatch):
    """The compiler behind a script that counts how often it compiles."""
    log = tmp_path / "log"
    log.touch()
    set_compiler(
        monkeypatch, tmp_path, f'case "$*" in *functions.c*) echo compiled >> {log};; esac; exec {COMPILER} "$@"'
    )
    return lambda: len(log.read_text().splitlines())


def set_compiler(monkeypatch, place, script):
    path = place / "compiler"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o700)
    monkeypatch.setenv("CC", str(path))


def some_functions():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    value = ca.vertcat(ca.sin(x[0]) * x[1], ca.exp(p) / x[2], ca.if_else(x[0] > 0, x[1], ca.sqrt(x[2])))
    slopes = ca.jacobian(value, x)
    return [ca.Function("value", [x, p], [value]), ca.Function("slopes", [x, p], [slopes, ca.SX(0, 1)])]


def check_values(functions, expected, seed=0):
    rng = np.random.default_rng(seed)
    for function, other in zip(functions, expected, strict=True):
        for _ in range(5):
            given = [rng.uniform(0.3, 1.3, other.size_in(i)) for i in range(other.n_in())]
            results, right = function.call(given), other.call(given)
            for result, there in zip(results, right, strict=True):
                assert result.sparsity() == there.sparsity()
                np.testing.assert_allclose(np.array(result), np.array(there), rtol=1e-13, atol=1e-13)


def libraries(cache):
    return sorted(cache.glob("*.so"))


def refused(why):
    """Compile, and see that the functions come back as they were for a reason with these words."""
    functions = some_functions()
    made = compiled(functions)
    assert made.functions == tuple(functions)
    assert all(one is other for one, other in zip(made.functions, functions, strict=True))
    assert not made.cached
    assert made.note.startswith("not compiled: ")
    assert why in made.note, made.note
    return made


@needs_compiler
def test_values_are_those_of_the_functions(cache):
    functions = some_functions()
    made = compiled(functions)
    assert (made.note, made.cached) == ("", False)
    assert all(function.class_name() != "SXFunction" for function in made.functions)
    assert [function.name() for function in made.functions] == ["value", "slopes"]
    check_values(made.functions, functions)
    check_values([f.map(7) for f in made.functions], [f.map(7) for f in functions])


@needs_compiler
@pytest.mark.parametrize("known", [cops(), two_link(), crane(), bryson_denham(0.2)], ids=lambda known: known.name)
def test_programme_and_solution_are_the_same(cache, known):
    """Minimum time and running costs, free and fixed durations."""
    problem, guess = known.problem, known.guess
    plain, fast = (prepare(problem, grid=uniform(20), compiled=which) for which in (False, True))
    assert plain.compilations == ()
    assert [made.note for made in fast.compilations] == [""]
    assert len(libraries(cache)) == 1
    names = sorted(plain.joined.scaled.derivatives)
    check_values(
        [fast.joined.scaled.derivatives[n] for n in names], [plain.joined.scaled.derivatives[n] for n in names]
    )
    one, other = plain(guess), fast(guess)
    assert one.ok
    assert other.ok
    assert other.cost == pytest.approx(one.cost, rel=1e-10)
    assert other.duration == pytest.approx(one.duration, rel=1e-10)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("heated", [False, True])
def test_a_large_point_is_compiled_once(cache, heated, monkeypatch):
    """The functions of one point of a UR5, not those of an element with its copies: same NLP, a third of the code."""
    arm, n = canonical(robots.ur5(), [Gravity()]), 6
    task = point_to_point(arm, [0.0, -1.0, 0.5, -1.0, 0.3, 0.2], [0.3, -0.7, 0.8, -0.7, 0.6, 0.5], tau=50.0, v=2.0)
    if heated:
        effort = Bolza(time=1.0, running=1e-4 * ca.sumsqr(arm["tau"]) + 1e-3 * ca.sumsqr(arm["v"]))
        task = replace(task, minimise=effort, subject_to=(*task.subject_to, along(arm["tool"][2], 0.1)))
    plain, fast = (prepare(task, grid=uniform(12), compiled=which) for which in (False, True))
    (library,) = libraries(cache)
    size = library.stat().st_size
    one, other = plain(), fast()
    assert one.ok
    assert other.iterations == one.iterations
    assert other.duration == pytest.approx(one.duration, rel=1e-12)
    assert np.allclose(other.states, one.states, rtol=0, atol=1e-9)
    assert one.states.shape[-1] == 2 * n
    monkeypatch.setattr("ocp.transcription.local_functions.LARGE", 10**9)
    prepare(task, grid=uniform(12), compiled=True)
    assert size < 0.6 * max(path.stat().st_size for path in libraries(cache))


@needs_compiler
def test_phases_of_a_sequence_are_compiled(cache):
    arms = [canonical(spherical(), [Gravity(), *more]) for more in ([], [Payload(4.0)])]
    q, limit = [[0.9, 0.0, 0.0, 0.85], [1.4, 1.0, 0.5, 0.8], [1.0, 2.0, 0.0, 0.8]], [300.0, 160.0, 3.0, 400.0]
    pair = Sequence(tuple(point_to_point(arm, q[k], q[k + 1], tau=limit) for k, arm in enumerate(arms)))
    plain, fast = (prepare(pair, grid=uniform(15), compiled=which) for which in (False, True))
    assert [made.note for made in fast.compilations] == ["", ""]
    assert len(libraries(cache)) == 2
    one, other = plain(), fast()
    assert one.ok
    assert other.duration == pytest.approx(one.duration, rel=1e-10)


@needs_compiler
def test_other_limits_use_the_same_programme(cache):
    """A compiled NLP takes parameter values, limits and ends as any other does."""
    arm = canonical(spherical(), [Gravity()])
    task = point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=[260.0, 160.0, 3.0, 400.0])
    nearer = point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 1.8, 0.4, 0.9], tau=[200.0, 150.0, 3.0, 380.0])
    other = replace(task, subject_to=nearer.subject_to)
    plain, fast = (prepare(task, grid=uniform(20), compiled=which) for which in (False, True))
    one, two = plain(problem=other), fast(problem=other)
    assert one.ok
    assert two.duration == pytest.approx(one.duration, rel=1e-10)
    again = plain(guess=one, problem=other), fast(guess=two, problem=other)
    assert again[1].duration == pytest.approx(again[0].duration, rel=1e-10)


def test_nothing_is_compiled_unless_asked_for(cache, monkeypatch):
    def never(*_, **__):
        raise AssertionError("the compiler was called")

    monkeypatch.setattr(subprocess, "run", never)
    assert prepare(cops().problem, grid=uniform(10)).compilations == ()
    assert not cache.exists()


@needs_compiler
def test_a_library_is_made_once(cache, counted):
    functions = some_functions()
    made = [compiled(some_functions()) for _ in range(3)]
    assert [one.cached for one in made] == [False, True, True]
    assert counted() == 1
    check_values(made[-1].functions, functions)
    (library,) = libraries(cache)
    assert library.stat().st_mode & 0o777 == 0o700
    assert cache.stat().st_mode & 0o777 == 0o700


@needs_compiler
def test_the_grid_and_limits_do_not_matter_to_a_library(cache, counted):
    arm = canonical(spherical(), [Gravity()])
    task = point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=[260.0, 160.0, 3.0, 400.0])
    for elements in (20, 30, 40):
        prepare(task, grid=uniform(elements), compiled=True)
    assert counted() == 1


@needs_compiler
def test_other_functions_flags_or_versions_make_another_library(cache, counted, monkeypatch):
    compiled(some_functions())
    x = ca.SX.sym("x")
    assert not compiled([ca.Function("value", [x], [x**2])]).cached
    assert not compiled([ca.Function("value", [x], [x**3])]).cached
    monkeypatch.setattr(compilation, "FLAGS", (*compilation.FLAGS, "-DOTHER"))
    assert not compiled(some_functions()).cached
    monkeypatch.setattr(ca.CasadiMeta, "version", lambda: "0.0.0")
    assert not compiled(some_functions()).cached
    assert counted() == 5
    assert len(libraries(cache)) == 5


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("harm", ["cut", "changed", "empty", "no library", "link"])
def test_a_damaged_library_is_made_anew(cache, counted, tmp_path, harm):
    """In another process: this one has the library in its memory already."""
    compile_elsewhere()
    (library,) = libraries(cache)
    content = library.read_bytes()
    if harm == "link":
        (tmp_path / "elsewhere.so").write_bytes(content)
        library.unlink()
        library.symlink_to(tmp_path / "elsewhere.so")
    else:
        middle = len(content) // 2
        changed = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        library.write_bytes({"cut": content[:middle], "changed": changed, "empty": b""}.get(harm, b"#!/bin/sh"))
    assert compile_elsewhere() == "False"
    assert counted() == 2
    assert compile_elsewhere() == "True"
    assert [found.read_bytes() for found in libraries(cache)] == [content]


PROCESS = """
import sys
sys.path[:0] = ["tests", "tests/numerics"]
from ocp.numerics.compilation import compiled
from test_compilation import check_values, some_functions
made = compiled(some_functions())
assert not made.note, made.note
check_values(made.functions, some_functions())
print(made.cached)
"""


def start_elsewhere():
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-c", PROCESS], cwd=ROOT, env=environment, text=True, stdout=subprocess.PIPE
    )


def compile_elsewhere():
    process = start_elsewhere()
    said = process.communicate(timeout=120)[0].strip()
    assert process.returncode == 0
    return said


@needs_compiler
def test_two_processes_compile_the_same_at_once(cache, tmp_path, monkeypatch):
    """Each compiler waits until the other has begun."""
    log = tmp_path / "log"
    wait = f"n=0; while [ $(wc -l < {log}) -lt 2 ] && [ $n -lt 600 ]; do sleep 0.05; n=$((n+1)); done"
    script = f'case "$*" in *functions.c*) echo compiled >> {log}; {wait};; esac; exec {COMPILER} "$@"'
    set_compiler(monkeypatch, tmp_path, script)
    processes = [start_elsewhere(), start_elsewhere()]
    said = [process.communicate(timeout=120)[0].strip() for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert said == ["False", "False"]
    assert log.read_text().splitlines() == ["compiled"] * 2
    assert {path.suffix for path in cache.iterdir()} == {".so"}
    assert compile_elsewhere() == "True"


def test_without_a_compiler(cache, tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    refused("no C compiler (gcc, cc, clang) is there")
    monkeypatch.setenv("CC", "no_such_compiler -m64")
    refused("no C compiler (no_such_compiler) is there")
    prepared = prepare(two_link().problem, grid=uniform(20), compiled=True)
    assert "no C compiler" in prepared.compilations[0].note
    assert prepared().cost == prepare(two_link().problem, grid=uniform(20))().cost
    assert not cache.exists()


def test_a_compiler_that_fails(cache, tmp_path, monkeypatch):
    version = 'case "$*" in *--version*) echo 1.0; exit 0;; esac;'
    set_compiler(monkeypatch, tmp_path, f"{version} echo 'x.c:3: error: no room left' >&2; exit 4")
    refused("failed with status 4: x.c:3: error: no room left")
    set_compiler(monkeypatch, tmp_path, f"{version} kill -9 $$")
    refused("failed with status -9: no message")
    set_compiler(monkeypatch, tmp_path, f"{version} exit 0")  # says that it is done, and makes nothing
    refused("No such file")
    set_compiler(monkeypatch, tmp_path, f"{version} exec sleep 60")
    monkeypatch.setattr(compilation, "PATIENCE", 0.5)
    refused("took more than 0.5 s")
    assert list(cache.iterdir()) == []


def test_a_compiler_that_makes_no_library(cache, tmp_path, monkeypatch):
    set_compiler(monkeypatch, tmp_path, 'case "$*" in *--version*) echo 1.0;; *) echo nonsense > library.so;; esac')
    refused("not compiled: ")
    refused("not compiled: ")  # found in the directory this time


@needs_compiler
def test_no_directory_can_be_made(cache, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("HAMEL_CACHE", str(tmp_path / "file" / "cache"))
    refused("Not a directory")
    monkeypatch.setenv("HAMEL_CACHE", str(tmp_path / "file"))
    refused("File exists")


@needs_compiler
def test_a_directory_that_is_not_writable(cache):
    cache.mkdir(mode=0o500)
    if os.access(cache, os.W_OK):
        pytest.skip("this user may write everywhere")
    refused("Permission denied")


@needs_compiler
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702, 0o1777])
def test_a_directory_or_library_that_others_may_write_to(cache, counted, mode):
    compiled(some_functions())
    (library,) = libraries(cache)
    library.chmod(mode)
    refused(f"{library} is writable by others")
    library.chmod(0o700)
    cache.chmod(mode)
    refused(f"{cache} is writable by others")
    cache.chmod(0o700)
    assert compiled(some_functions()).cached
    cache.parent.chmod(mode)
    if mode == 0o777:
        refused("others can rename what is in")
    cache.parent.chmod(0o700)
    assert counted() == 1


@needs_compiler
def test_a_directory_or_library_of_another_user(cache, monkeypatch):
    own = os.geteuid()
    compiled(some_functions())
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    refused(f"{cache} belongs to another user")
    monkeypatch.undo()


def test_where_libraries_are_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("HAMEL_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert directory() == tmp_path / ".cache" / "hamel"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, says the XDG specification
    assert directory() == tmp_path / ".cache" / "hamel"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "shared"))
    assert directory() == tmp_path / "shared" / "hamel"
    monkeypatch.setenv("HAMEL_CACHE", str(tmp_path / "own"))
    assert directory() == tmp_path / "own"
    assert directory().stat().st_mode & 0o777 == 0o700


@needs_compiler
def test_what_is_old_is_removed_and_nothing_else(cache):
    """Also in a directory that holds things of the user."""
    compiled(some_functions())
    (library,) = libraries(cache)
    stopped, running = cache / ".hamel-build-1", cache / ".hamel-build-2"
    own = [cache / "build-1", cache / "notes.txt", cache / "my-own.so"]
    for path in (stopped, running, own[0]):
        path.mkdir()
        (path / "functions.c").touch()
    for path in own[1:]:
        path.touch()
    days = {stopped: 2, running: 0, library: 100, **dict.fromkeys(own, 1000)}
    for path, age in days.items():
        os.utime(path, (time.time() - 86400 * age,) * 2)
    x = ca.SX.sym("x")
    assert compiled(some_functions()).cached  # its use makes it young
    compiled([ca.Function("value", [x], [x**2])])
    assert [path.exists() for path in (library, stopped, running, *own)] == [True, False, True, True, True, True]
    os.utime(library, (0, 0))
    compiled([ca.Function("value", [x], [x**3])])
    assert [path.exists() for path in (library, running, *own)] == [False, True, True, True, True]


def test_names_must_differ(cache):
    one, _ = some_functions()
    with pytest.raises(ValueError, match="value, value"):
        compiled([one, one])


def test_no_functions_are_compiled_at_once(cache, monkeypatch):
    monkeypatch.setenv("CC", "no_such_compiler")
    assert compiled([]).note == ""
    assert not cache.exists()


def test_compiling_pays_for_many_or_long_cases():
    assert not pays(0, 10.0)
    assert not pays(1, 0.01)
    assert not pays(20, 0.01)
    assert pays(200, 0.01)  # the default task on 50 elements
    assert pays(3, 0.5)
    smallest = next(cases for cases in range(1, 1000) if pays(cases, 0.01))
    assert 0.5 < smallest * 0.01 < 1.0
