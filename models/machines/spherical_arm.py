"""The manipulator in spherical coordinates."""

from __future__ import annotations

from functools import partial

import casadi as ca
import numpy as np

from models.machines.body_metrics import about_axis
from models.machines.frames import Frame, coordinate, fixed, ldl, udu
from models.machines.inertia import check_mass, check_moment, check_tensor
from models.machines.inverse_kinematics import NEAR, TINY, Configurations
from models.machines.manipulator import Body, Coordinate, Drive, Manipulator, rotation, symbols
from models.machines.parameters import Default, Follows, lists_its_parameters, read, unit_of
from ocp import checks
from ocp.checks import Array


@lists_its_parameters
def spherical(
    *,
    s_2: Default = 0.15,
    m_2: Default = 40.0,
    m_3: Default = 15.0,
    Theta_1_33: Default = 2.5,
    Theta_2_11: Default = 1.8,
    Theta_2_22: Default = 1.6,
    Theta_2_33: Default = 0.9,
    Theta_3_11: Default = 0.9,
    Theta_3_22: Default = Follows("Theta_3_11"),
    Theta_3_33: Default = 0.05,
    l_T: Default = 0.45,
    physical: bool = True,
) -> Manipulator:
    """Return the manipulator in spherical coordinates, q = (theta, psi, phi, r).

    T = 1/2 { g_11 theta'^2 + 2 g_12 theta' psi' + h psi'^2 + Theta_3_33 (phi' + cos(theta) psi')^2 + m_3 r'^2 }
    g_11 = Theta_2_11 + m_2 s_2^2 + m_3 r^2 + Theta_3_11 cos(phi)^2 + Theta_3_22 sin(phi)^2
    g_12 = 1/2 (Theta_3_11 - Theta_3_22) sin(2 phi) sin(theta)
    h = C + D sin(theta)^2,  C = Theta_1_33 + Theta_2_33
    D = Theta_2_22 - Theta_2_33 + m_2 s_2^2 + m_3 r^2 + Theta_3_11 sin(phi)^2 + Theta_3_22 cos(phi)^2

    psi turns the column about e_3, theta tilts the arm from the vertical (0: upwards), phi spins it about its own
    axis, r extends it. Drives: M_theta = -tau_1 (it acts along -theta), M_psi = tau_2, M_phi = tau_3 [N m],
    K_r = tau_4 [N].

    Args:
        s_2: distance of the mass centre of the swivelling body from the centre of rotation [m].
        m_2: mass of the swivelling body [kg].
        m_3: mass of the arm [kg].
        Theta_1_33: moment of inertia of the column about the vertical [kg m^2].
        Theta_2_11: principal moment of the swivelling body about the axis of theta, through its mass centre [kg m^2].
        Theta_2_22: of the swivelling body across that axis and the arm [kg m^2].
        Theta_2_33: of the swivelling body about the line of the arm [kg m^2].
        Theta_3_11, Theta_3_22: principal moments of the arm across its line, equal unless both are given [kg m^2].
        Theta_3_33: principal moment of the arm about its own line [kg m^2].
        l_T: distance of the tool from the mass centre of the arm [m].
        physical: False admits what no body has (massless, without inertia), for idealised arms.

    Raises:
        TypeError: a wrong name.
        ValueError: a value that is not finite, a mass <= 0, an inertia that no body has; the message names it.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, section 4, with the general T of 4.1.
    """
    checks.truth("physical", physical)
    p = read(
        dict(
            s_2=s_2, m_2=m_2, m_3=m_3, Theta_1_33=Theta_1_33,
            Theta_2_11=Theta_2_11, Theta_2_22=Theta_2_22, Theta_2_33=Theta_2_33,
            Theta_3_11=Theta_3_11, Theta_3_22=Theta_3_22, Theta_3_33=Theta_3_33, l_T=l_T,
        ),
        unit_of,
    )  # fmt: skip
    if physical:
        for name in ("m_2", "m_3"):
            check_mass(name, p.nominal[name])
        check_moment("Theta_1_33", p.nominal["Theta_1_33"])
        for body in (2, 3):
            check_tensor(body, p.nominal)

    coordinates = (
        Coordinate("theta", "rad"),
        Coordinate("psi", "rad"),
        Coordinate("phi", "rad"),
        Coordinate("r", "m"),
    )
    q = symbols("q", coordinates)
    theta, psi, phi, r = ca.vertsplit(q)
    s2, m2, m3, spin = p["s_2"], p["m_2"], p["m_3"], p["Theta_3_33"]
    mean, half_difference = (p["Theta_3_11"] + p["Theta_3_22"]) / 2, (p["Theta_3_11"] - p["Theta_3_22"]) / 2
    # For Theta_3_11 = Theta_3_22 the difference is the number 0, and CasADi drops every term that it multiplies.
    wobble = half_difference * ca.cos(2 * phi)
    radial = m3 * r**2
    g11 = (p["Theta_2_11"] + m2 * s2 * s2 + mean) + radial + wobble
    axial = p["Theta_1_33"] + p["Theta_2_33"]
    h = axial + ((p["Theta_2_22"] - p["Theta_2_33"] + m2 * s2 * s2 + mean) + radial - wobble) * ca.sin(theta) ** 2
    g12 = half_difference * ca.sin(2 * phi) * ca.sin(theta)
    slope = g12 / g11
    entries = ca.diag(ca.vertcat(g11, h - g12 * slope, spin, m3))

    matrix, inverse = ca.SX.eye(4), ca.SX.eye(4)
    matrix[2, 1], inverse[2, 1] = ca.cos(theta), -ca.cos(theta)
    metric_without_wobble = matrix.T @ ca.diag(ca.vertcat(g11, h, spin, m3)) @ matrix
    matrix[0, 1], inverse[0, 1] = slope, -slope
    regular = Frame("regular", q, ca.sparsify(matrix), ca.sparsify(inverse), entries)
    coupled = ca.SX(4, 4)
    coupled[0, 1] = coupled[1, 0] = g12
    metric = metric_without_wobble + ca.sparsify(coupled)

    # The frame of Maisser's paper takes sin(theta) psi', the speed across the arm, for psi': singular at theta = 0, pi.
    sine, cosine = ca.sin(theta), ca.cos(theta)
    stretched, restored = ca.SX(regular.matrix), ca.SX(regular.inverse)
    stretched[1, 1] = sine
    restored[0, 1], restored[1, 1], restored[2, 1] = -slope / sine, 1 / sine, -cosine / sine
    widened = ca.SX(entries)
    widened[1, 1] = entries[1, 1] / sine**2
    paper = Frame("paper", q, ca.sparsify(stretched), ca.sparsify(restored), widened, "sin(theta)")

    tilted = rotation(2, psi) @ rotation(0, -theta)
    direction = tilted[:, 2]
    tool_squared = (r + p["l_T"]) ** 2
    return Manipulator(
        name="spherical",
        coordinates=coordinates,
        q=q,
        v=symbols("v", coordinates),
        tau=symbols("tau", coordinates),
        metric=metric,
        bodies=(
            Body("column", 0.0, ca.SX(3, 1), rotation(2, psi), about_axis(p["Theta_1_33"])),
            Body("swivel", m2, s2 * direction, tilted, _principal(p["Theta_2_11"], p["Theta_2_22"], p["Theta_2_33"])),
            Body(
                "arm",
                m3,
                r * direction,
                tilted @ rotation(2, phi),
                _principal(p["Theta_3_11"], p["Theta_3_22"], p["Theta_3_33"]),
            ),
        ),
        tool=(r + p["l_T"]) * direction,
        tool_metric=ca.sparsify(ca.diag(ca.vertcat(tool_squared, tool_squared * sine**2, 0, 1))),
        skeleton=ca.horzcat(ca.SX(3, 1), s2 * direction, r * direction, (r + p["l_T"]) * direction),
        drives=(Drive("M_theta", -1), Drive("M_psi", 1), Drive("M_phi", 1), Drive("K_r", 1)),
        frames={
            "paper": fixed(paper),
            "regular": fixed(regular),
            "coordinate": coordinate(q, metric),
            "ldl": ldl(q, metric),
            "udu": udu(q, metric),
        },
        nominal=p.nominal,
        symbols=p.symbols,
        inertia={"theta": "Theta_2_11", "psi": "Theta_1_33 or Theta_2_33", "phi": "Theta_3_33", "r": "m_3"},
        inverse=partial(_inverse, p.nominal["l_T"]),
    )


