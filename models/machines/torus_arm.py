"""The manipulator in torus-like coordinates (an articulated arm)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import casadi as ca
import numpy as np

from models.machines.body_metrics import about_axis
from models.machines.frames import Frame, coordinate, fixed, ldl, udu
from models.machines.inertia import check_mass, check_moment, check_tensor
from models.machines.inverse_kinematics import NEAR, TINY, Configurations, wrapped
from models.machines.manipulator import Body, Coordinate, Drive, Manipulator, rotation, symbols
from models.machines.parameters import Default, Follows, Parameters, lists_its_parameters, read, unit_of
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
        L_2, L_3: lengths of the links, mass centres half way [m].
        B: offset of the arm plane from the vertical axis [m].
        m_2, m_3: masses of the links [kg].
        Theta_1_33: moment of inertia of the column about the vertical [kg m^2].
        Theta_2_11, Theta_2_22, Theta_2_33, Theta_2_12, Theta_2_13, Theta_2_23: tensor of link 2 about its mass
            centre; off-diagonal entries are tensor components, minus the products of inertia [kg m^2].
        Theta_3_11, Theta_3_22, Theta_3_33, Theta_3_12, Theta_3_13, Theta_3_23: of link 3 [kg m^2].
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
    metric, frames = _metric_and_frames(p, q)
    return Manipulator(
        name="torus",
        coordinates=coordinates,
        q=q,
        v=symbols("v", coordinates),
        tau=symbols("tau", coordinates),
        metric=metric,
        bodies=(
            Body("column", 0.0, ca.SX(3, 1), turned, about_axis(p["Theta_1_33"])),
            Body("link 2", m2, shoulder + length2 / 2 * second[:, 0], second, _tensor(p, 2)),
            Body("link 3", m3, end, third, _tensor(p, 3)),
        ),
        tool=end + p["l_T"] * third[:, 0],
        tool_metric=_point_metric(offset, length2, length3 / 2 + p["l_T"], q),
        skeleton=ca.horzcat(ca.SX(3, 1), shoulder, elbow, end + p["l_T"] * third[:, 0]),
        drives=(Drive("M_1", 1), Drive("M_2", -1), Drive("M_3", -1)),
        frames=frames,
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
    """Return all q with the tool at points (K, 3): (h, B) turned by q1 is (x, y), and two links reach (h, z)."""
    x, y, z = points.T
    distance = np.hypot(x, y)
    square = (distance - abs(offset)) * (distance + abs(offset))
    ahead = np.sqrt(np.maximum(square, 0.0))
    reach = np.hypot(ahead, z)
    scale = distance + np.abs(z) + inner + abs(outer)
    beyond_reach = (inner + abs(outer) - reach) * (inner + abs(outer) + reach)
    within = (reach - abs(inner - abs(outer))) * (reach + abs(inner - abs(outer)))
    # tan(q3 / 2)^2 from the two differences keeps its digits where the arm is stretched or folded.
    bend = 2.0 * np.arctan2(np.sqrt(np.maximum(beyond_reach, 0.0)), np.sqrt(np.maximum(within, 0.0)))
    bend = bend if outer >= 0.0 else np.pi - bend
    on_axis, at_shoulder = distance <= TINY * scale, reach <= TINY * scale
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
            "farther than the stretched arm reaches": beyond_reach < -TINY * scale**2,
            "nearer to the shoulder than the folded arm reaches": within < -TINY * scale**2,
        },
        {
            "the arm is stretched, q3 = 0": beyond_reach <= NEAR * scale**2,
            "the arm is folded, q3 = pi": within <= NEAR * scale**2,
            "the tool above the shoulder, h = 0, q1 is free or turns back": ahead <= NEAR * scale,
        },
    )


def _metric_and_frames(p: Parameters, q: ca.SX) -> tuple[ca.SX, dict[str, Callable[[ca.SX], Frame]]]:
    m2, m3, length2, length3, offset = p["m_2"], p["m_3"], p["L_2"], p["L_3"], p["B"]
    alpha, beta, c3 = q[1], q[1] + q[2], ca.cos(q[2])
    inertia2 = p["Theta_2_22"] + m2 * length2**2 / 4 + m3 * length2**2
    inertia3 = p["Theta_3_22"] + m3 * length3**2 / 4
    for joint, own, inertia in (("q2", "Theta_2_22", inertia2), ("q3", "Theta_3_22", inertia3)):
        if not isinstance(inertia, ca.SX) and inertia <= 0.0:
            raise ValueError(f"torus: no inertia turns about {joint}; give {own} or the masses beyond it a value > 0")
    kappa = m3 * length2 * length3
    sigma = ca.sqrt(inertia2 / inertia3)
    above = (inertia2 - inertia3) / (inertia3 * (1 + sigma))  # sigma - 1 without cancellation
    b1 = p["Theta_1_33"] + p["Theta_2_11"] + p["Theta_3_11"] + (m2 + m3) * offset**2
    b2 = p["Theta_2_33"] - p["Theta_2_11"] + m2 * length2**2 / 4 + m3 * length2**2
    b3 = p["Theta_3_33"] - p["Theta_3_11"] + m3 * length3**2 / 4
    c_alpha, c_beta = ca.cos(alpha), ca.cos(beta)
    t2 = ((m2 / 2 + m3) * offset * length2 - p["Theta_2_12"]) * ca.sin(alpha) - p["Theta_2_23"] * c_alpha
    t3 = (m3 / 2 * offset * length3 - p["Theta_3_12"]) * ca.sin(beta) - p["Theta_3_23"] * c_beta
    g11 = b1 + b2 * c_alpha**2 + b3 * c_beta**2 + kappa * c_alpha * c_beta
    g11 = g11 + p["Theta_2_13"] * ca.sin(2 * alpha) + p["Theta_3_13"] * ca.sin(2 * beta)
    half = kappa * c3 / 2
    metric = _symmetric(g11, t2 + t3, t3, inertia2 + inertia3 + 2 * half, inertia3 + half, ca.SX(inertia3))

    swing = sigma * kappa * c3
    minus, plus = 2 * inertia2 - swing, 2 * inertia2 + swing
    h2, h3 = t2 - sigma * t3, t2 + sigma * t3
    back = _pair(1, 1, -(1 + sigma), above)
    forth = _pair(above / sigma / 2, -1 / sigma / 2, (1 + 1 / sigma) / 2, 1 / sigma / 2)
    regular = Frame("regular", q, forth, back, _symmetric(g11, h2, h3, minus, ca.SX(0), plus))

    r2, r3 = h2 / minus, h3 / plus
    bent, unbent = ca.SX(forth), ca.SX.eye(3)
    bent[1, 0], bent[2, 0], unbent[1, 0], unbent[2, 0] = r2, r3, -r2, -r3
    diagonal = ca.diag(ca.vertcat(g11 - h2 * r2 - h3 * r3, minus, plus))
    arrow = Frame("arrow", q, ca.sparsify(bent), back @ ca.sparsify(unbent), diagonal)

    def root(
        name: str, a: ca.SX | float, d: ca.SX | float, delta: ca.SX | float, g22: ca.SX, g33: ca.SX, vanishes: str = ""
    ) -> Frame:
        coupled2, coupled3 = a * t2 + (1 + a) * t3, t2 + (1 + d) * t3
        forward = _pair(d / delta, -1 / delta, -1 / delta, a / delta)
        own = _symmetric(g11, coupled2, coupled3, g22, ca.SX(0), g33)
        return Frame(name, q, forward, _pair(a, 1, 1, d), own, vanishes)

    def paper(added: ca.SX) -> Frame:
        n = p.nominal
        second = n["Theta_2_22"] + n["m_2"] * n["L_2"] ** 2 / 4 + n["m_3"] * n["L_2"] ** 2
        third = n["Theta_3_22"] + n["m_3"] * n["L_3"] ** 2 / 4
        if abs(second - third) <= 4.0 * np.finfo(float).eps * third:
            raise ValueError(
                "torus: the frame 'paper' of (5.5) is singular at I_2 = I_3 (B_c = 0, its constant a is infinite); "
                "use frame='regular', which exists for all parameters"
            )
        return fixed(root("paper", 1 / above, -(1 + sigma), -2 * sigma / above, plus / above**2, minus, "B_c"))(added)

    short = 1 + sigma
    other = root("other_root", -1 / short, above, -2 * sigma / short, minus / short**2, plus)
    frames = {
        "paper": paper,
        "regular": fixed(regular),
        "ldl": ldl(q, metric),
        "udu": udu(q, metric),
        "coordinate": coordinate(q, metric),
        "arrow": fixed(arrow),
        "other_root": fixed(other),
    }
    return metric, frames


def _point_metric(offset: ca.SX | float, inner: ca.SX | float, outer: ca.SX | float, q: ca.SX) -> ca.SX:
    """Return the metric (3, 3) of a unit point mass at the end of links of lengths inner and outer."""
    alpha, beta = q[1], q[1] + q[2]
    t2, t3 = offset * inner * ca.sin(alpha), offset * outer * ca.sin(beta)
    half = inner * outer * ca.cos(q[2])
    g11 = offset * offset + (inner * ca.cos(alpha) + outer * ca.cos(beta)) ** 2
    g22 = inner * inner + outer * outer + 2 * half
    return _symmetric(g11, ca.SX(t2 + t3), ca.SX(t3), g22, outer * outer + half, ca.SX(outer * outer))


def _symmetric(g11: ca.SX, g12: ca.SX, g13: ca.SX, g22: ca.SX, g23: ca.SX, g33: ca.SX) -> ca.SX:
    rows = ((g11, g12, g13), (g12, g22, g23), (g13, g23, g33))
    return ca.sparsify(ca.vertcat(*(ca.horzcat(*row) for row in rows)))


def _pair(a: ca.SX | float, b: ca.SX | float, c: ca.SX | float, d: ca.SX | float) -> ca.SX:
    """Return [[1, 0, 0], [0, a, b], [0, c, d]]."""
    matrix = ca.SX(3, 3)
    matrix[0, 0], matrix[1, 1], matrix[1, 2], matrix[2, 1], matrix[2, 2] = 1, a, b, c, d
    return ca.sparsify(matrix)


def _tensor(p: Parameters, body: int) -> ca.SX:
    entries = [p[f"Theta_{body}_{ij}"] for ij in ("11", "12", "13", "22", "23", "33")]
    return _symmetric(*(ca.SX(entry) for entry in entries))
