"""Compilation of CasADi functions to machine code, in libraries that are cached on disk.

CasADi writes C, the C compiler of the system (the environment variable CC, else gcc, cc or clang) makes a library of
it, CasADi loads that. A library is kept in a directory of the user's own (HAMEL_CACHE, else `hamel` in XDG_CACHE_HOME
or ~/.cache) under the hash of all that it depends on. If anything prevents that, the functions are returned
uncompiled, with the reason.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import casadi as ca

from ocp import checks

# -Og takes 0.65-0.8 of the processor seconds of -O1 and its code runs as fast; -O2 and -O3 take twice as long as -Og
# for code that runs up to 5 % faster. No fused operations: the same roundings everywhere.
FLAGS = ("-Og", "-fPIC", "-shared", "-ffp-contract=off")
PATIENCE = 300.0  # seconds that the compiler may take
KEPT = 90.0 * 86400.0  # seconds after its last use that a library is kept
ABANDONED = 86400.0  # seconds after which the files of a compiler that was stopped are removed
LIBRARY = re.compile(r"[0-9a-f]{40}-[0-9a-f]{40}\.so")  # hash of what it depends on, hash of its content
BUILD = ".hamel-build-"  # how the directory of a compiler at work begins


@dataclass(frozen=True, eq=False)
class Compilation:
    """Functions, compiled if possible."""

    functions: tuple[ca.Function, ...]  # compiled, or as given
    seconds: float  # wall clock of everything
    note: str  # why nothing was compiled; empty if it was
    cached: bool  # whether the library had been compiled before


# Measured. Compiling takes 0.11-0.42 processor seconds for 1400 to 7900 instructions, 0.7 for 11900; 0.12-0.21 s by the
# clock for P1 to P3 of the benchmark, up to three times that with more work than cores (there cases are slower,
# too). Compiled functions save 0.63-0.75 of the seconds in derivatives, 50 and 200 elements.
COMPILING = 0.5  # [s]
SAVED = 0.65


def pays(cases: int, derivatives: float) -> bool:
    """Return whether compiling saves more seconds than it takes: cases * SAVED * derivatives > COMPILING.

    The linear solver, which takes most of a solve, gains nothing; so the rule asks for the seconds in derivatives.

    Args:
        cases: solves that are still to come with one NLP, on all workers.
        derivatives: seconds that the functions of one solve take uncompiled, `solution.timings.derivatives`.

    Raises:
        ValueError: cases is no whole number >= 0, or derivatives no time.
    """
    checks.whole("pays: cases", cases, 0)
    checks.number("pays: derivatives", derivatives, "a number of seconds >= 0", at_least=0.0)
    return cases * SAVED * derivatives > COMPILING


Compile = Callable[[Sequence[ca.Function]], Compilation]


class _NotPossibleError(Exception):
    """The reason why functions are not compiled."""


def compiled(functions: Sequence[ca.Function]) -> Compilation:
    """Return functions as machine code of one library: the same inputs, outputs and roundings.

    Compiled functions have no derivatives: give those that are needed as functions of their own.

    Args:
        functions: of SX, with names of their own.

    Returns:
        The functions as they were given, and a note that says why, without a C compiler, without a directory that
        belongs to the user alone, or if the compiler fails.

    Raises:
        TypeError: something that is no list of functions.
        ValueError: two functions of one name.
    """
    checks.instance("functions", functions, list | tuple, "a list of CasADi functions")
    for function in functions:
        checks.instance("functions, each", function, ca.Function, "a CasADi function")
    names = [function.name() for function in functions]
    if len(set(names)) < len(names):
        raise ValueError(f"functions: got the names {', '.join(names)}, expected different ones")
    begun, given = time.perf_counter(), tuple(functions)
    try:
        made, cached = _made(given) if given else ((), True)
        return Compilation(made, time.perf_counter() - begun, "", cached)
    except (
        _NotPossibleError,
        OSError,
        RuntimeError,
    ) as reason:  # RuntimeError: CasADi cannot write or load it; no home
        return Compilation(given, time.perf_counter() - begun, f"not compiled: {reason}", False)


def directory() -> Path:
    """Return the directory of the libraries, made if it is not there.

    Raises:
        OSError, RuntimeError: it cannot be made, or there is no home directory.
    """
    own, shared = os.environ.get("HAMEL_CACHE", ""), os.environ.get("XDG_CACHE_HOME", "")
    base = Path(shared) if Path(shared).is_absolute() else None
    path = Path(own).absolute() if own else (base or Path.home() / ".cache") / "hamel"
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    return path.resolve()


def _made(functions: tuple[ca.Function, ...]) -> tuple[tuple[ca.Function, ...], bool]:
    if os.name != "posix":
        raise _NotPossibleError(f"libraries are not made on {sys.platform}")
    command = _compiler()
    folder = directory()
    _check_directory(folder)
    key = _key(functions, command)
    library = _found(folder, key)
    cached = library is not None
    if library is None:
        _remove_old(folder)
        library = _build(functions, command, folder, key)
    return tuple(ca.external(function.name(), str(library)) for function in functions), cached


def _compiler() -> list[str]:
    """Return the command of the C compiler: CC with its own flags, else the first one there."""
    named = shlex.split(os.environ.get("CC", ""))
    for command in [named] if named else [["gcc"], ["cc"], ["clang"]]:
        result = shutil.which(command[0])
        if result:
            return [result, *command[1:]]
    raise _NotPossibleError(f"no C compiler ({named[0] if named else 'gcc, cc, clang'}) is there")


def _run(command: list[str], folder: Path) -> str:
    """Return what a command prints."""
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=PATIENCE, check=False,
            stdin=subprocess.DEVNULL, env={**os.environ, "LC_ALL": "C"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise _NotPossibleError(f"{command[0]} took more than {PATIENCE:g} s") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["no message"]
        reason = next((line for line in lines if "error" in line), lines[-1])
        raise _NotPossibleError(f"{command[0]} failed with status {done.returncode}: {reason}")
    return done.stdout


def _key(functions: tuple[ca.Function, ...], command: list[str]) -> str:
    """Return the hash of all that a library depends on."""
    version = _run([*command, "--version"], Path("/"))
    machine = [sys.platform, platform.machine(), *platform.libc_ver()]
    parts = [ca.CasadiMeta.version(), version, *command, *FLAGS, *machine, *(f.serialize() for f in functions)]
    return _digest("\0".join(parts).encode())


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:40]


def _check_directory(folder: Path) -> None:
    """Raise unless only the user can write to a directory or replace it by another one."""
    _check_owner(folder)
    for above in folder.parents:
        state = above.stat()
        open_to_all = state.st_mode & stat.S_IWOTH and not state.st_mode & stat.S_ISVTX
        if open_to_all or state.st_uid not in (0, os.geteuid()):
            raise _NotPossibleError(f"{folder} is not safe: others can rename what is in {above}")


def _check_owner(path: Path) -> None:
    """Raise unless a file or directory belongs to the user, who alone may write to it."""
    state = path.lstat()
    if state.st_uid != os.geteuid():
        raise _NotPossibleError(f"{path} belongs to another user; name a directory of your own in HAMEL_CACHE")
    if state.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise _NotPossibleError(f"{path} is writable by others; remove that right, or name another one in HAMEL_CACHE")


def _found(folder: Path, key: str) -> Path | None:
    """Return the library of a key whose content has the hash in its name; damaged ones are removed."""
    for path in sorted(folder.glob(f"{key}-*.so")):
        with suppress(FileNotFoundError):  # another process has removed it just now
            if not path.is_symlink():
                _check_owner(path)
                if _digest(path.read_bytes()) == path.stem.rpartition("-")[2]:
                    os.utime(path)  # its last use
                    return path
            path.unlink()
    return None


def _build(functions: tuple[ca.Function, ...], command: list[str], folder: Path, key: str) -> Path:
    """Return a new library. It gets its name, with the hash of its content, in one step when it is finished."""
    with tempfile.TemporaryDirectory(prefix=BUILD, dir=folder) as temporary:
        there = Path(temporary)
        code = ca.CodeGenerator("functions", {"with_header": False})
        for function in functions:
            code.add(function)
        code.generate(f"{there}/")
        _run([*command, *FLAGS, "-o", "library.so", "functions.c", "-lm"], there)
        (there / "library.so").chmod(0o700)
        library = folder / f"{key}-{_digest((there / 'library.so').read_bytes())}.so"
        (there / "library.so").replace(library)
    return library


def _remove_old(folder: Path) -> None:
    """Remove libraries that have not been used for long, and what stopped compilers left behind; nothing else."""
    now = time.time()
    for path in folder.iterdir():
        with suppress(OSError):  # another process was faster
            age = now - path.lstat().st_mtime
            if LIBRARY.fullmatch(path.name) and age > KEPT:
                path.unlink()
            elif path.name.startswith(BUILD) and age > ABANDONED:
                shutil.rmtree(path)
