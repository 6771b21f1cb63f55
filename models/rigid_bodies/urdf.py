"""Arms from URDF files, the robot descriptions of ROS; meshes are not read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.machines.manipulator import Manipulator
from models.rigid_bodies.assembly import assemble_tree
from models.rigid_bodies.joint import Joint, Kind, about_axis
from models.rigid_bodies.tree_manipulator import manipulator
from models.rigid_bodies.urdf_links import urdf_link
from models.rigid_bodies.urdf_values import UrdfValues
from models.rigid_bodies.xml_document import Element, XmlError, read_xml
from ocp import checks

KINDS = {"revolute": Kind.REVOLUTE, "continuous": Kind.REVOLUTE, "prismatic": Kind.PRISMATIC, "fixed": Kind.FIXED}


def from_urdf(
    path: str | Path,
    tip: str | None = None,
    lock: Mapping[str, float] | None = None,
    *,
    exact_angles: bool = True,
) -> Manipulator:
    """Return the arm of a URDF file.

    Fixed joints are merged. With a tip only the joints between the base and the tip move; all others stay at 0, or
    where `lock` has them. The tool is the frame of the tip. Limits, damping and friction of the file are in
    `machine.limits`; nothing is applied unless asked for. `machine.notes` says what was changed.

    Args:
        path: of the file.
        tip: name of a link; None is the last link without a child, and every joint moves.
        lock: joint -> coordinate at which it is fixed [rad or m].
        exact_angles: whether angles that are decimals of multiples of pi/12, such as 1.5708, mean these; an axis that
            is off by 1e-6 otherwise makes the equations about twice as long.

    Raises:
        ValueError: one sentence on what is wrong with the file and where: no XML, a loop, a floating or planar joint, a
            moving mimic joint, a link or number that is missing or impossible.

    Source: wiki.ros.org/urdf/XML.
    """
    checks.truth("exact_angles", exact_angles)
    if tip is not None:
        checks.text("tip", tip, "the name of a link")
    locked = {} if lock is None else lock
    checks.mapping("lock", locked, "a dict joint -> coordinate")
    root = read_xml(path)
    if root.tag != "robot":
        raise XmlError(f"{path}: begins with <{root.tag[:60]}>, expected <robot>")
    _refuse_xacro(root, str(path))
    robot = _Robot(str(path), root, UrdfValues(str(path), exact_angles))
    joints, end = robot.joints(tip, {name: checks.number(f"lock: {name}", x) for name, x in locked.items()})
    try:
        assembly = assemble_tree(joints, end, (0.0, 0.0, 0.0))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return manipulator(root.attributes.get("name") or Path(path).stem, assembly, robot.values.summary())


def _refuse_xacro(root: Element, name: str) -> None:
    stack = [root]
    while stack:
        element = stack.pop()
        stack += element.children
        if element.tag.startswith("xacro:") or any("${" in text for text in element.attributes.values()):
            raise XmlError(f"{name}, line {element.line}: is xacro source; turn it into URDF first (`xacro in > out`)")


@dataclass(eq=False)
class _Robot:
    """A file being read: its name for messages, and the notes on what was changed."""

    path: str
    root: Element
    values: UrdfValues

    def joints(self, tip: str | None, lock: Mapping[str, float]) -> tuple[list[Joint], str]:
        """Return the joints, and the name of the one that carries the tip."""
        links = self._links()
        elements = list(self.root.all("joint"))
        by_child = self._by_child(elements, links)
        roots = [name for name in links if name not in by_child]
        if len(roots) != 1:
            listed = ", ".join(roots[:5]) or "none, so that the joints form a loop"
            raise self.values.error(self.root, f"expected one link without a parent, there are {len(roots)} ({listed})")
        self._check_connected(roots[0], elements, links)
        names = [self._name(joint) for joint in elements]
        for name in lock:
            if name not in names:
                raise ValueError(f"{self.path}: lock: there is no joint {name!r}; there are {', '.join(names)}")
        kept = None if tip is None else self._path_to(tip, by_child, links)
        result = [self._joint(joint, by_child, links, lock, kept, elements) for joint in elements]
        if tip is None:
            parents = {self._end(joint, "parent") for joint in elements}
            leaf = [joint for joint in elements if self._end(joint, "child") not in parents][-1]
            return self._sorted(result, elements), self._name(leaf)
        return self._sorted(result, elements), self._name(by_child[tip])

    def _sorted(self, joints: Sequence[Joint], elements: Sequence[Element]) -> list[Joint]:
        """Return the joints depth first, in the order of the file."""
        by_parent: dict[str, list[Joint]] = {}
        for joint in joints:
            by_parent.setdefault(joint.parent, []).append(joint)
        ordered: list[Joint] = []
        stack = list(reversed(by_parent.get("", [])))
        while stack:
            joint = stack.pop()
            ordered.append(joint)
            stack += reversed(by_parent.get(joint.name, []))
        return ordered

    def _links(self) -> dict[str, Element]:
        links: dict[str, Element] = {}
        for link in self.root.all("link"):
            name = self.values.text(link, "name")
            if name in links:
                raise self.values.error(link, f"a second link is called {name!r}; rename one of them")
            links[name] = link
        if not links:
            raise self.values.error(self.root, "there is no <link>, expected a robot")
        return links

    def _by_child(self, joints: Sequence[Element], links: Mapping[str, Element]) -> dict[str, Element]:
        by_child: dict[str, Element] = {}
        names: set[str] = set()
        if not joints:
            raise self.values.error(self.root, "there is no <joint>, expected at least one that moves")
        for joint in joints:
            name = self.values.text(joint, "name")
            if name in names:
                raise self.values.error(joint, f"a second joint is called {name!r}; rename one of them")
            names.add(name)
            for side in ("parent", "child"):
                if self._end(joint, side) not in links:
                    raise self.values.error(joint, f"joint {name!r}: its {side} {self._end(joint, side)!r} is no link")
            child = self._end(joint, "child")
            if child in by_child:
                raise self.values.error(joint, f"link {child!r} hangs on two joints, a loop; only trees can be read")
            by_child[child] = joint
        return by_child

    def _check_connected(self, root: str, joints: Sequence[Element], links: Mapping[str, Element]) -> None:
        children: dict[str, list[str]] = {}
        for joint in joints:
            children.setdefault(self._end(joint, "parent"), []).append(self._end(joint, "child"))
        reached, stack = {root}, [root]
        while stack:
            stack += (new := [child for child in children.get(stack.pop(), []) if child not in reached])
            reached |= set(new)
        lost = [name for name in links if name not in reached]
        if lost:
            raise self.values.error(links[lost[0]], f"links {', '.join(lost[:5])} form a loop apart from {root!r}")

    def _path_to(self, tip: str, by_child: Mapping[str, Element], links: Mapping[str, Element]) -> set[str]:
        if tip not in links:
            raise ValueError(f"{self.path}: tip: there is no link {tip!r}; there are {', '.join(links)}")
        if tip not in by_child:
            raise ValueError(f"{self.path}: tip: {tip!r} is the base, no joint moves it; choose a link beyond")
        path: set[str] = set()
        at = tip
        while at in by_child:
            path.add(self._name(by_child[at]))
            at = self._end(by_child[at], "parent")
        return path

    def _joint(
        self,
        element: Element,
        by_child: Mapping[str, Element],
        links: Mapping[str, Element],
        lock: Mapping[str, float],
        kept: set[str] | None,
        elements: Sequence[Element],
    ) -> Joint:
        name = self._name(element)
        kind = self.values.text(element, "type")
        mimic = self.values.one(element, "mimic")
        fixed_at = lock.get(name)
        if fixed_at is not None and kind == "fixed":
            raise ValueError(f"{self.path}: lock: joint {name!r} is fixed by the file and has no coordinate")
        if fixed_at is None and kept is not None and name not in kept and kind != "fixed":
            fixed_at = self._mimicked(mimic, lock) if mimic is not None else 0.0
            self.values.notes.append(f"joint {name!r} is not on the way to the tip and stays at {fixed_at:g}")
        if kind in ("floating", "planar") and fixed_at is None:
            raise self.values.error(
                element, f"joint {name!r} is {kind}; only revolute, continuous, prismatic, fixed ones can be read"
            )
        if kind not in KINDS and kind not in ("floating", "planar"):
            raise self.values.error(
                element, f"joint {name!r}: its type is {kind[:40]!r}, expected one of {', '.join(KINDS)}"
            )
        if mimic is not None and fixed_at is None and kind != "fixed":
            raise self.values.error(element, self._about_mimics(elements, lock))
        parent = by_child.get(self._end(element, "parent"))
        rotation, origin = self.values.origin(element, f"joint {name!r}")
        axis = self._axis(element, name) if kind != "fixed" else (1.0, 0.0, 0.0)
        link = urdf_link(links[self._end(element, "child")], self.values)
        common = {"parent": "" if parent is None else self._name(parent), "link": link}
        if kind in ("floating", "planar"):
            kind, fixed_at = "fixed", None
        if fixed_at is not None and kind != "fixed":
            self._note_outside(element, name, fixed_at)
            if KINDS[kind] is Kind.REVOLUTE:
                rotation = rotation @ about_axis(np.array(axis), fixed_at)
            else:
                origin = origin + rotation @ np.array(axis) / np.linalg.norm(axis) * fixed_at
            kind = "fixed"
        if kind == "fixed":
            return Joint(name, Kind.FIXED, origin=tuple(origin), rotation=rotation, **common)  # type: ignore[arg-type]
        return Joint(
            name, KINDS[kind], origin=tuple(origin), rotation=rotation, axis=axis,
            **common, **self._limits(element, name, kind),  # type: ignore[arg-type]
        )  # fmt: skip

    def _note_outside(self, element: Element, name: str, at: float) -> None:
        limit, continuous = self.values.one(element, "limit"), element.attributes["type"].strip() == "continuous"
        if limit is not None and not continuous and {"lower", "upper"} <= set(limit.attributes):
            low, high = (self.values.number(limit, side, f"joint {name!r}") for side in ("lower", "upper"))
            if low < high and not low - 1e-9 <= at <= high + 1e-9:
                self.values.notes.append(f"joint {name!r} is fixed at {at:g}, outside its range {low:g} to {high:g}")

    def _about_mimics(self, elements: Sequence[Element], lock: Mapping[str, float]) -> str:
        mimics = [self._name(e) for e in elements if self.values.one(e, "mimic") and self._name(e) not in lock]
        locks = ", ".join(f"{name!r}: 0.0" for name in mimics)
        listed = f"{mimics[0]} mimics another joint" if len(mimics) == 1 else f"{', '.join(mimics)} mimic other joints"
        what = "it" if len(mimics) == 1 else "them"
        return f"{listed}; fix {what} with lock={{{locks}}}, or choose a tip before {what}"

    def _mimicked(self, mimic: Element, lock: Mapping[str, float]) -> float:
        multiplier = self.values.number(mimic, "multiplier", "mimic", 1.0)
        return multiplier * lock.get(mimic.attributes.get("joint", ""), 0.0) + self.values.number(
            mimic, "offset", "mimic", 0.0
        )

    def _limits(self, element: Element, name: str, kind: str) -> dict[str, float | None]:
        said, limit, dynamics = (
            f"joint {name!r}",
            self.values.one(element, "limit"),
            self.values.one(element, "dynamics"),
        )
        result: dict[str, float | None] = {}
        if limit is not None:
            ends = [
                self.values.number(limit, side, said) if side in limit.attributes else None
                for side in ("lower", "upper")
            ]
            if kind != "continuous":
                if ends == [0.0, 0.0] or ends == [None, None]:
                    self.values.notes.append(f"{said}: the file gives no range; it has no limits of position")
                    ends = [None, None]
                if None not in ends and ends[0] > ends[1]:  # type: ignore[operator]
                    raise self.values.error(
                        limit, f"{said}: lower {ends[0]:g} is above upper {ends[1]:g}; exchange them"
                    )
                result |= {"lower": ends[0], "upper": ends[1]}
            for key, attribute in (("speed", "velocity"), ("effort", "effort")):
                value = self.values.number(limit, attribute, said, 0.0)
                if value < 0.0:
                    raise self.values.error(
                        limit, f"{said}: {attribute} is {value:g}, expected a number >= 0 (0 is unknown)"
                    )
                result[key] = value or None
        elif kind != "continuous":
            self.values.notes.append(f"{said}: has no <limit>; no limits are known")
        if dynamics is not None:
            for attribute in ("damping", "friction"):
                value = self.values.number(dynamics, attribute, said, 0.0)
                if value < 0.0:
                    raise self.values.error(dynamics, f"{said}: {attribute} is {value:g}, expected a number >= 0")
                result[attribute] = value
        return result

    def _axis(self, element: Element, name: str) -> tuple[float, float, float]:
        axis = self.values.one(element, "axis")
        x, y, z = [1.0, 0.0, 0.0] if axis is None else self.values.three(axis, "xyz", f"joint {name!r}", "1 0 0")
        if not x * x + y * y + z * z > 1e-18:
            raise self.values.error(axis or element, f"joint {name!r}: its axis is zero, expected a direction")
        return x, y, z

    def _name(self, joint: Element) -> str:
        return self.values.text(joint, "name")

    def _end(self, joint: Element, side: str) -> str:
        end = self.values.one(joint, side)
        if end is None:
            raise self.values.error(joint, f"joint {joint.attributes.get('name', '')!r}: has no <{side}>")
        return self.values.text(end, "link")
