"""File format of solutions: one NPZ file with arrays and a JSON text, readable without the problem."""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from dataclasses import asdict
from typing import Any

import numpy as np

from ocp import checks
from ocp.numerics.files import written_whole
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.stored_schemes import scheme_data, scheme_from
from ocp.solution.structure import Arc, Contact, Kind, Row, Structure
from ocp.transcription.grid import Grid
from ocp.transcription.packing import Multipliers
from ocp.transcription.schemes.scheme import Scheme

FORMAT = "hamel-solution"
VERSION = 2  # version 1 had no multipliers of limits
LARGEST = 2**30  # bytes of a file, unpacked too; 5000 elements of 40 states take 20 million
LONGEST = 160  # characters of the reason in an error message
ARRAYS = ("states", "controls", "slopes", "costates", "ends")
LIMITS = ("x", "u", "path", "ends")  # parts of the multipliers, saved as limits_x ...; absent without multipliers


def save(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write a solution to one NPZ file; an existing file is replaced only when the new one is complete.

    Arrays `states` (N, m, nx), `controls` (N, c, nu), `slopes` (N, e, nx), `costates` (N, d, nx), `ends` (N + 1,),
    `limits_x`, `limits_u`, `limits_path`, `limits_ends` as in `Multipliers`, and `about`, a JSON text with everything
    else except `accuracy`. No pickle: any NPZ reader opens it.

    Args:
        solution: of any status.
        path: of the file; the suffix is kept as given.

    Raises:
        OSError: the file cannot be written; what was there before is untouched.
    """
    if not isinstance(solution, Solution):
        given = checks.shown(solution)
        raise TypeError(f"save: solution is {given}, expected a Solution; save the phases of a sequence one by one")
    target = checks.path("path", path)
    with written_whole(target) as part:
        part.write_bytes(encode(solution))


def encode(solution: Solution) -> bytes:
    """Return the content of the file of a solution.

    Args:
        solution: of any status.
    """
    system = solution.problem.system if solution.problem is not None else None
    nx, nu = solution.states.shape[2], solution.controls.shape[2]
    about = {
        "format": FORMAT,
        "version": VERSION,
        "status": solution.status.name,
        "message": solution.message,
        "solver_status": solution.solver_status,
        "duration": solution.duration,
        "cost": solution.cost,
        "free": dict(solution.free),
        "values": dict(solution.values),
        "timings": asdict(solution.timings),
        "iterations": solution.iterations,
        "rung": solution.rung,
        "scheme": scheme_data(solution.scheme),
        "x": [str(label) for label in system.label("x", nx)] if system else [],
        "u": [str(label) for label in system.label("u", nu)] if system else [],
        "log": {name: list(column) for name, column in solution.log.items()},
        "structure": _plain(solution.structure) if solution.structure else None,
    }
    held, content = solution.multipliers, io.BytesIO()
    np.savez_compressed(
        content,
        states=solution.states,
        controls=solution.controls,
        slopes=solution.slopes,
        costates=solution.costates,
        ends=solution.grid.ends,
        **({f"limits_{name}": getattr(held, name) for name in LIMITS} if held else {}),
        about=np.array(json.dumps(_without_nan(about), allow_nan=False)),
    )
    return content.getvalue()


def load(path: str | os.PathLike[str], problem: Problem | None = None) -> Solution:
    """Read a solution that `save` wrote; nothing in the file is executed.

    Args:
        path: of the file.
        problem: the problem it solves, for signals by name and `verify`; x(t), u(t), costate(t) and the use as a
            guess need none.

    Raises:
        OSError: no such file.
        ValueError: not a solution file, a damaged one, or one of a newer version.
    """
    file_path = checks.path("path", path)
    checks.instance("problem", problem, Problem | None, "the Problem it solves, or None")
    if file_path.stat().st_size > LARGEST or not file_path.is_file():
        raise ValueError(f"{path}: no solution file, expected a regular file of at most {LARGEST} bytes")
    return decode(file_path.read_bytes(), problem, os.fspath(path))


def decode(content: bytes, problem: Problem | None = None, path: str = "solution") -> Solution:
    """Return the solution whose file content `encode` returned.

    Args:
        content: of the file.
        problem: the problem it solves, or None.
        path: name of the content in messages.

    Raises:
        ValueError: not a solution, a damaged one, or one of a newer version.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > LARGEST:
            raise ValueError(f"{unpacked} bytes when unpacked, expected at most {LARGEST}")
        # Reading from memory: a truncated archive on disk makes the zip reader complain again when it is deleted.
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            arrays = {name: _array(name, file[name]) for name in ARRAYS}
            known = [name for name in LIMITS if f"limits_{name}" in file]
            held = {name: _array(f"limits_{name}", file[f"limits_{name}"]) for name in known}
    except Exception as error:  # zipfile, zlib, tokenize, numpy and json raise different exceptions for damaged bytes
        why = " ".join(str(error).split())[:LONGEST]
        raise ValueError(f"{path}: no readable solution file ({why}), expected one written by save") from None
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ValueError(f"{path}: no solution file, expected the format {FORMAT!r}")
    version = about.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or not 1 <= version <= VERSION:
        raise ValueError(f"{path}: format version {checks.shown(version)}, expected a number up to {VERSION}")
    try:
        for name in ("scheme", "free", "values", "timings", "log"):
            checks.mapping(name, about.get(name), "named entries")
        if not isinstance(about.get("status"), str) or about["status"] not in Status.__members__:
            raise checks.refused("status", about.get("status"), f"one of {', '.join(Status.__members__)}")
        scheme = scheme_from(about["scheme"])
        grid = Grid(arrays["ends"])
        _check_shapes(arrays, scheme, grid)
        _check_numbers(about, arrays)
        _check_model(arrays, problem)
        return Solution(
            Status[about["status"]], str(about["message"]), str(about["solver_status"]), _number(about["duration"]),
            _number(about["cost"]), arrays["states"], arrays["controls"], arrays["slopes"], arrays["costates"],
            _numbers(about["free"]), _numbers(about["values"]), Timings(**_numbers(about["timings"])),
            int(about["iterations"]), grid, scheme, problem, str(about["rung"]), dict(about["log"]),
            _multipliers(held, arrays), structure=_structure(about.get("structure"), arrays["controls"].shape[2]),
        )  # fmt: skip
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        why = " ".join(str(error).split())[:LONGEST]
        raise ValueError(
            f"{path}: the solution file is incomplete or damaged ({why}), expected one written by save"
        ) from None


def _array(name: str, given: np.ndarray) -> np.ndarray:
    array = checks.real(given)
    if array is None:
        raise ValueError(f"array {name} holds no real numbers")
    return array


def _check_numbers(about: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    """Raise ValueError for a solution with the status of a solved one that has values which are not finite."""
    if Status[about["status"]] in (Status.SOLVED, Status.ACCEPTABLE):
        wrong = [name for name in ARRAYS if not np.all(np.isfinite(arrays[name]))]
        if wrong:
            raise ValueError(f"array {wrong[0]} is not finite, though its status is {about['status']}")
        checks.number("duration", about["duration"], "a finite number of seconds >= 0", at_least=0.0)
        checks.number("cost", about["cost"])


def _check_model(arrays: dict[str, np.ndarray], problem: Problem | None) -> None:
    shapes = arrays["states"].shape[2], arrays["controls"].shape[2]
    if problem is not None and shapes != (problem.system.x.numel(), problem.system.u.numel()):
        wanted = problem.system.x.numel(), problem.system.u.numel()
        raise ValueError(f"it has (nx, nu) = {shapes}, the system of the problem {wanted}")


def _multipliers(held: dict[str, np.ndarray], arrays: dict[str, np.ndarray]) -> Multipliers | None:
    if not held:
        return None
    missing = [name for name in LIMITS if name not in held]
    if missing:
        raise ValueError(f"multipliers of limits lack {', '.join(missing)}")
    wrong = [name for name, like in (("x", "states"), ("u", "controls")) if held[name].shape != arrays[like].shape]
    if wrong or len(held["path"]) != len(arrays["states"]):
        raise ValueError("multipliers of limits do not fit the motion")
    return Multipliers(**held)


def _plain(structure: Structure) -> dict[str, object]:
    """Return a structure as JSON data: rows [name, kind, start, end], contacts [limit, side, control]."""
    arcs = [
        {
            "kinds": [kind.value for kind in arc.kinds],
            "duration": arc.duration,
            "held": [[c.limit, c.side, c.control] for c in arc.held],
            "touched": [[c.limit, c.side, c.control] for c in arc.touched],
        }
        for arc in structure.arcs
    ]
    return {"rows": [[row.name, row.kind.value, row.start, row.end] for row in structure.rows], "arcs": arcs}


def _structure(about: dict[str, Any] | None, nu: int) -> Structure | None:
    if about is None:
        return None
    rows = tuple(Row(str(name), Kind(kind), float(a), float(b)) for name, kind, a, b in about["rows"])
    arcs = tuple(
        Arc(tuple(map(Kind, arc["kinds"])), float(arc["duration"]), _contacts(arc["held"]), _contacts(arc["touched"]))
        for arc in about["arcs"]
    )
    if not rows or not arcs or any(len(arc.kinds) != nu for arc in arcs):
        raise ValueError(f"the structure does not fit a motion with {nu} controls")
    return Structure(rows, arcs)


def _contacts(about: list[list[int]]) -> tuple[Contact, ...]:
    result = tuple(Contact(int(limit), int(side), int(control)) for limit, side, control in about)
    wrong = [c for c in result if c.side not in (-1, 1) or c.limit < 0]
    if wrong:
        raise ValueError(f"{wrong[0]!r} is not a contact with a limit")
    return result


def _without_nan(value: object) -> object:
    """Return JSON data with None for NaN and infinite numbers, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _numbers(about: dict[str, float]) -> dict[str, float]:
    return {str(name): float(value) for name, value in about.items()}


def _check_shapes(arrays: dict[str, np.ndarray], scheme: Scheme, grid: Grid) -> None:
    expected = {
        "states": (len(grid), len(scheme.nodes)),
        "controls": (len(grid), len(scheme.control_nodes)),
        "slopes": (len(grid), int(scheme.slope_at_start)),
        "costates": (len(grid), scheme.degree),
    }
    for name, shape in expected.items():
        if arrays[name].ndim != 3 or arrays[name].shape[:2] != shape:
            raise ValueError(f"array {name} has shape {arrays[name].shape}, expected {(*shape, '...')}")
    widths = {name: arrays[name].shape[2] for name in ("states", "slopes", "costates")}
    if len(set(widths.values())) != 1:
        raise ValueError(f"arrays disagree on the number of states: {widths}")
