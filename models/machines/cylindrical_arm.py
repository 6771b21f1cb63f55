"""The manipulator in cylindrical coordinates."""

from __future__ import annotations

from functools import partial

import casadi as ca
import numpy as np

from models.machines.body_metrics import about_axis
from models.machines.frames import Frame, coordinate, fixed, ldl, udu
from models.machines.inertia import check_mass, check_moment
from models.machines.inverse_kinematics import NEAR, TINY, Configurations, wrapped
from models.machines.manipulator import Body, Coordinate, Drive, Manipulator, rotation, symbols
from models.machines.parameters import Default, lists_its_parameters, read, unit_of
from ocp import checks
from ocp.checks import Array


@lists_its_parameters
def cylindrical(
    *,
    A: Default = 0.15,
    m_2: Default = 45.0,
    m_3: Default = 20.0,
    Theta_1_33: Default = 3.0,
    Theta_2_33: Default = 1.5,
    Theta_3_33: Default = 1.2,
    l_T: Default = 0.5,
    physical: bool = True,
) -> Manipulator:
    """Return the manipulator in cylindrical coordinates, q = (phi, xi, r).

    T = 1/2 Theta_bar phi'^2 + 1/2 (m_2 + m_3) xi'^2 + 1/2 m_3 (r' + A phi')^2,  Theta_bar = J_0 + m_3 r^2,
    J_0 = Theta_1_33 + Theta_2_33 + Theta_3_33 + m_2 A^2 / 4

    phi turns the column about e_3, xi lifts the carriage, r extends the arm, which passes the axis at distance A.
    Drives: M_phi = tau_1 [N m], K_xi = tau_2 [N], K_r = tau_3 [N].

    Args:
        A: offset between the vertical axis and the line of the arm, either sign [m].
        m_2: mass of the carriage, its centre half way of the offset [kg].
        m_3: mass of the arm [kg].
        Theta_1_33: moment of inertia of the column about the vertical [kg m^2].
        Theta_2_33: of the carriage about the vertical through its mass centre [kg m^2].
        Theta_3_33: of the arm about the vertical through its mass centre [kg m^2].
        l_T: distance of the tool from the mass centre of the arm, along the arm [m].
        physical: False admits what no body has (massless, without inertia), for idealised arms.

    Raises:
        TypeError: a wrong name.
        ValueError: a value that is not finite, a mass or moment of inertia <= 0; the message names it.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, section 3.
    """
    numbers = dict(A=A, m_2=m_2, m_3=m_3, Theta_1_33=Theta_1_33, Theta_2_33=Theta_2_33, Theta_3_33=Theta_3_33, l_T=l_T)
    p = read(numbers, unit_of)
    checks.truth("physical", physical)
    if physical:
        for name in ("m_2", "m_3"):
            check_mass(name, p.nominal[name])
        for name in ("Theta_1_33", "Theta_2_33", "Theta_3_33"):
            check_moment(name, p.nominal[name])

    coordinates = (Coordinate("phi", "rad"), Coordinate("xi", "m"), Coordinate("r", "m"))
    q = symbols("q", coordinates)
    phi, xi, r = ca.vertsplit(q)
    offset, m2, m3 = p["A"], p["m_2"], p["m_3"]
    own_inertia = p["Theta_1_33"] + p["Theta_2_33"] + p["Theta_3_33"] + m2 * offset * offset / 4
    theta_bar = own_inertia + m3 * r**2

    matrix, inverse = ca.SX.eye(3), ca.SX.eye(3)
    matrix[2, 0], inverse[2, 0] = offset, -offset
    regular = Frame(
        "regular", q, ca.sparsify(matrix), ca.sparsify(inverse), ca.diag(ca.vertcat(theta_bar, m2 + m3, m3))
    )
    metric = regular.matrix.T @ regular.metric @ regular.matrix

    def paper(added: ca.SX) -> Frame:
        if p.nominal["A"] == 0.0:
            raise ValueError(
                "cylindrical: the frame 'paper', w = (-A phi', xi', A phi' + r'), is singular at A = 0; "
                "use frame='regular', which is orthogonal for every A"
            )
        rows = ca.vertcat(
            ca.horzcat(-offset, 0, 0),
            ca.horzcat(0, 1, 0),
            ca.horzcat(offset, 0, 1),
        )
        back = ca.vertcat(
            ca.horzcat(-1 / offset, 0, 0),
            ca.horzcat(0, 1, 0),
            ca.horzcat(1, 0, 1),
        )
        entries = ca.vertcat(theta_bar / (offset * offset), m2 + m3, m3)
        frame = Frame("paper", q, ca.sparsify(ca.SX(rows)), ca.sparsify(ca.SX(back)), ca.diag(entries), "A")
        return fixed(frame)(added)

    turned = rotation(2, phi)
    along, across = turned[:, 1], turned[:, 0]
    lift = ca.vertcat(0, 0, xi)
    arm = offset * across + r * along + lift
    return Manipulator(
        name="cylindrical",
        coordinates=coordinates,
        q=q,
        v=symbols("v", coordinates),
        tau=symbols("tau", coordinates),
        metric=metric,
        bodies=(
            Body("column", 0.0, ca.SX(3, 1), turned, about_axis(p["Theta_1_33"])),
            Body("carriage", m2, offset / 2 * across + lift, turned, about_axis(p["Theta_2_33"])),
            Body("arm", m3, arm, turned, about_axis(p["Theta_3_33"])),
        ),
        tool=arm + p["l_T"] * along,
        tool_metric=point_metric(offset, r + p["l_T"]),
        skeleton=ca.horzcat(ca.SX(3, 1), lift, offset * across + lift, arm + p["l_T"] * along),
        drives=(Drive("M_phi", 1), Drive("K_xi", 1), Drive("K_r", 1)),
        frames={
            "paper": paper,
            "regular": fixed(regular),
            "coordinate": coordinate(q, metric),
            "ldl": ldl(q, metric),
            "udu": udu(q, metric),
        },
        nominal=p.nominal,
        symbols=p.symbols,
        inertia={"phi": "Theta_1_33, Theta_2_33 or Theta_3_33", "xi": "m_2 or m_3", "r": "m_3"},
        inverse=partial(_inverse, p.nominal["A"], p.nominal["l_T"]),
    )


