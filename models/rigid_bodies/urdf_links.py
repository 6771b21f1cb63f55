"""Links of URDF files: inertia, and capsules around their primitive collision shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from models.rigid_bodies.joint import Capsule, Link
from models.rigid_bodies.urdf_values import UrdfValues
from models.rigid_bodies.xml_document import Element
from ocp.checks import Array


def capsules_of(shape: str, sizes: Sequence[float], rotation: Array, origin: Array) -> list[Capsule]:
    """Return capsules that contain a shape.

    A sphere and a capsule are exact, a cylinder gets caps of its radius beyond its ends, a box a capsule along its
    longest side that contains its corners.

    Args:
        shape: "sphere", "capsule", "cylinder" or "box".
        sizes: radius; radius and length; or three sides [m].
        rotation: (3, 3) axes of the shape in the frame of the link.
        origin: (3,) its centre [m].
    """
    axis, half = 2, 0.0
    if shape == "box":
        axis = int(np.argmax(sizes))
        half = sizes[axis] / 2
        radius = float(np.hypot(sizes[(axis + 1) % 3], sizes[(axis + 2) % 3])) / 2
    else:
        radius = sizes[0]
        half = sizes[1] / 2 if len(sizes) > 1 else 0.0
    if not radius > 0.0:
        return []
    along = rotation[:, axis] * half
    return [Capsule(tuple(origin - along), tuple(origin + along), float(radius))]


def urdf_link(element: Element, values: UrdfValues) -> Link:
    """Return mass, mass centre, inertia and capsules of a <link>.

    Args:
        element: the link.
        values: of the file.

    Raises:
        XmlError: a number that is missing or impossible.
    """
    name = values.text(element, "name")
    said, inertial = f"link {name!r}", values.one(element, "inertial")
    shapes = tuple(_capsules(element, said, values))
    if inertial is None:
        return Link(capsules=shapes)
    mass = values.one(inertial, "mass")
    tensor = values.one(inertial, "inertia")
    if mass is None or tensor is None:
        lacks = "<mass>" if mass is None else "<inertia>"
        raise values.error(inertial, f"{said}: its <inertial> has no {lacks}")
    value = values.number(mass, "value", said)
    if value < 0.0:
        raise values.error(mass, f"{said}: its mass is {value:g} kg, expected a number >= 0")
    xx, yy, zz, xy, xz, yz = (
        values.number(tensor, key, said, 0.0 if key in ("ixy", "ixz", "iyz") else None)
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    if value > 0.0:
        values.far(float(np.sqrt(max(xx, yy, zz, 0.0) / value)), f"{said}: its radius of gyration is large")
    rotation, centre = values.origin(inertial, said)
    turned = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Link(value, tuple(float(x) for x in centre), tuple(float(turned[i, j]) for i, j in order), shapes)


def _capsules(link: Element, said: str, values: UrdfValues) -> Iterator[Capsule]:
    for collision in link.all("collision"):
        rotation, origin = values.origin(collision, said)
        geometry = values.one(collision, "geometry")
        if geometry is None or not geometry.children:
            continue
        shape = geometry.children[0]
        if shape.tag == "mesh":
            values.meshes.append(values.text(link, "name"))
            continue
        sizes = _shape(shape, said, values)
        if sizes is not None:
            yield from capsules_of(shape.tag, sizes, rotation, origin)


def _shape(shape: Element, said: str, values: UrdfValues) -> list[float] | None:
    if shape.tag not in ("box", "sphere", "cylinder", "capsule"):
        values.notes.append(f"{said}: its collision shape <{shape.tag[:40]}> is not known")
        return None
    if shape.tag == "box":
        keys: tuple[str, ...] = ("size",) * 3
        sizes = values.three(shape, "size", said, None)
    else:
        keys = ("radius",) if shape.tag == "sphere" else ("radius", "length")
        sizes = [values.number(shape, key, said) for key in keys]
    for key, size in zip(keys, sizes, strict=True):
        if size < 0.0:
            raise values.error(shape, f"{said}: its collision <{shape.tag}> has the {key} {size:g}, expected m > 0")
    if not max(sizes) > 0.0 or (shape.tag != "box" and sizes[0] == 0.0):
        values.notes.append(f"{said}: its collision <{shape.tag}> has no size and is left out")
        return None
    return sizes
