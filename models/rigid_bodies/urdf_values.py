"""Values of the elements of a URDF file: numbers, names and placements, with sentences for what is wrong."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from models.rigid_bodies.joint import roll_pitch_yaw
from models.rigid_bodies.xml_document import Element, XmlError
from ocp.checks import Array

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
FAR = 30.0  # a longer distance within a robot is noted [m]
DECIMALS = 5e-6  # an angle this close to a multiple of pi/12 is its decimal in a file [rad]


@dataclass(eq=False)
class UrdfValues:
    """Reads attributes; collects notes on what was changed."""

    path: str
    exact_angles: bool
    notes: list[str] = field(default_factory=list)
    meshes: list[str] = field(default_factory=list)  # links whose collision meshes are not read
    angles: list[tuple[str, float]] = field(default_factory=list)  # as in the file, with the change by making it exact

    def summary(self) -> tuple[str, ...]:
        """Return the notes, with one for all meshes and one for all angles."""
        result = list(self.notes)
        if self.angles:
            text, _ = self.angles[0]
            largest = max(change for _, change in self.angles)
            result.append(
                f"{len(self.angles)} angles such as {text} are read as exact multiples of pi/12; the largest change is "
                f"{largest:.0e} rad"
            )
        if self.meshes:
            result.append(f"collision meshes are not read: {', '.join(self.meshes)}")
        return tuple(result)

    def one(self, element: Element, tag: str) -> Element | None:
        """Return the only child with a tag, None if there is none."""
        children = list(element.all(tag))
        if len(children) > 1:
            said = f"{element.tag} {name!r}" if (name := element.attributes.get("name")) else f"<{element.tag}>"
            raise self.error(children[1], f"{said}: has {len(children)} <{tag}>, expected one")
        return children[0] if children else None

    def far(self, size: float, said: str) -> None:
        """Note a length that no robot has, most likely one in millimetres."""
        if size > FAR and not any("metres" in note for note in self.notes):
            self.notes.append(f"{said}: {size:.4g} m; lengths of a URDF file are metres")

    def origin(self, element: Element, said: str) -> tuple[Array, Array]:
        """Return the rotation (3, 3) and the position (3,) of the <origin> of an element."""
        origin = self.one(element, "origin")
        if origin is None:
            return np.eye(3), np.zeros(3)
        position = self.three(origin, "xyz", said, "0 0 0")
        self.far(float(np.linalg.norm(position)), f"{said}: its origin is far away")
        angles = self.three(origin, "rpy", said, "0 0 0")
        if self.exact_angles:
            angles = [self.snapped_angle(angle) for angle in angles]
        return roll_pitch_yaw(angles), np.array(position)

    def snapped_angle(self, angle: float) -> float:
        """Return an angle, that of a decimal of a multiple of pi/12 made exact."""
        twelfth = np.pi / 12 * round(angle / (np.pi / 12))
        off = abs(angle - twelfth)
        if off > DECIMALS or off == 0.0:
            return angle
        if off > 1e-12:
            self.angles.append((repr(angle), off))
        return float(twelfth)

    def three(self, element: Element, key: str, said: str, default: str | None) -> list[float]:
        """Return three numbers of an attribute."""
        text = element.attributes.get(key, default)
        words = [] if text is None else text.split()
        if len(words) != 3:
            raise self.error(element, f"{said}: {key} is {(text or '')[:60]!r}, expected three numbers")
        return [self.finite(element, word, key, said) for word in words]

    def number(self, element: Element, key: str, said: str, default: float | None = None) -> float:
        """Return a number of an attribute, the default where it is missing."""
        if key not in element.attributes:
            if default is None:
                raise self.error(element, f"{said}: <{element.tag}> has no {key!r}")
            return default
        return self.finite(element, element.attributes[key].strip(), key, said)

    def finite(self, element: Element, word: str, key: str, said: str) -> float:
        """Return a word as a finite number."""
        if not NUMBER.match(word) or not np.isfinite(float(word)) or abs(float(word)) > 1e15:
            raise self.error(element, f"{said}: {key} has {word[:40]!r}, expected a finite number")
        return float(word)

    def text(self, element: Element, key: str) -> str:
        """Return a name that is not empty."""
        text = element.attributes.get(key, "").strip()
        if not text:
            raise self.error(element, f"<{element.tag}> has no {key!r}")
        return text

    def error(self, element: Element, words: str) -> XmlError:
        """Return the error of an element with file and line."""
        return XmlError(f"{self.path}, line {element.line}: {words}")
