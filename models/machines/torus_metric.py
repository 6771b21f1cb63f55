"""Metric and frames of the torus-like manipulator, from its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.frames import Frame, coordinate, fixed, ldl, udu
from models.machines.parameters import Parameters

Entry = ca.SX | float


@dataclass(frozen=True, eq=False)
class TorusMetric:
    """Entries of the metric without effects.

    T = 1/2 g11 q1'^2 + q1' (t2 alpha' + t3 beta') + 1/2 (I2 alpha'^2 + I3 beta'^2) + half alpha' beta'
    """

    q: ca.SX  # (3,) coordinates; alpha = q2, beta = q2 + q3
    inertia2: Entry  # I2 [kg m^2]
    inertia3: Entry  # I3
    g11: ca.SX
    t2: ca.SX
    t3: ca.SX
    half: ca.SX  # kappa cos(q3) / 2
    kappa: Entry
    cosine: ca.SX  # cos(q3)

    @classmethod
    def of(cls, p: Parameters, q: ca.SX) -> TorusMetric:
        """Return the entries for the parameters of `torus`.

        Raises:
            ValueError: no inertia turns about joint 2 or 3 at any position.
        """
        m2, m3, length2, length3, offset = p["m_2"], p["m_3"], p["L_2"], p["L_3"], p["B"]
        alpha, beta, c3 = q[1], q[1] + q[2], ca.cos(q[2])
        inertia2 = p["Theta_2_22"] + m2 * length2**2 / 4 + m3 * length2**2
        inertia3 = p["Theta_3_22"] + m3 * length3**2 / 4
        for joint, own, inertia in (("q2", "Theta_2_22", inertia2), ("q3", "Theta_3_22", inertia3)):
            if not isinstance(inertia, ca.SX) and inertia <= 0.0:
                raise ValueError(
                    f"torus: no inertia turns about {joint}; give {own} or the masses beyond it a value > 0"
                )
        kappa = m3 * length2 * length3
        b1 = p["Theta_1_33"] + p["Theta_2_11"] + p["Theta_3_11"] + (m2 + m3) * offset**2
        b2 = p["Theta_2_33"] - p["Theta_2_11"] + m2 * length2**2 / 4 + m3 * length2**2
        b3 = p["Theta_3_33"] - p["Theta_3_11"] + m3 * length3**2 / 4
        c_alpha, c_beta = ca.cos(alpha), ca.cos(beta)
        t2 = ((m2 / 2 + m3) * offset * length2 - p["Theta_2_12"]) * ca.sin(alpha) - p["Theta_2_23"] * c_alpha
        t3 = (m3 / 2 * offset * length3 - p["Theta_3_12"]) * ca.sin(beta) - p["Theta_3_23"] * c_beta
        g11 = b1 + b2 * c_alpha**2 + b3 * c_beta**2 + kappa * c_alpha * c_beta
        g11 = g11 + p["Theta_2_13"] * ca.sin(2 * alpha) + p["Theta_3_13"] * ca.sin(2 * beta)
        return cls(q, inertia2, inertia3, g11, t2, t3, kappa * c3 / 2, kappa, c3)

    @property
    def matrix(self) -> ca.SX:
        """(3, 3) metric in the coordinates q1, q2, q3."""
        i2, i3, half = self.inertia2, self.inertia3, self.half
        return symmetric(self.g11, self.t2 + self.t3, self.t3, i2 + i3 + 2 * half, i3 + half, ca.SX(i3))


def torus_frames(own: TorusMetric, p: Parameters) -> dict[str, Callable[[ca.SX], Frame]]:
    """Return the frames of the machine by name: `regular`, `arrow`, and the two roots of (5.5).

    Args:
        own: metric without effects.
        p: parameters of `torus`.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (5.4)-(5.6).
    """
    q, inertia2, inertia3, t2, t3, g11 = own.q, own.inertia2, own.inertia3, own.t2, own.t3, own.g11
    sigma = ca.sqrt(inertia2 / inertia3)
    above = (inertia2 - inertia3) / (inertia3 * (1 + sigma))  # sigma - 1 without cancellation
    metric = own.matrix

    swing = sigma * own.kappa * own.cosine
    minus, plus = 2 * inertia2 - swing, 2 * inertia2 + swing
    h2, h3 = t2 - sigma * t3, t2 + sigma * t3
    back = _pair(1, 1, -(1 + sigma), above)
    forth = _pair(above / sigma / 2, -1 / sigma / 2, (1 + 1 / sigma) / 2, 1 / sigma / 2)
    regular = Frame("regular", q, forth, back, symmetric(g11, h2, h3, minus, ca.SX(0), plus))

    r2, r3 = h2 / minus, h3 / plus
    bent, unbent = ca.SX(forth), ca.SX.eye(3)
    bent[1, 0], bent[2, 0], unbent[1, 0], unbent[2, 0] = r2, r3, -r2, -r3
    diagonal = ca.diag(ca.vertcat(g11 - h2 * r2 - h3 * r3, minus, plus))
    arrow = Frame("arrow", q, ca.sparsify(bent), back @ ca.sparsify(unbent), diagonal)

    def root(name: str, a: Entry, d: Entry, delta: Entry, pair: tuple[ca.SX, ca.SX]) -> Frame:
        """Return the frame v = S w with alpha' = a w2 + w3, beta' - alpha' = w2 + d w3, and a d - 1 = delta."""
        forward = _pair(d / delta, -1 / delta, -1 / delta, a / delta)
        entries = symmetric(g11, a * t2 + (1 + a) * t3, t2 + (1 + d) * t3, pair[0], ca.SX(0), pair[1])
        return Frame(name, q, forward, _pair(a, 1, 1, d), entries, "B_c" if name == "paper" else "")

    def paper(added: ca.SX) -> Frame:
        n = p.nominal
        second = n["Theta_2_22"] + n["m_2"] * n["L_2"] ** 2 / 4 + n["m_3"] * n["L_2"] ** 2
        third = n["Theta_3_22"] + n["m_3"] * n["L_3"] ** 2 / 4
        if abs(second - third) <= 4.0 * np.finfo(float).eps * third:
            raise ValueError(
                "torus: the frame 'paper' of (5.5) is singular at I_2 = I_3 (B_c = 0, its constant a is infinite); "
                "use frame='regular', which exists for all parameters"
            )
        return fixed(root("paper", 1 / above, -(1 + sigma), -2 * sigma / above, (plus / above**2, minus)))(added)

    short = 1 + sigma
    other = root("other_root", -1 / short, above, -2 * sigma / short, (minus / short**2, plus))
    return {
        "paper": paper,
        "regular": fixed(regular),
        "ldl": ldl(q, metric),
        "udu": udu(q, metric),
        "coordinate": coordinate(q, metric),
        "arrow": fixed(arrow),
        "other_root": fixed(other),
    }


