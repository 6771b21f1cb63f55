"""Distances that the links of a machine keep along a motion, as a value of a task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.rigid_bodies.clearances import Distance, distances, without_capsules
from models.rigid_bodies.collisions import COVER, MARGIN, keep_clear
from models.scenes.card import entry
from ocp.checks import Array
from ocp.problem.constraints import Constraint
from ocp.problem.regions import Region


@dataclass(frozen=True, eq=False)
class LinkClearance:
    """What the links of a machine keep clear of, and by how much.

    Args:
        machine: with capsules.
        obstacles: by name.
        pairs: of bodies that do not touch.
        floor: height above which the links stay [m], or None.
        distance: that is kept from obstacles and floor >= 0 [m].
        apart: that the bodies of pairs keep >= 0 [m].
        margin: beyond it at the nodes [m].
        cover: how far the spheres around the capsules stick out at most [m].
    """

    machine: Manipulator
    obstacles: Mapping[str, Region]
    pairs: tuple[tuple[str, str], ...] = ()
    floor: float | None = None
    distance: float = 0.0
    apart: float = 0.0
    margin: float = MARGIN
    cover: float = COVER

    @cached_property
    def constraints(self) -> tuple[Constraint, ...]:
        """Return the path constraints.

        Raises:
            ValueError: the machine has no capsules, or a number is wrong.
        """
        outer = keep_clear(
            self.machine, self.obstacles, floor=self.floor, clearance=self.distance, margin=self.margin,
            cover=self.cover,
        )  # fmt: skip
        return (*outer, *keep_clear(
            self.machine, pairs=self.pairs, clearance=self.apart, margin=self.margin, cover=self.cover,
        ))  # fmt: skip

    def nearest(self, q: Array) -> tuple[Distance, ...]:
        """Return how near the links come to each obstacle, the floor and each other, the nearest body of each.

        Args:
            q: (K, n) positions along a motion [rad or m].
        """
        found: dict[str, Distance] = {}
        for one in distances(self.machine, q, self.obstacles, self.pairs, self.floor):
            key = f"{one.body}, {one.other}" if (one.body, one.other) in self.pairs else one.other
            if key not in found or one.least < found[key].least:
                found[key] = one
        return tuple(sorted(found.values(), key=lambda one: one.least))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not kept clear, in a sentence."""
        bare = without_capsules(self.machine)
        if not bare:
            return ()
        names = ", ".join(bare)
        return (f"{names}: without capsules, nothing is kept away from there; 'radius' in [collisions] gives some",)

    def wanted(self, one: Distance) -> float:
        """Return the distance that is to be kept [m]."""
        return self.apart if (one.body, one.other) in self.pairs else self.distance

    def fault(self, q: Array) -> str:
        """Return why a motion cannot pass a position (n,), or "": two bodies, and how near they are."""
        nearest = self.nearest(q[None])
        for one in nearest:
            if one.least < self.wanted(one):
                return f"{one}" if one.least < 0.0 else f"{one}; the clearance is {self.wanted(one):g} m"
        for one in nearest:
            if self._refused(one, q):
                return (
                    f"{one}, but the smooth limits exclude it: spheres stick out of links by up to {self.cover:g} m, "
                    f"and edges are rounded outwards; give a smaller 'cover'"
                )
        return ""

    def card(self) -> list[str]:
        """Return lines of a card."""
        parts = [f"{self.distance:g} m from {', '.join(self.obstacles)}"] if self.obstacles else []
        parts += [f"{self.distance:g} m above the floor at {self.floor:g} m"] if self.floor is not None else []
        if self.pairs:
            parts.append(f"{self.apart:g} m between {', '.join(f'{a} and {b}' for a, b in self.pairs)}")
        return entry("links", "; ".join((*parts, *self.notes)) or "keep clear of nothing")

    def _refused(self, one: Distance, q: Array) -> bool:
        """Return whether the constraint of a body and its obstacle excludes a position."""
        symbols = ca.vertcat(self.machine.q, *self.machine.symbols.values())
        values = np.concatenate([q, [self.machine.nominal[name] for name in self.machine.symbols]])
        pair = (one.body, one.other) in self.pairs
        obstacles = {one.other: self.obstacles[one.other]} if one.other in self.obstacles and not pair else {}
        own = replace(
            self, obstacles=obstacles, pairs=((one.body, one.other),) if pair else (),
            floor=self.floor if not pair and not obstacles else None,
        ).constraints  # fmt: skip
        left = [c.expression - ca.DM(c.lower) for c in own]
        return bool(np.min(np.array(ca.Function("left", [symbols], [ca.vertcat(*left)])(values))) < 0.0)
