"""Rotations and origins of links, tool and bodies in the base."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from models.rigid_bodies.recursions import Recursions
from models.rigid_bodies.scalars import Entry, apply, plus, product, transposed


@dataclass(frozen=True, eq=False)
class Placements:
    """Frames of a tree at symbolic coordinates."""

    recursions: Recursions

    def pose(self, k: int) -> tuple[list[list[Entry]], list[Entry]]:
        """Return rotation (3, 3) and origin (3,) of a frame of the tree in the base."""
        pose = self.recursions.tree.poses[k]
        columns, origin = transposed(pose.rotation), list(pose.origin)
        if pose.link < 0:
            return transposed(columns), origin
        turned = self.recursions.all_motions.turned[pose.link]
        if turned is not None:
            columns, origin = [turned.up(c) for c in columns], turned.up(origin)
        if k == 0:  # a vector carried to the base link by link is the shortest, products of rotations serve many
            for i in self.recursions.tree.path(pose.link):
                columns = [self.recursions.motions[i].up(c) for c in columns]
                origin = plus(self.recursions.motions[i].up(origin), self.recursions.motions[i].origin)
            return transposed(columns), origin
        rotation, start = self._placed[pose.link]
        return product(rotation, transposed(columns)), plus(apply(rotation, origin), start)

    @cached_property
    def _placed(self) -> list[tuple[list[list[Entry]], list[Entry]]]:
        """Rotation and origin of the frame of every link in the base."""
        result: list[tuple[list[list[Entry]], list[Entry]]] = []
        for i, motion in enumerate(self.recursions.motions):
            own = transposed([motion.up(axis) for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])])
            if self.recursions.parents[i] < 0:
                result.append((own, list(motion.origin)))
            else:
                rotation, start = result[self.recursions.parents[i]]
                result.append((product(rotation, own), plus(apply(rotation, motion.origin), start)))
        return result