def torus_point_metric(offset: ca.SX | float, inner: ca.SX | float, outer: ca.SX | float, q: ca.SX) -> ca.SX:
    """Return the metric (3, 3) of a unit point mass at the end of links of lengths inner and outer."""
    alpha, beta = q[1], q[1] + q[2]
    t2, t3 = offset * inner * ca.sin(alpha), offset * outer * ca.sin(beta)
    half = inner * outer * ca.cos(q[2])
    g11 = offset * offset + (inner * ca.cos(alpha) + outer * ca.cos(beta)) ** 2
    g22 = inner * inner + outer * outer + 2 * half
    return symmetric(g11, ca.SX(t2 + t3), ca.SX(t3), g22, outer * outer + half, ca.SX(outer * outer))


def symmetric(g11: ca.SX, g12: ca.SX, g13: ca.SX, g22: ca.SX, g23: ca.SX, g33: ca.SX) -> ca.SX:
    """Return the symmetric matrix (3, 3) of its upper triangle."""
    rows = ((g11, g12, g13), (g12, g22, g23), (g13, g23, g33))
    return ca.sparsify(ca.vertcat(*(ca.horzcat(*row) for row in rows)))


def _pair(a: ca.SX | float, b: ca.SX | float, c: ca.SX | float, d: ca.SX | float) -> ca.SX:
    """Return [[1, 0, 0], [0, a, b], [0, c, d]]."""
    matrix = ca.SX(3, 3)
    matrix[0, 0], matrix[1, 1], matrix[1, 2], matrix[2, 1], matrix[2, 2] = 1, a, b, c, d
    return ca.sparsify(matrix)