def _inverse(beyond: float, points: Array) -> Configurations:
    """Return all q with the tool at points (K, 3) = (r + l_T) n(theta, psi); phi is free."""
    x, y, z = points.T
    across, distance = np.hypot(x, y), np.linalg.norm(points, axis=1)
    scale = distance + abs(beyond)
    vertical, centre = across <= TINY * scale, distance <= TINY * scale
    free = np.full(len(points), np.nan)
    solutions, branches = [], []
    for side, ahead in ((1.0, "r + l_T >= 0"), (-1.0, "r + l_T <= 0")):
        for tilt, leaning in ((1.0, "theta >= 0"), (-1.0, "theta <= 0")):
            branches.append(f"{ahead}, {leaning}")
            theta = np.where(centre, np.nan, tilt * np.arctan2(across, side * z))
            psi = np.where(vertical, np.nan, np.arctan2(-side * tilt * x, side * tilt * y))
            solutions.append(np.stack([theta, psi, free, side * distance - beyond], axis=1))
    return Configurations(
        np.stack(solutions, axis=1),
        tuple(branches),
        {},
        {
            "the tool on the vertical axis, psi is free": across <= NEAR * scale,
            "the tool at the centre of rotation, theta and psi are free": distance <= NEAR * scale,
        },
    )


def _principal(*moments: ca.SX | float) -> ca.SX:
    return ca.diag(ca.vertcat(*(ca.SX(moment) for moment in moments)))
