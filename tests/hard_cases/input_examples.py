"""Valid values of the calls with bad input: a machine, its system, problems and their solutions, solved once."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from models import Motion, Parameter, cylindrical
from models.effects import Gravity, Viscous
from models.forms import canonical
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from ocp import (
    Guess,
    Ipopt,
    Prepared,
    Problem,
    Sequence,
    SequenceSolution,
    Solution,
    Study,
    StudyTable,
    System,
    along,
    end,
    point_to_point,
    polish,
    prepare,
    save,
    solve,
    uniform,
)  # fmt: skip

Q0, Q1 = [0.0, 0.2, 0.5], [0.5, 0.4, 0.7]
EFFECTS: list[Effect] = [Gravity(Parameter(9.81)), Viscous(1.0)]
NUMBERS: list[Effect] = [Gravity(), Viscous(1.0)]


@cache
def folder() -> Path:
    """Return a folder for files that are written on the way; it goes with the process."""
    made = tempfile.mkdtemp(prefix="hamel_")
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return Path(made)


@cache
def machine() -> Manipulator:
    """Return the machine."""
    return cylindrical()


@cache
def system() -> System:
    """Return its system, with one parameter that stays a symbol."""
    return canonical(machine(), EFFECTS)


@cache
def problem() -> Problem:
    """Return a point-to-point problem."""
    return point_to_point(system(), Q0, Q1, tau=[200.0, 900.0, 300.0])


@cache
def prepared() -> Prepared:
    """Return it prepared."""
    return prepare(problem(), grid=uniform(4))


@cache
def solution() -> Solution:
    """Return its solution."""
    result: Solution = prepared()()
    return result


@cache
def sequence() -> Sequence:
    """Return two problems one after the other."""
    back = point_to_point(system(), Q1, Q0, tau=[200.0, 900.0, 300.0])
    return Sequence((problem(), back))


@cache
def sequence_solution() -> SequenceSolution:
    """Return its solution."""
    result: SequenceSolution = solve(sequence(), grid=uniform(3))
    return result


@cache
def guess() -> Guess:
    """Return a first guess."""
    return Guess(np.array([0.0, 1.0]), np.zeros((2, 6)), np.zeros((2, 3)), 1.0, np.zeros(0))


@cache
def motion() -> Motion:
    """Return a motion of the machine."""
    return Motion.quintic(Q0, Q1, 1.2)


@cache
def samples() -> Motion:
    """Return a motion from samples with noise."""
    t = np.linspace(0.0, 1.0, 40)
    noise = 1e-4 * np.random.default_rng(1).normal(size=(40, 3))
    return Motion.from_samples(t, motion().q(t) + noise)


@cache
def cart(mass: float = 1.0) -> Problem:
    """Return the fastest motion of a mass on a line, a parameter, in a time that the hand can check."""
    x, u, m = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
    line = System(x, u, m, ca.vertcat(x[1], u / m), {"q": x[0], "v": x[1], "u": u}, {"m": mass})
    return point_to_point(line, [0.0], [1.0], u=1.0)


@cache
def there_and_back() -> SequenceSolution:
    """Return the fastest motion of the same mass there and back."""
    there = cart()
    q, v, u = (there.system[name] for name in ("q", "v", "u"))
    back = Problem(there.system, subject_to=(end(q, 0.0), end(v, 0.0), along(u, -1.0, 1.0)))
    result: SequenceSolution = solve(Sequence((there, back)), grid=uniform(6), solver=Ipopt(progress=False))
    return result


@cache
def polished() -> Solution:
    """Return its polished solution."""
    result: Solution = polish(solve(cart(), grid=uniform(6), solver=Ipopt(progress=False)))
    return result


def study() -> Study:
    """Return a study of its mass."""
    return Study(cart(), over={"m": [1.0, 1.5, 2.0]}, grid=uniform(4))


@cache
def table() -> StudyTable:
    """Return the table of the study."""
    return study().run()


@cache
def saved() -> bytes:
    """Return the file of the solution."""
    path = folder() / "saved.npz"
    save(solution(), path)
    return path.read_bytes()
