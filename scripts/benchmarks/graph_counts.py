"""Instructions of x', its Jacobian and the Hessian of its Lagrangian, in every form, beside other tools.

Run `python scripts/benchmark_graphs.py`, with `--urdf FILE --tip LINK` for a robot file, on which other tools are
measured as well if they are installed: Pinocchio (pip install pin), adam (pip install adam-robotics) and urdf2casadi.
"""

from __future__ import annotations

import argparse
import contextlib
import io
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca

from models import Manipulator, from_urdf, inverse_dynamics, robots
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from ocp import System
from ocp.transcription.implicit import Inner

FORMS: tuple[tuple[str, Callable[[Manipulator], System]], ...] = (
    ("canonical", lambda arm: canonical(arm, [Gravity()])),
    ("Lagrange", lambda arm: lagrange(arm, [Gravity()])),
    ("Boltzmann-Hamel, `innovations`", lambda arm: hamel(arm, [Gravity()])),
    ("Boltzmann-Hamel, `ldl`", lambda arm: hamel(arm, [Gravity()], "ldl")),
    ("canonical, `innovations`", lambda arm: canonical(arm, [Gravity()], "innovations")),
)
SHIPPED = (robots.arm_3r, robots.ur5, robots.puma560, robots.panda)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--urdf", type=Path, action="append", default=[], metavar="FILE", help="a robot file")
    parser.add_argument("--tip", action="append", default=[], metavar="LINK", help="its tip, in the order of the files")
    options = parser.parse_args(arguments)
    if len(options.tip) != len(options.urdf):
        parser.error("give one --tip for each --urdf")
    arms = [make() for make in SHIPPED]
    files = list(zip(options.urdf, options.tip, strict=True))
    arms += [from_urdf(path, tip=tip) for path, tip in files]
    print("x' / Jacobian with x' / Hessian\n")
    print("| form | " + " | ".join(arm.name for arm in arms) + " |\n|---|" + "---:|" * len(arms))
    for name, form in FORMS:
        print(f"| {name} | " + " | ".join(" / ".join(map(str, counts(form(arm)))) for arm in arms) + " |", flush=True)
    print("| inverse dynamics | " + " | ".join(str(_torques(arm)) for arm in arms) + " |")
    for (path, tip), arm in zip(files, arms[len(SHIPPED) :], strict=True):
        print(f"\n{path.name} to {tip}: x' / Jacobian with x' / Hessian of other tools\n")
        for name, function in _others(path, tip, arm):
            print(f"| {name} | {function} |", flush=True)
    return 0


def counts(system: System) -> tuple[int, int, int]:
    """Return the instructions of x', of x' with its Jacobian, and of the Hessian of mu . x' (upper triangle)."""
    z, mu = ca.vertcat(system.x, system.u), ca.SX.sym("mu", system.x.numel())
    own, rate = system.implicit, system.rate
    if own is None:
        return _counted(z, mu, rate)
    weights, rest = own.mirror or (None, None)
    padding = ca.DM(system.x.numel(), system.u.numel())
    mirror = None if weights is None else ca.SX(ca.horzcat(weights, padding))

    def solve(right: ca.SX) -> ca.SX:
        return own.solve(system.x, system.u, system.p, right)

    inner = Inner(own.y, own.rate, own.residual, own.value, solve, mirror, rest)
    value, jacobian, hessian = inner.derivatives(z, mu)
    return _instructions([z], [rate]), _instructions([z], [value, jacobian]), _instructions([z, mu], [ca.triu(hessian)])


def _counted(z: ca.SX, mu: ca.SX, rate: ca.SX) -> tuple[int, int, int]:
    hessian = ca.triu(ca.hessian(ca.dot(mu, rate), z)[0])
    first = [rate, ca.jacobian(rate, z)]
    return _instructions([z], [rate]), _instructions([z], first), _instructions([z, mu], [hessian])


def _instructions(inputs: list[ca.SX], outputs: list[ca.SX]) -> int:
    return int(ca.Function("counted", inputs, ca.cse(outputs)).n_instructions())


def _torques(arm: Manipulator) -> int:
    function = inverse_dynamics(arm, [Gravity()])
    symbols = [ca.SX.sym(f"i{k}", function.numel_in(k)) for k in range(4)]
    return _instructions(symbols, [function(*symbols)])


def _others(path: Path, tip: str, arm: Manipulator) -> Iterator[tuple[str, str]]:
    """Yield names of other tools and their counts for a file; a tool that fails says why."""
    n = len(arm.coordinates)
    q, v, tau = (ca.SX.sym(letter, n) for letter in "qvt")
    names = [coordinate.name for coordinate in arm.coordinates]
    tools = {"Pinocchio, ABA": _pinocchio, "adam, M and h solved": _adam, "urdf2casadi, ABA": _urdf2casadi}
    for name, rate in tools.items():
        try:
            with contextlib.redirect_stderr(io.StringIO()):  # the parser lists every attribute that it does not know
                a = rate(path, tip, names, q, v, tau)
        except ImportError as missing:
            yield name, f"not installed ({str(missing).split(' (')[0]})"
            continue
        except (RuntimeError, KeyError, ValueError) as failure:
            yield name, f"fails on this file ({str(failure).splitlines()[-1]})"
            continue
        z, mu = ca.vertcat(q, v, tau), ca.SX.sym("mu", 2 * n)
        yield name, " / ".join(map(str, _counted(z, mu, ca.vertcat(v, ca.SX(a)))))


def _pinocchio(path: Path, tip: str, names: list[str], q: ca.SX, v: ca.SX, tau: ca.SX) -> Any:
    import pinocchio
    from pinocchio import casadi as symbolic

    whole = pinocchio.buildModelFromUrdf(str(path))
    locked = [whole.getJointId(name) for name in whole.names[1:] if name not in names]
    reduced = pinocchio.buildReducedModel(whole, locked, pinocchio.neutral(whole))
    model = symbolic.Model(reduced)
    return symbolic.aba(model, model.createData(), q, v, tau)


def _adam(path: Path, tip: str, names: list[str], q: ca.SX, v: ca.SX, tau: ca.SX) -> Any:
    kinds = {joint.get("name"): joint.get("type") for joint in ElementTree.parse(path).getroot().iter("joint")}
    moving = [name for name, kind in kinds.items() if kind in ("revolute", "continuous", "prismatic")]
    every = [*names, *(name for name in moving if name not in names)]
    arm, n, rest = (
        import_module("adam.casadi").KinDynComputations(str(path), every),
        len(names),
        ca.SX(len(every) - len(names), 1),
    )
    base, still, place, speed = ca.DM.eye(4), ca.DM.zeros(6), ca.vertcat(q, rest), ca.vertcat(v, rest)
    mass = ca.SX(arm.mass_matrix(base, place))[6 : 6 + n, 6 : 6 + n]
    bias = ca.SX(arm.bias_force(base, place, still, speed))[6 : 6 + n]
    return ca.solve(mass, tau - bias)


def _urdf2casadi(path: Path, tip: str, names: list[str], q: ca.SX, v: ca.SX, tau: ca.SX) -> Any:
    parser = import_module("urdf2casadi.urdfparser").URDFparser()
    parser.from_file(str(path))
    root = parser.robot_desc.get_root()
    return parser.get_forward_dynamics_aba(root, tip, gravity=[0.0, 0.0, -9.81])(q, v, tau)
