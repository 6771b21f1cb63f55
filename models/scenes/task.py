"""A task as a value: from, to, via, limits, obstacles, what is minimised, horizon; and as a Problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca

from models.scenes.card import entry, interval
from models.scenes.link_clearance import LinkClearance
from models.scenes.tool_orientation import Orientation
from ocp.problem.constraints import Constraint, along, end, start
from ocp.problem.problem import Bolza, Fixed, Free, Problem
from ocp.problem.regions import HalfSpace, Region, outside
from ocp.problem.sequence import Sequence
from ocp.system import System

SAME = 1e-9  # difference of two numbers, relative or absolute, that is rounding (degrees)


@dataclass(frozen=True)
class Interval:
    """lower <= signal <= upper, component by component, SI and radians; infinite for no limit."""

    signal: str
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def at(self, where: Callable[..., Constraint], system: System) -> Constraint:
        """Return the constraint at the start, at the end or along, as `where` is start, end or along."""
        replaces = self.signal if where is along and self.signal in system.limits else ""
        return where(system[self.signal], self.lower, self.upper, name=replaces)

    def holds_in(self, point: Point) -> bool:
        """Return whether these limits hold wherever those of a point hold; rounding of numbers does not count."""
        return any(
            isinstance(one, Interval)
            and one.signal == self.signal
            and all(a >= b - SAME * max(1.0, abs(b)) for a, b in zip(one.lower, self.lower, strict=True))
            and all(a <= b + SAME * max(1.0, abs(b)) for a, b in zip(one.upper, self.upper, strict=True))
            for one in point
        )

    def known_to(self, system: System) -> bool:
        """Return whether a system has the signal, of this size."""
        return self.signal in system.signals and system[self.signal].numel() == len(self.lower)

    def words(self, system: System) -> list[str]:
        """Return the limits in words, component by component."""
        labels = system.label(self.signal, len(self.lower))
        return [interval(label, *ends) for label, *ends in zip(labels, self.lower, self.upper, strict=True)]


Point = tuple[Interval | Orientation, ...]  # what holds at the start, at the end or at a via point


def without_standing_legs(
    points: list[Point], horizons: tuple[Free | Fixed, ...]
) -> tuple[tuple[Point, ...], tuple[Free | Fixed, ...]]:
    """Return the via points and horizons of a motion without the via points that are passed where a leg begins or ends.

    A leg of free duration between a point and itself has no length; its equations determine nothing.

    Args:
        points: start, via points, end.
        horizons: one for each leg; a leg of fixed duration, or with a lower limit of it, is kept.
    """
    points, left = list(points), list(horizons)
    k = 1
    while k < len(points) - 1:
        for leg, neighbour in ((k - 1, points[k - 1]), (k, points[k + 1])):
            horizon = left[leg]
            free = isinstance(horizon, Free) and horizon.lower == 0.0
            if free and all(interval.holds_in(neighbour) for interval in points[k]):
                del points[k], left[leg]
                break
        else:
            k += 1
    return tuple(points[1:-1]), tuple(left)


@dataclass(frozen=True)
class Obstacle:
    """A region that a point of the motion stays out of, or inside of."""

    region: Region
    keep: Callable[[Region, ca.SX], Constraint]  # outside or inside
    point: str  # signal
    name: str = ""
    links: bool = False  # whether all links keep out of it as well


@dataclass(frozen=True)
class Task:
    """A motion to be found: where it begins, passes and ends, within which limits, and what is minimised."""

    begin: Point
    via: tuple[Point, ...]
    finish: Point
    limits: tuple[Interval, ...]
    obstacles: tuple[Obstacle, ...]
    horizons: tuple[Free | Fixed, ...]  # one for each leg
    elements: int = 50  # of the grid of each leg
    time: float = 1.0  # weight of the duration
    squares: Mapping[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)  # signal -> weights
    integral: Mapping[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)
    clearance: LinkClearance | None = None  # of the links; None: only the points of `obstacles` keep out of them

    @property
    def drawn(self) -> tuple[Obstacle, ...]:
        """What is drawn around a motion: obstacles and the floor."""
        if self.clearance is None or self.clearance.floor is None:
            return self.obstacles
        floor = HalfSpace((0.0, 0.0, self.clearance.floor), (0.0, 0.0, 1.0))
        return (*self.obstacles, Obstacle(floor, outside, "tool", "floor"))

    def problem(self, system: System) -> Problem | Sequence:
        """Return the problem of the task for a system; with via points a sequence of one problem for each leg.

        Raises:
            KeyError: the system lacks a signal.
        """
        return self._legs(system)[0] if not self.via else Sequence(self._legs(system), links_of(system))

    def card(self, system: System) -> str:
        """Return the task as lines of a card."""

        def listed(point: Point) -> str:
            return "; ".join(words for one in point for words in one.words(system))

        cost = [f"{self.time:g} t_f"] if self.time else []
        cost += [f"integral of {weights} . {name}^2" for name, weights in self.squares.items()]
        cost += [f"integral of {weights} . {name}" for name, weights in self.integral.items()]
        lines = [*entry("task limits", listed(self.limits)), *entry("from", listed(self.begin))]
        for point in self.via:
            lines += entry("via", listed(point))
        lines += [*entry("to", listed(self.finish)), *entry("minimise", " + ".join(cost))]
        lines += self.clearance.card() if self.clearance is not None else []
        for obstacle in self.obstacles:
            lines += entry(obstacle.keep.__name__, f"{obstacle.region} for {obstacle.point}")
        lines += entry("horizon", f"{'; '.join(map(str, self.horizons))}; {self.elements} elements for each leg")
        return "\n".join(lines)

    def known_to(self, system: System) -> Task:
        """Return the task without its limits and weights of signals that the system does not have."""

        def kept(given: Point) -> Point:
            return tuple(one for one in given if one.known_to(system))

        return replace(
            self,
            begin=kept(self.begin), finish=kept(self.finish),
            limits=tuple(one for one in self.limits if one.known_to(system)),
            via=tuple(kept(point) for point in self.via),
            squares={name: w for name, w in self.squares.items() if name in system.signals},
            integral={name: w for name, w in self.integral.items() if name in system.signals},
        )  # fmt: skip

    def _legs(self, system: System) -> tuple[Problem, ...]:
        named = {interval.signal for interval in self.begin}
        still = "rest" if "rest" in system.signals else "v"
        size = system[still].numel()
        rest = Interval(still, (0.0,) * size, (0.0,) * size)
        begin = [interval.at(start, system) for interval in self.begin]
        begin += [] if "v" in named else [rest.at(start, system)]
        begin += [start(system[name], value) for name, value in system.initial.items() if name not in named]
        finish = [interval.at(end, system) for interval in self.finish]
        finish += [] if "v" in {interval.signal for interval in self.finish} else [rest.at(end, system)]
        throughout = [interval.at(along, system) for interval in self.limits]
        throughout += [o.keep(o.region, system[o.point]) for o in self.obstacles]
        throughout += self.clearance.constraints if self.clearance is not None else ()
        edges = [begin, *([interval.at(end, system) for interval in point] for point in self.via), finish]
        return tuple(
            Problem(system, horizon, self._cost(system), (*(first if k == 0 else ()), *last, *throughout))
            for k, ((first, last), horizon) in enumerate(zip(pairwise(edges), self.horizons, strict=True))
        )

    def _cost(self, system: System) -> Bolza:
        running = ca.SX(0)
        for name, weights in self.squares.items():
            running += ca.dot(ca.DM(weights), system[name] ** 2)
        for name, weights in self.integral.items():
            running += ca.dot(ca.DM(weights), system[name])
        return Bolza(time=self.time, running=running)


def links_of(system: System) -> tuple[str | tuple[ca.SX, ca.SX], ...]:
    """Return what is continuous between legs: signals that make up the state, or the state itself."""
    missing = {symbol.element_hash() for symbol in ca.vertsplit(system.x)}
    names = []
    for name, signal in system.signals.items():
        parts = {part.element_hash() for part in ca.vertsplit(ca.densify(signal)) if part.is_symbolic()}
        if len(parts) == signal.numel() and parts <= missing:
            names.append(name)
            missing -= parts
    return tuple(names) if not missing else ((system.x, system.x),)
