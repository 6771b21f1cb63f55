"""Functions of a model as C code with a header, and as CasADi function files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from ocp import checks
from ocp.system import System


def right_hand_side(system: System, name: str = "rate") -> ca.Function:
    """Return x' = rate(x, u, p) of a system as a function.

    Args:
        system: from lagrange, hamel or canonical, or any other.
        name: of the function.
    """
    checks.instance("system", system, System, "a System")
    checks.text("name", name, "the name of the function")
    if not ca.Function.check_name(name):
        raise checks.refused("name", name, "letters, digits and single underscores, a letter first")
    return ca.Function(name, [system.x, system.u, system.p], [ca.densify(system.rate)], ["x", "u", "p"], ["rate"])


def write_code(functions: Sequence[ca.Function], path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write functions as C99 code without dependencies, and its header.

    Every function f becomes int f(const double** arg, double** res, long long* iw, double* w, int mem) in C, with
    f_work(...) for the sizes of its work arrays; arguments and results are stored column by column, in SI units.

    Args:
        functions: such as inverse_dynamics(machine, effects), right_hand_side(system); their names must differ.
        path: of the .c file; the header is written beside it.

    Returns:
        The paths of the code and of the header; neither file is written before both are complete.

    Raises:
        ValueError: no function, two of one name, or a path that does not end in .c.
        OSError: the files cannot be written.

    Source: CasADi user guide, C-code generation.
    """
    target = checks.path("path", path)
    checks.instance("functions", functions, list | tuple, "CasADi Functions")
    for function in functions:
        checks.instance("functions, each", function, ca.Function, "a CasADi Function")
    names = [function.name() for function in functions]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"write_code: got functions named {names}, expected at least one and no name twice")
    if target.suffix != ".c":
        raise ValueError(f"write_code: got {target}, expected a path that ends in .c")
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        generator = ca.CodeGenerator(target.name, {"with_header": True, "casadi_int": "long long int"})
        for function in functions:
            generator.add(function)
        generator.generate(folder + os.sep)
        header = target.with_suffix(".h")
        Path(folder, header.name).replace(header)
        Path(folder, target.name).replace(target)
    return target, header


def write_function(function: ca.Function, path: str | os.PathLike[str]) -> Path:
    """Write one function as a CasADi function file, which casadi.Function.load reads in every language of CasADi.

    Args:
        function: of any inputs and outputs.
        path: of the file, such as inverse_dynamics.casadi; it is moved there when it is complete.

    Raises:
        OSError: the file cannot be written.
    """
    target = checks.path("path", path)
    checks.instance("function", function, ca.Function, "a CasADi Function")
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        part = Path(folder, target.name)
        function.save(os.fspath(part))
        part.replace(target)
    return target
