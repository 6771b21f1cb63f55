"""Valid calls of what builds arms from joints and links, and what fits their arguments."""

from __future__ import annotations

import numpy as np

import models
from hard_cases import input_examples as example
from hard_cases.input_call import AT_LEAST_ZERO, LIST, NOTHING, OPTIONAL, POSITIVE, REAL, TRUTH, Argument, Call
from models import DhRow, Joint, Kind, Link
from models.forms import canonical

A = Argument
THREE = frozenset({"falling"})
URDF = """<robot name="one"><link name="base"/><link name="arm"><inertial><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link><joint name="q1" type="revolute"><parent link="base"/>
<child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="2"/></joint></robot>"""


def trees() -> tuple[Call, ...]:
    """Return the calls of joints, links and the functions that make arms of them."""
    file = example.folder() / "one.urdf"
    file.write_text(URDF, encoding="utf-8")
    link = Link(2.0, (0.1, 0.0, 0.0), (0.1, 0.1, 0.1))
    joints = [Joint("q1", link=link), Joint("q2", axis=(0.0, 1.0, 0.0), link=link)]
    branches = [Joint("q1", link=link), Joint("q2", parent="q1", axis=(0.0, 1.0, 0.0), link=link)]
    tool = {
        "tool": A((0.1, 0.0, 0.2), THREE, ("tool",)),
        "tool_rotation": A((0.1, 0.0, 0.2), THREE | OPTIONAL, ("rotation",)),
        "name": A("arm", frozenset({"text", "no_text"})),
    }
    two = np.array([1.0, 2.0, 3.0])
    arm = models.robots.arm_3r()
    system = canonical(arm)
    poses = (
        Call(
            "models.inverse_kinematics",
            models.inverse_kinematics,
            {
                "machine": A(arm),
                "position": A((0.5, 0.1, 0.6), THREE),
                "rotation": A(None, THREE | OPTIONAL),
                "near": A((0.1, 0.2, 0.3), THREE | OPTIONAL),
                "starts": A(4),
                "seed": A(0, frozenset({"zero"})),
            },
        ),
        Call(
            "models.along_poses",
            models.along_poses,
            {
                "machine": A(arm),
                "positions": A([[0.5, 0.1, 0.6], [0.5, 0.12, 0.6]]),
                "rotations": A(None, OPTIONAL, ("rotation",)),
                "near": A(None, THREE | OPTIONAL),
            },
        ),
        Call(
            "models.orientation_error",
            models.orientation_error,
            {"system": A(system), "rotation": A((0.1, 0.2, 0.3), THREE)},
        ),
    )
    return (
        *poses,
        Call(
            "models.Link",
            Link,
            {
                "mass": A(2.0, AT_LEAST_ZERO),
                "centre": A((0.1, 0.0, 0.0), THREE, ("centre",)),
                "inertia": A((0.1, 0.1, 0.1), THREE, ("inertia",)),
                "capsules": A((), LIST),
            },
        ),
        Call(
            "models.Joint",
            Joint,
            {
                "name": A("q1", frozenset({"text"})),
                "kind": A(Kind.REVOLUTE),
                "parent": A("", frozenset({"text", "no_text"})),
                "origin": A((0.1, 0.0, 0.0), THREE, ("origin",)),
                "rotation": A((0.1, 0.0, 0.0), THREE, ("rotation",)),
                "axis": A(two, THREE, ("axis",)),
                "link": A(link),
                "lower": A(-2.0, REAL | OPTIONAL, ("limits", "lower")),
                "upper": A(2.0, REAL | OPTIONAL, ("limits", "lower")),
                "speed": A(2.0, POSITIVE | OPTIONAL),
                "effort": A(2.0, POSITIVE | OPTIONAL),
                "rotor": A(1e-4, AT_LEAST_ZERO),
                "gear": A(100.0, REAL),
                "carried": A(False, TRUTH),
                "damping": A(1.0, AT_LEAST_ZERO),
                "friction": A(1.0, AT_LEAST_ZERO),
            },
        ),
        Call(
            "models.DhRow",
            DhRow,
            {
                "theta": A(0.1, REAL),
                "d": A(0.1, REAL),
                "a": A(0.1, REAL),
                "alpha": A(0.1, REAL),
                "kind": A(Kind.REVOLUTE),
                "link": A(link),
                "joint": A(Joint("q1"), OPTIONAL),
            },
        ),
        Call("models.serial", models.serial, {"joints": A(joints)} | tool),
        Call("models.tree", models.tree, {"joints": A(branches), "tip": A("q1", OPTIONAL)} | tool),
        Call(
            "models.dh",
            models.dh,
            {"table": A([DhRow(link=link), (0.0, 0.1, 0.2, 0.3)]), "modified": A(True, TRUTH)} | tool,
        ),
        Call(
            "models.from_urdf",
            models.from_urdf,
            {
                "path": A(str(file), NOTHING, ("there is no such file",)),
                "tip": A("arm", OPTIONAL),
                "lock": A({}, OPTIONAL | {"map"}),
                "exact_angles": A(True, TRUTH),
            },
        ),
    )
