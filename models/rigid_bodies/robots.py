"""Robots with published data, ready to use; the docstrings name the source of every number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.parameters import Value
from models.rigid_bodies.builders import serial
from models.rigid_bodies.joint import Capsule, Joint, Kind, Link
from models.rigid_bodies.robot_shapes import panda_shapes, universal_shapes

HALF, QUARTER, EIGHTH = np.pi, np.pi / 2, np.pi / 4
ZERO = (0.0, 0.0, 0.0)
UP_Y, UP_X = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)


def arm_3r() -> Manipulator:
    """Return a plain arm of three joints: a turning column, then two parallel horizontal axes.

    Links of 0.5 and 0.4 m with 8 and 4 kg, capsules of 5 cm along them. The numbers are those of no product; they are
    round, for teaching.
    """
    limits = {"lower": -HALF, "upper": HALF, "speed": 3.0}
    return serial(
        [
            Joint("q1", link=Link(10.0, (0.0, 0.0, 0.3), (0.2, 0.2, 0.1)), effort=60.0, **limits),  # type: ignore[arg-type]
            Joint(
                "q2", origin=(0.0, 0.0, 0.4), rotation=(QUARTER, 0.0, 0.0),
                link=Link(8.0, (0.25, 0.0, 0.05), (0.02, 0.2, 0.2), _rod(0.5)), effort=90.0, **limits,  # type: ignore[arg-type]
            ),
            Joint(
                "q3", origin=(0.5, 0.0, 0.0), link=Link(4.0, (0.2, 0.0, 0.0), (0.01, 0.06, 0.06), _rod(0.4)),
                effort=30.0, **limits,  # type: ignore[arg-type]
            ),
        ],
        tool=(0.4, 0.0, 0.0),
        name="3R arm",
    )  # fmt: skip


def _rod(length: float) -> tuple[Capsule]:
    return (Capsule((0.0, 0.0, 0.0), (length, 0.0, 0.0), 0.05),)


def puma560() -> Manipulator:
    """Return the Unimation PUMA 560 with the inertia of its rotors; link 1 is published with its moment only.

    Source: P. I. Corke, B. Armstrong-Helouvry, A search for consensus among model parameters reported for the PUMA 560
        robot, ICRA 1994 (links, rotors, gears, friction); B. Armstrong, O. Khatib, J. Burdick, The explicit dynamic
        model and inertial parameters of the PUMA 560 arm, ICRA 1986 (largest torques); ranges of the joints as in the
        Robotics Toolbox for Python of P. Corke (models.DH.Puma560; its version for MATLAB has -45 to 225, -225 to 45
        and -110 to 170 degrees for joints 2 to 4, after Wang and Chen, IEEE Trans. Robotics and Automation 7 (1991)).
        Friction is the mean of both directions, reflected to the joints; no speed limits are published there.
    """
    links = (
        Link(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.35)),
        Link(17.4, (0.068, 0.006, 0.2275), (0.13, 0.524, 0.539)),
        Link(4.8, (0.0, 0.07, 0.16415), (0.066, 0.0125, 0.086)),
        Link(0.82, (0.0, 0.0, 0.4508), (0.0018, 0.0018, 0.0013)),
        Link(0.34, (0.0, 0.0, 0.0), (0.0003, 0.0003, 0.0004)),
        Link(0.09, (0.0, 0.0, 0.032), (0.00015, 0.00015, 0.00004)),
    )
    origins = (
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.4318, 0.0, 0.0),
        (0.0203, 0.0, 0.15005),
        (0.0, 0.0, 0.4318),
        (0.0,) * 3,
    )
    rolls = (0.0, QUARTER, 0.0, -QUARTER, QUARTER, -QUARTER)
    gears = (-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686)
    rotors = (200e-6, 200e-6, 200e-6, 33e-6, 33e-6, 33e-6)
    ends = np.deg2rad((160.0, 110.0, 135.0, 266.0, 100.0, 266.0))
    efforts = (97.6, 186.4, 89.4, 24.2, 20.1, 21.3)
    viscous = (1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6)
    dry = ((0.395, 0.435), (0.126, 0.071), (0.132, 0.105), (11.2e-3, 16.9e-3), (9.26e-3, 14.5e-3), (3.96e-3, 10.5e-3))
    joints = [
        Joint(
            f"q{i + 1}", origin=origins[i], rotation=(rolls[i], 0.0, 0.0), link=links[i], lower=-float(ends[i]),
            upper=float(ends[i]), effort=efforts[i], rotor=rotors[i], gear=gears[i],
            damping=viscous[i] * gears[i] ** 2, friction=abs(gears[i]) * (dry[i][0] + dry[i][1]) / 2,
        )
        for i in range(6)
    ]  # fmt: skip
    return serial(joints, name="PUMA 560")


def ur5() -> Manipulator:
    """Return the Universal Robots UR5; the tool is its flange.

    The file gives the wrists the moments of cylinders of 0.6 m radius, ten times that of the bodies (0.11 and
    0.22 kg m^2 for 1.2 kg). They are kept, as other programs have them too; the wrists of a real arm are lighter.

    Source: the package ur_description of ROS-Industrial, file ur5_robot.urdf, with the dimensions of the manufacturer;
        capsules as `universal_shapes` says.
    """
    return _universal(
        "UR5",
        (0.089159, 0.13585, -0.1197, 0.425, 0.39225, 0.093, 0.09465, 0.0823),
        (
            Link(3.7, (0.0, 0.0, 0.0), (0.010267495893, 0.010267495893, 0.00666)),
            Link(8.393, (0.0, 0.0, 0.28), (0.22689067591, 0.22689067591, 0.0151074)),
            Link(2.275, (0.0, 0.0, 0.25), (0.049443313556, 0.049443313556, 0.004095)),
            Link(1.219, (0.0, 0.0, 0.0), (0.111172755531, 0.111172755531, 0.21942)),
            Link(1.219, (0.0, 0.0, 0.0), (0.111172755531, 0.111172755531, 0.21942)),
            Link(0.1879, (0.0, 0.0, 0.0), (0.0171364731454, 0.0171364731454, 0.033822)),
        ),
        (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
        (3.15, 3.15, 3.15, 3.2, 3.2, 3.2),
        (0.06, 0.054, 0.06, 0.045, 0.045),
    )


def ur10() -> Manipulator:
    """Return the Universal Robots UR10; the tool is its flange.

    The numbers are those of the first releases of the file, with the mass centres of the wrists at the origins of their
    joints; later ones move these by 0.115 m and that of the upper arm by 0.045 m.

    Source: the package ur_description of ROS-Industrial, file ur10_robot.urdf, with the dimensions of the
        manufacturer.
    """
    return _universal(
        "UR10",
        (0.1273, 0.220941, -0.1719, 0.612, 0.5723, 0.1149, 0.1157, 0.0922),
        (
            Link(7.778, (0.0, 0.0, 0.0), (0.0314743125769, 0.0314743125769, 0.021875625)),
            Link(12.93, (0.0, 0.0, 0.306), (0.421753803798, 0.421753803798, 0.036365625)),
            Link(3.87, (0.0, 0.0, 0.28615), (0.111069694097, 0.111069694097, 0.010884375)),
            Link(1.96, (0.0, 0.0, 0.0), (0.0051082479567, 0.0051082479567, 0.0055125)),
            Link(1.96, (0.0, 0.0, 0.0), (0.0051082479567, 0.0051082479567, 0.0055125)),
            Link(0.202, (0.0, 0.0, 0.0), (0.000526462289415, 0.000526462289415, 0.000568125)),
        ),
        (330.0, 330.0, 150.0, 54.0, 54.0, 54.0),
        (2.16, 2.16, 3.15, 3.2, 3.2, 3.2),
        (0.075, 0.075, 0.075, 0.075, 0.045),
    )


def _universal(
    name: str, lengths: Sequence[float], links: Sequence[Link], efforts: Sequence[float], speeds: Sequence[float],
    radii: Sequence[float],
) -> Manipulator:  # fmt: skip
    shoulder, across, back, upper, fore, wrist1, wrist2, flange = lengths
    names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    origins = (
        (0.0, 0.0, shoulder), (0.0, across, 0.0), (0.0, back, upper), (0.0, 0.0, fore), (0.0, wrist1, 0.0),
        (0.0, 0.0, wrist2),
    )  # fmt: skip
    pitches, axes = (0.0, QUARTER, 0.0, QUARTER, 0.0, 0.0), ((0.0, 0.0, 1.0), UP_Y, UP_Y, UP_Y, (0.0, 0.0, 1.0), UP_Y)
    ends = (2 * HALF, 2 * HALF, HALF, 2 * HALF, 2 * HALF, 2 * HALF)
    shapes = universal_shapes(lengths, radii)
    joints = [
        Joint(
            f"{names[i]}_joint", origin=origins[i], rotation=(0.0, pitches[i], 0.0), axis=axes[i],
            link=replace(links[i], capsules=shapes[i]),
            lower=-ends[i], upper=ends[i], speed=speeds[i], effort=efforts[i],
        )
        for i in range(6)
    ]  # fmt: skip
    return serial(joints, tool=(0.0, flange, 0.0), tool_rotation=(-QUARTER, 0.0, 0.0), name=name)


def panda() -> Manipulator:
    """Return the Franka Emika Panda with its hand, fingers closed; the tool lies between the finger tips.

    Source: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano, A. De Luca, Dynamic identification of the Franka Emika
        Panda robot with retrieval of feasible parameters, IEEE Robotics and Automation Letters 4 (2019); the hand and
        the limits from the package franka_description of Franka Emika, file panda.urdf; capsules as `panda_shapes`
        says.
    """
    links = (
        Link(4.970684, (0.003875, 0.002081, -0.04762), (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169)),
        Link(0.646926, (-0.003141, -0.02872, 0.003495), (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704)),
        Link(3.228604, (0.027518, 0.039252, -0.066502), (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805)),
        Link(3.587895, (-0.05317, 0.104419, 0.027454), (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
        Link(
            1.225946, (-0.011953, 0.041065, -0.038437), (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)
        ),
        Link(1.666555, (0.060149, -0.014117, -0.010517), (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
        Link(
            1.495522,
            (0.0017208742976286562, 0.0013603544171612299, 0.1004852811486558),
            (
                0.016529853712634622, 0.014107248642161837, 0.006676955556640956, 0.000394892297119178,
                -0.0007066957106145018, -0.0010511053270467077,
            ),
        ),
    )  # fmt: skip
    origins = (
        (0.0, 0.0, 0.333), (0.0, 0.0, 0.0), (0.0, -0.316, 0.0), (0.0825, 0.0, 0.0), (-0.0825, 0.384, 0.0),
        (0.0, 0.0, 0.0), (0.088, 0.0, 0.0),
    )  # fmt: skip
    rolls = (0.0, -QUARTER, QUARTER, QUARTER, -QUARTER, QUARTER, QUARTER)
    lower = (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)
    upper = (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)
    shapes = panda_shapes()
    joints = [
        Joint(
            f"panda_joint{i + 1}", origin=origins[i], rotation=(rolls[i], 0.0, 0.0),
            link=replace(links[i], capsules=shapes[i]), lower=lower[i], upper=upper[i],
            speed=2.175 if i < 4 else 2.61, effort=87.0 if i < 4 else 12.0, damping=0.003,
        )
        for i in range(7)
    ]  # fmt: skip
    return serial(joints, tool=(0.0, 0.0, 0.2104), tool_rotation=(0.0, 0.0, -EIGHTH), name="Panda")


def manutec_r3(load: Value = 0.0) -> Manipulator:
    """Return the first three joints of the Manutec r3 with their rotors; that of joint 3 sits on arm 2.

    The efforts are those of 7.5 V at the motor amplifiers: 126, 252 and 72 N m for each volt.

    Args:
        load: point mass at the tool, 0.98 m from joint 3 [kg].

    Source: M. Otter, S. Tuerk, The DFVLR models 1 and 2 of the Manutec r3 robot, DFVLR-Mitteilung 88-13, 1988.
    """
    arm2 = Link(56.5, (0.172, 0.0, 0.205), (2.58, 2.73, 0.64, 0.0, -0.46, 0.0))
    arm3 = Link(60.3, (0.028, 0.0, 0.202), (5.41, 5.60, 0.39, 0.0, 0.33, 0.0))
    joints = [
        Joint(
            "q1", link=Link(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.16)), rotor=1.3e-3, gear=-105.0, lower=-2.97,
            upper=2.97, speed=3.0, effort=945.0,
        ),
        Joint(
            "q2", axis=UP_X, link=arm2, rotor=1.3e-3, gear=210.0, lower=-2.01, upper=2.01, speed=1.5, effort=1890.0
        ),
        Joint(
            "q3", axis=UP_X, origin=(0.0, 0.0, 0.5), link=arm3, rotor=1.3e-3, gear=60.0, carried=True, lower=-2.86,
            upper=2.86, speed=5.2, effort=540.0,
        ),
        Joint("load", Kind.FIXED, origin=(0.0, 0.0, 0.98), link=Link(load)),
    ]  # fmt: skip
    return serial(joints, name="Manutec r3")
