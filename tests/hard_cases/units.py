"""Units and scale: similar tasks have similar motions, found in as many iterations, whatever they are measured in."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from hard_cases.case import Case, Figure
from models import Manipulator, cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.machines.parameters import unit_of
from ocp import Bolza, Free, Ipopt, Problem, Solution, System, point_to_point, polish, solve, uniform, verify

GRID = uniform(40)
TOL = Ipopt().tol
COST = 8.0  # scale of the cost in the NLP (ocp.scaling)
SHARE = np.linspace(0.0, 1.0, 21)


@dataclass(frozen=True)
class Units:
    """What the numbers of masses, lengths and times are multiplied by."""

    mass: float = 1.0
    length: float = 1.0
    time: float = 1.0

    @property
    def force(self) -> float:
        """What the numbers of forces are multiplied by."""
        return self.mass * self.length / self.time**2

    def of(self, unit: str) -> float:
        """Return what a parameter with this unit is multiplied by."""
        return {"kg": self.mass, "m": self.length, "kg m^2": self.mass * self.length**2, "rad": 1.0}[unit]


SI = Units()
SYSTEMS = {"mm-t-s": Units(1e-3, 1e3, 1.0), "km-g-ms": Units(1e3, 1e-3, 1e3)}
RATIOS = 10.0 ** np.array([-6, -4, -3, -2, -1, 1, 2, 3, 4, 6])


@dataclass(frozen=True)
class Motion:
    """A motion of a machine from rest to rest; in SI."""

    machine: Callable[..., Manipulator]
    form: Callable[..., System]
    begin: tuple[float, ...]
    finish: tuple[float, ...]
    limit: tuple[float, ...]  # of the drives
    low: tuple[float, ...]
    high: tuple[float, ...]
    effort: float = 0.0  # weight of the integral of sum (tau / limit)^2 beside the time

    def problem(self, units: Units, horizon: Free) -> Problem:
        """Return the problem in other units, or of a similar machine."""
        own = {name: value * units.of(unit_of(name)) for name, value in self.machine().nominal.items()}
        machine = self.machine(**own)
        system = self.form(machine, [Gravity(9.81 * units.length / units.time**2)])
        q = self.coordinates(units)
        drives = np.array([units.force * (units.length if c.unit == "rad" else 1.0) for c in machine.coordinates])
        limit = np.array(self.limit) * drives
        used = sum((system["tau"][i] / limit[i]) ** 2 for i in range(len(limit)))
        cost = Bolza(time=1.0, running=self.effort * used) if self.effort else Bolza(time=1.0)
        return point_to_point(
            system, np.array(self.begin) * q, np.array(self.finish) * q, tau=limit,
            q=(np.array(self.low) * q, np.array(self.high) * q), minimise=cost, horizon=horizon,
        )  # fmt: skip

    def coordinates(self, units: Units) -> np.ndarray:
        """Return what the coordinates are multiplied by (n,)."""
        return np.array([units.of(coordinate.unit) for coordinate in self.machine().coordinates])


# Two axes of the cylindrical arm do not decide the time; with a penalty on the drives its motion is the only one.
MOTIONS = {
    "cylindrical": Motion(
        cylindrical, lagrange, (0.0, 0.2, 0.6), (2.0, 0.8, 0.8), (150.0, 900.0, 300.0),
        (-3.0, 0.0, 0.4), (3.0, 1.2, 1.0), effort=1.0,
    ),
    "spherical": Motion(
        spherical, hamel, (0.9, 0.0, 0.0, 0.85), (1.6, 2.0, 0.5, 0.9), (260.0, 160.0, 3.0, 400.0),
        (0.15, -3.0, -3.0, 0.6), (2.8, 3.0, 3.0, 1.1),
    ),
    "torus": Motion(
        torus, canonical, (0.0, 0.4, -0.9), (2.0, 0.8, -1.3), (250.0, 600.0, 220.0),
        (-3.0, -0.3, -2.6), (3.0, 2.0, 2.6),
    ),
}  # fmt: skip


@cache
def _reference(name: str) -> Solution:
    result: Solution = solve(MOTIONS[name].problem(SI, Free()), grid=GRID)
    return result


def _figures(name: str, units: Units, distance: float, words: str, horizon: Free) -> Iterable[Figure]:
    """Yield how far the motion, its cost and its iterations are from those in SI."""
    motion, known = MOTIONS[name], _reference(name)
    result = solve(motion.problem(units, horizon), grid=GRID)
    # Each limit leaves at most the tolerance of complementarity, and they add up.
    nlp = len(GRID) * (2 * known.controls.shape[2] + 6 * known.states.shape[2])
    left = nlp * TOL / COST
    apart = abs(result.cost / units.time / known.cost - 1.0)
    yield Figure(apart, left, distance, note=f"{words}: cost")
    q = result.signal("q", SHARE * result.duration) / motion.coordinates(units)
    far = float(np.max(np.abs(q - known.signal("q", SHARE * known.duration))))
    # Near an optimum the cost grows at least with the square of the distance.
    yield Figure(far, float(np.sqrt(left)), distance, note=f"{words}: q")
    more = max(result.iterations / known.iterations, known.iterations / result.iterations)
    yield Figure(more - 1.0, 1.0, distance, note=f"{words}: {result.iterations} iterations, {known.iterations} in SI")
    report = verify(result)
    yield Figure(float(not report.ok), 0.0, distance, note=f"{words}: {'; '.join(report.failures) or 'verified'}")


def _systems(name: str) -> Iterable[Figure]:
    for words, units in SYSTEMS.items():
        yield from _figures(name, units, units.length, words, Free(guess=units.time))


def _masses(name: str) -> Iterable[Figure]:
    for ratio in RATIOS.tolist():
        yield from _figures(name, Units(mass=ratio), ratio, f"{ratio:g} times as heavy", Free())


def _lengths(name: str) -> Iterable[Figure]:
    """Yield figures of similar machines in the same field of gravity, the guess of the duration left at one second."""
    for ratio in RATIOS.tolist():
        units = Units(length=ratio, time=ratio**0.5)
        yield from _figures(name, units, ratio, f"{ratio:g} times as large", Free())


def _polished(name: str) -> Iterable[Figure]:
    known = polish(_reference(name))
    for words, units in SYSTEMS.items():
        result = polish(solve(MOTIONS[name].problem(units, Free(guess=units.time)), grid=GRID))
        ratio = result.duration / units.time / known.duration - 1.0 if result.structure is not None else np.nan
        # 32 elements of six points at most, every control with two limits, each to 1e-10 of the cost.
        yield Figure(ratio, 32 * 6 * 8 * 1e-10, units.length, note=f"{words}: {result.message}")


def _case(
    name: str, words: str, quantity: str, towards: str, measure: Callable[[str], Iterable[Figure]], fast: bool
) -> Case:
    return Case("units", f"{name}: {words}", quantity, towards, partial(measure, name), fast)


WHAT = "cost, q / its range, iterations, verified; relative"
CASES: tuple[Case, ...] = (
    *(_case(name, "mm-t-s and km-g-ms", WHAT, "unit of length", _systems, True) for name in MOTIONS),
    *(_case(name, "mass ratios", WHAT, "mass ratio", _masses, False) for name in MOTIONS),
    *(_case(name, "size ratios", WHAT, "length ratio", _lengths, False) for name in MOTIONS),
    _case("torus", "switching times in other units", "t_f, relative", "unit of length", _polished, False),
)