def _inverse(offset: float, beyond: float, points: Array) -> Configurations:
    """Return all q with the tool at points (K, 3): (A, r + l_T) turned by phi is (x, y), and xi = z."""
    x, y, z = points.T
    distance = np.hypot(x, y)
    scale = distance + abs(offset) + abs(beyond)
    square = (distance - abs(offset)) * (distance + abs(offset))
    along = np.sqrt(np.maximum(square, 0.0))
    free = distance <= TINY * scale
    solutions = []
    for side in (along, -along):
        phi = np.where(free, np.nan, wrapped(np.arctan2(y, x) - np.arctan2(side, offset)))
        solutions.append(np.stack([phi, z, side - beyond], axis=1))
    return Configurations(
        np.stack(solutions, axis=1),
        ("tool ahead of the axis, r + l_T >= 0", "tool behind the axis, r + l_T <= 0"),
        {"nearer to the vertical axis than the offset A": square < -TINY * scale**2},
        {"the arm ends at the foot of the offset, r + l_T = 0": along <= NEAR * scale},
    )


def point_metric(across: ca.SX | float, along: ca.SX) -> ca.SX:
    """Return the metric (3, 3) of a unit point mass at (across, along) of the vertical axis."""
    metric = ca.SX(3, 3)
    metric[0, 0], metric[1, 1], metric[2, 2] = across * across + along**2, 1, 1
    metric[0, 2] = metric[2, 0] = across
    return ca.sparsify(metric)
