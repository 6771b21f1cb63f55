"""The manipulator in torus-like coordinates (an articulated arm)."""

from __future__ import annotations

from functools import partial

import casadi as ca
import numpy as np

from models.machines.body_metrics import about_axis
from models.machines.inertia import check_mass, check_moment, check_tensor
from models.machines.inverse_kinematics import NEAR, TINY, Configurations, wrapped
from models.machines.manipulator import Body, Coordinate, Drive, Manipulator, rotation, symbols
from models.machines.parameters import Default, Follows, Parameters, lists_its_parameters, read, unit_of
from models.machines.torus_metric import TorusMetric, symmetric, torus_frames, torus_point_metric
from ocp import checks
from ocp.checks import Array


@lists_its_parameters
def torus(
    *,
    L_2: Default = 0.7,
    L_3: Default = 0.8,
    B: Default = 0.0,
    m_2: Default = 25.0,
    m_3: Default = 18.0,
    Theta_1_33: Default = 2.5,
    Theta_2_11: Default = 0.15,
    Theta_2_22: Default = 1.1,
    Theta_2_33: Default = 1.1,
    Theta_2_12: Default = 0.0,
    Theta_2_13: Default = 0.0,
    Theta_2_23: Default = 0.0,
    Theta_3_11: Default = 0.08,
    Theta_3_22: Default = 1.0,
    Theta_3_33: Default = 1.0,
    Theta_3_12: Default = 0.0,
    Theta_3_13: Default = 0.0,
    Theta_3_23: Default = 0.0,
    l_T: Default = Follows("L_3", 0.5),
    physical: bool = True,
) -> Manipulator:
    """Return the manipulator in torus-like coordinates, q = (q1, q2, q3).

    T = 1/2 g_11 q1'^2 + q1' (t_2 alpha' + t_3 beta') + 1/2 (I_2 alpha'^2 + I_3 beta'^2 + kappa cos(q3) alpha' beta')
    alpha = q2, beta = q2 + q3,  I_2 = Theta_2_22 + (m_2/4 + m_3) L_2^2,  I_3 = Theta_3_22 + m_3 L_3^2 / 4
    kappa = m_3 L_2 L_3, and g_11(alpha, beta), t_2(alpha), t_3(beta) from B and the inertia tensors

    q1 turns the column about e_3, q2 raises link 2 from the horizontal, q3 is the angle from link 2 to link 3. Axis 1
    of a link runs along it, axis 2 is the joint axis. Drives: M_1 = tau_1, M_2 = -tau_2, M_3 = -tau_3 [N m].

    Frames: `regular` is the constant sum/difference frame, w_{2,3} = (alpha' -+ beta' / sigma) / 2 with
    sigma = sqrt(I_2 / I_3), orthogonal for B = 0 and diagonal inertia; `arrow` continues it orthogonally to the
    general case; `paper` and `other_root` are the two roots of (5.5) in the same directions.

    Args:
        L_2: length of link 2, its mass centre half way [m].
        L_3: length of link 3, its mass centre half way [m].
        B: offset of the arm plane from the vertical axis [m].
        m_2: mass of link 2, the one on the column [kg].
        m_3: mass of link 3 [kg].
        Theta_1_33: moment of inertia of the column about the vertical [kg m^2].
        Theta_2_11: moment of inertia of link 2 about its own line [kg m^2].
        Theta_2_22: of link 2 about the axis of its joint, through its mass centre [kg m^2].
        Theta_2_33: of link 2 about the third axis, across both [kg m^2].
        Theta_2_12, Theta_2_13, Theta_2_23: minus the products of inertia of link 2, in these axes [kg m^2].
        Theta_3_11: moment of inertia of link 3 about its own line [kg m^2].
        Theta_3_22: of link 3 about the axis of its joint, through its mass centre [kg m^2].
        Theta_3_33: of link 3 about the third axis, across both [kg m^2].
        Theta_3_12, Theta_3_13, Theta_3_23: minus the products of inertia of link 3, in these axes [kg m^2].
        l_T: distance of the tool from the mass centre of link 3; the end of the link unless given [m].
        physical: False admits what no body has (massless, without inertia), for idealised arms.

    Raises:
        TypeError: a wrong name.
        ValueError: a value that is not finite, a length or mass <= 0, an inertia that no body has.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, section 5.
    """
    checks.truth("physical", physical)
    p = read(
        dict(
            L_2=L_2, L_3=L_3, B=B, m_2=m_2, m_3=m_3, Theta_1_33=Theta_1_33,
            Theta_2_11=Theta_2_11, Theta_2_22=Theta_2_22, Theta_2_33=Theta_2_33,
            Theta_2_12=Theta_2_12, Theta_2_13=Theta_2_13, Theta_2_23=Theta_2_23,
            Theta_3_11=Theta_3_11, Theta_3_22=Theta_3_22, Theta_3_33=Theta_3_33,
            Theta_3_12=Theta_3_12, Theta_3_13=Theta_3_13, Theta_3_23=Theta_3_23, l_T=l_T,
        ),
        unit_of,
    )  # fmt: skip
    for name in ("L_2", "L_3"):
        if p.nominal[name] <= 0.0:
            raise ValueError(f"{name}: got {p.nominal[name]:g} m, expected a length > 0")
    if physical:
        for name in ("m_2", "m_3"):
            check_mass(name, p.nominal[name])
        check_moment("Theta_1_33", p.nominal["Theta_1_33"])
        for body in (2, 3):
            check_tensor(body, p.nominal)

    coordinates = tuple(Coordinate(name, "rad") for name in ("q1", "q2", "q3"))
    q = symbols("q", coordinates)
    q1, q2, q3 = ca.vertsplit(q)
    alpha, beta = q2, q2 + q3
    m2, m3, length2, length3, offset = p["m_2"], p["m_3"], p["L_2"], p["L_3"], p["B"]

    turned = rotation(2, q1)
    second, third = turned @ rotation(1, -alpha), turned @ rotation(1, -beta)
    shoulder = offset * turned[:, 1]
    elbow = shoulder + length2 * second[:, 0]
    end = elbow + length3 / 2 * third[:, 0]
    metric = TorusMetric.of(p, q)
    return Manipulator(
        name="torus",
        coordinates=coordinates,
        q=q,
        v=symbols("v", coordinates),
        tau=symbols("tau", coordinates),
        metric=metric.matrix,
        bodies=(
            Body("column", 0.0, ca.SX(3, 1), turned, about_axis(p["Theta_1_33"])),
            Body("link 2", m2, shoulder + length2 / 2 * second[:, 0], second, _tensor(p, 2)),
            Body("link 3", m3, end, third, _tensor(p, 3)),
        ),
        tool=end + p["l_T"] * third[:, 0],
        tool_metric=torus_point_metric(offset, length2, length3 / 2 + p["l_T"], q),
        skeleton=ca.horzcat(ca.SX(3, 1), shoulder, elbow, end + p["l_T"] * third[:, 0]),
        drives=(Drive("M_1", 1), Drive("M_2", -1), Drive("M_3", -1)),
        frames=torus_frames(metric, p),
        nominal=p.nominal,
        symbols=p.symbols,
        inertia={
            "q1": "Theta_1_33, Theta_2_11 or Theta_3_11",
            "q2": "Theta_2_22 or Theta_3_22",
            "q3": "Theta_2_22 or Theta_3_22",
        },
        inverse=partial(_inverse, p.nominal["B"], p.nominal["L_2"], p.nominal["L_3"] / 2 + p.nominal["l_T"]),
    )


def _inverse(offset: float, inner: float, outer: float, points: Array) -> Configurations:
    """Return all q with the tool at points (K, 3): (h, B) turned by q1 is (x, y), and the two links end at (h, z)."""
    x, y, z = points.T
    radius = np.hypot(x, y)
    square = (radius - abs(offset)) * (radius + abs(offset))
    ahead = np.sqrt(np.maximum(square, 0.0))
    distance = np.hypot(ahead, z)
    scale = radius + np.abs(z) + inner + abs(outer)
    beyond_stretched = (inner + abs(outer) - distance) * (inner + abs(outer) + distance)
    within = (distance - abs(inner - abs(outer))) * (distance + abs(inner - abs(outer)))
    # tan(q3 / 2)^2 from the two differences keeps its digits where the arm is stretched or folded.
    bend = 2.0 * np.arctan2(np.sqrt(np.maximum(beyond_stretched, 0.0)), np.sqrt(np.maximum(within, 0.0)))
    bend = bend if outer >= 0.0 else np.pi - bend
    on_axis, at_shoulder = radius <= TINY * scale, distance <= TINY * scale
    solutions = []
    for h in (ahead, -ahead):
        for q3 in (bend, -bend):
            q1 = np.where(on_axis, np.nan, wrapped(np.arctan2(y, x) - np.arctan2(offset, h)))
            q2 = wrapped(np.arctan2(z, h) - np.arctan2(outer * np.sin(q3), inner + outer * np.cos(q3)))
            solutions.append(np.stack([q1, np.where(at_shoulder, np.nan, q2), q3], axis=1))
    return Configurations(
        np.stack(solutions, axis=1),
        ("ahead, q3 >= 0", "ahead, q3 <= 0", "behind, q3 >= 0", "behind, q3 <= 0"),
        {
            "nearer to the vertical axis than the offset B": square < -TINY * scale**2,
            "farther than the stretched arm reaches": beyond_stretched < -TINY * scale**2,
            "nearer to the shoulder than the folded arm reaches": within < -TINY * scale**2,
        },
        {
            "the arm is stretched, q3 = 0": beyond_stretched <= NEAR * scale**2,
            "the arm is folded, q3 = pi": within <= NEAR * scale**2,
            "the tool above the shoulder, h = 0, q1 is free or turns back": ahead <= NEAR * scale,
        },
    )


def _tensor(p: Parameters, body: int) -> ca.SX:
    entries = [p[f"Theta_{body}_{ij}"] for ij in ("11", "12", "13", "22", "23", "33")]
    return symmetric(*(ca.SX(entry) for entry in entries))
