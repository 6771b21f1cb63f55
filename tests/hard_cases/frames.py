"""Frames near their degeneracies: accelerations in every form against 60 digits, and refusals where a frame ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from hard_cases.reference import GRAVITY, accelerations
from models import Manipulator, cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from ocp.checks import Array

FORMS = (lagrange, hamel, canonical)
# A component may lose a thousand roundings, each weighted with the condition number of the accelerations themselves.
ROUNDINGS = 1e3 * float(np.finfo(float).eps)
DECADES = tuple(10.0**-k for k in range(13))
Poses = Sequence[tuple[Array, Array, Array]]


def errors(machine: Manipulator, frame: str, poses: Poses) -> tuple[float, float]:
    """Return the worst error of the accelerations over forms and poses and the condition number there.

    The error is relative to each component and divided by the condition number of that component.

    Args:
        machine: of numbers.
        frame: its name.
        poses: q, v, tau, each (n,).
    """
    worst, condition = 0.0, 1.0
    exact = [accelerations(machine.name, machine.nominal, *pose) for pose in poses]
    basis = machine.frame(frame)
    for form in FORMS:
        system = form(machine, [Gravity(GRAVITY)], frame)
        third = machine.v if form is lagrange else basis.matrix @ machine.v
        third = basis.metric @ third if form is canonical else third
        start = ca.Function("start", [machine.q, machine.v], [ca.densify(third)])
        moved = ca.densify(ca.jtimes(system["v"], system.x, system.rate))
        function = ca.Function("a", [system.x, system.u], [moved])
        for (q, v, tau), (a, kappa) in zip(poses, exact, strict=True):
            got = np.array(function(np.append(q, np.array(start(q, v)).ravel()), tau)).ravel()
            relative = np.abs(got - a) / np.maximum(np.abs(a), np.finfo(float).tiny) / kappa
            relative[np.isnan(relative)] = np.inf
            index = int(np.argmax(relative))
            if not relative[index] <= worst:
                worst, condition = float(relative[index]), float(kappa[index])
    return worst, condition


def refused(machine: Manipulator, frame: str, words: str) -> str:
    """Return what every form says when it refuses a frame; empty if one does not, or does not name the frame."""
    said = ""
    for form in FORMS:
        try:
            form(machine, frame=frame)
        except ValueError as error:
            said = str(error)
            if frame not in said or words not in said:
                return ""
        else:
            return ""
    return said


def poses(n: int, *positions: Sequence[float], seed: int = 7) -> Poses:
    """Return states at given positions with random velocities and torques."""
    rng = np.random.default_rng(seed)
    return [(np.array(q, dtype=float), rng.uniform(-2.5, 2.5, n), rng.uniform(-60, 60, n)) for q in positions]


Approach = tuple[Manipulator, Poses]


def along(
    approach: Callable[[float], Approach], frame: str, distances: Sequence[float] = DECADES, loss: float = 0.0
) -> Iterator[Figure]:
    """Yield the error in a frame at every distance; a frame that loses digits may lose distance**-loss of them.

    Args:
        approach: distance -> machine and poses.
        frame: name.
        distances: from the degeneracy.
        loss: power of 1 / distance by which the equations in the frame amplify rounding, from theory.
    """
    for distance in distances:
        machine, states = approach(distance)
        error, condition = errors(machine, frame, states)
        yield Figure(error, ROUNDINGS * abs(distance) ** -loss, distance, condition, frame)


def refusal(
    approach: Callable[[float], Approach], frame: str, distances: Sequence[float], words: str
) -> Iterator[Figure]:
    """Yield 0 at every distance at which a frame is refused by name with the cure, and 1 where it is not."""
    for distance in distances:
        said = refused(approach(distance)[0], frame, words)
        yield Figure(0.0 if said else 1.0, 0.0, distance, note=said or "not refused")


def accurate_or_refused(
    approach: Callable[[float], Approach], frame: str, distances: Sequence[float] = DECADES
) -> Iterator[Figure]:
    """Yield the error at every distance at which a frame exists; refusal with a sentence counts as none.

    A frame is refused when less than half the digits of det g are left: 1e-8 is what may be lost before.
    """
    for distance in distances:
        machine, states = approach(distance)
        said = refused(machine, frame, "use frame='regular'")
        error, condition = (0.0, np.nan) if said else errors(machine, frame, states)
        yield Figure(error, 1e-7, distance, condition, said or frame)


def offset(distance: float) -> Approach:
    """Return a cylindrical machine with A / r = distance."""
    return cylindrical(A=distance), poses(3, [0.3, -0.2, 1.0], [-2.0, 0.4, -1.0])


def heavy(distance: float) -> Approach:
    """Return a cylindrical machine with Theta_bar / (m_3 A^2) = distance, about."""
    own = 20.0 * distance
    machine = cylindrical(A=1.0, m_2=own, Theta_1_33=own, Theta_2_33=own, Theta_3_33=own)
    return machine, poses(3, [0.3, -0.2, 0.9 * distance**0.5])


def upright(distance: float) -> Approach:
    """Return the spherical machine with theta = distance."""
    return spherical(), poses(4, [distance, 0.4, -0.3, 0.8], [-distance, 0.4, 0.9, 0.7])


def hanging(distance: float) -> Approach:
    """Return the spherical machine with theta = pi - distance."""
    return spherical(), poses(4, [np.pi - distance, 0.4, -0.3, 0.8])


def spinning(distance: float) -> Approach:
    """Return a spherical machine with Theta_3_33 / J = distance, near theta = 0 where J is least."""
    return spherical(Theta_3_33=3.4 * distance, physical=False), poses(4, [1e-3, 0.4, -0.3, 0.8], [1.1, 0.4, -0.3, 0.8])


def root(distance: float, offset: float = 0.0) -> Approach:
    """Return a torus-like machine with B_c / I_3 = distance."""
    second = 1.1 + 25.0 * 0.7**2 / 4 + 18.0 * 0.7**2
    own = second / (1.0 - distance) - 18.0 * 0.8**2 / 4
    machine = torus(B=offset, Theta_3_11=0.9 * own, Theta_3_22=own, Theta_3_33=own)
    return machine, poses(3, [0.3, 0.5, -0.9], [0.3, -1.0, 2.0])


def equal(distance: float) -> Approach:
    """Return a torus-like machine with I_2 = I_3 to the last bit."""
    del distance
    own = 23.16144
    machine = torus(
        L_2=0.83, L_3=0.67, m_2=29.9, m_3=29.5, Theta_2_22=1.0, Theta_3_11=own, Theta_3_22=own, Theta_3_33=own
    )
    return machine, poses(3, [0.3, 0.5, -0.9])


def on_axis(distance: float, bend: float = 0.0, offset: float = 0.0) -> Approach:
    """Return a torus-like machine of slender links, g_11 of the arm on the vertical axis = distance [kg m^2]."""
    own = distance / 3.0
    machine = torus(B=offset, Theta_1_33=own, Theta_2_11=own, Theta_3_11=own)
    return machine, poses(3, [0.3, np.pi / 2, bend], [0.3, np.pi / 2 + 1e-3 * distance**0.5, bend])


SIDES = tuple(sign * 10.0**-k for k in range(1, 14) for sign in (1.0, -1.0))
INERTIAS = tuple(10.0**k for k in range(6, -13, -1))
FOLDED = partial(on_axis, bend=np.pi)
BESIDE = partial(on_axis, offset=0.1)
Q = "accelerations, relative, over their condition number"


def case(name: str, towards: str, measure: Callable[[], Iterator[Figure]], fast: bool = True) -> Case:
    """Return a case of this group."""
    return Case("frames", name, Q, towards, measure, fast)


CASES: tuple[Case, ...] = (
    case("cylinder, small offset, regular", "A / r", lambda: along(offset, "regular")),
    # The frame is constant, so that only its scales diverge and nothing is lost.
    case("cylinder, small offset, paper", "A / r", lambda: along(offset, "paper")),
    case("cylinder, no offset, regular", "A / r", lambda: along(offset, "regular", (0.0,))),
    case("cylinder, no offset, paper refused", "A / r", lambda: refusal(offset, "paper", (0.0,), "A = 0")),
    case("cylinder, heavy arm beside the axis, regular", "Theta_bar / (m_3 A^2)", lambda: along(heavy, "regular")),
    case("cylinder, heavy arm beside the axis, paper", "Theta_bar / (m_3 A^2)", lambda: along(heavy, "paper")),
    case("cylinder, heavy arm, ldl", "Theta_bar / (m_3 A^2)", lambda: accurate_or_refused(heavy, "ldl")),
    case("cylinder, heavy arm, udu", "Theta_bar / (m_3 A^2)", lambda: accurate_or_refused(heavy, "udu"), False),
    case("sphere, spin, ldl", "Theta_3_33 / J", lambda: accurate_or_refused(spinning, "ldl", INERTIAS), False),
    case(
        "sphere, spin, coordinate",
        "Theta_3_33 / J",
        lambda: accurate_or_refused(spinning, "coordinate", INERTIAS),
        False,
    ),
    case("sphere, upright, regular", "theta", lambda: along(upright, "regular")),
    # d^2 psi / dt^2 is a difference of order one divided by sin(theta).
    case("sphere, upright, paper", "theta", lambda: along(upright, "paper", DECADES[:7], 1.0), False),
    case("sphere, hanging, regular", "pi - theta", lambda: along(hanging, "regular"), False),
    case("sphere, hanging, paper", "pi - theta", lambda: along(hanging, "paper", DECADES[:7], 1.0), False),
    case("sphere, exactly upright, regular", "theta", lambda: along(upright, "regular", (0.0,))),
    case(
        "sphere, spin from heavy to light, regular",
        "Theta_3_33 / J",
        lambda: along(spinning, "regular", INERTIAS),
        False,
    ),
    case("sphere, spin from heavy to light, paper", "Theta_3_33 / J", lambda: paper_spin(), False),
    case("torus, B_c from both sides, regular", "B_c / I_3", lambda: along(root, "regular", SIDES), False),
    case("torus, B_c from both sides, paper", "B_c / I_3", lambda: along(root, "paper", SIDES), False),
    case("torus with offset, B_c, paper", "B_c / I_3", lambda: along(partial(root, offset=0.1), "paper", SIDES), False),
    case("torus, B_c = 0, regular", "B_c / I_3", lambda: along(equal, "regular", (0.0,))),
    case("torus, B_c = 0, paper refused", "B_c / I_3", lambda: refusal(equal, "paper", (0.0,), "I_2 = I_3")),
    case("torus, stretched on the axis, regular", "g_11 [kg m^2]", lambda: along(on_axis, "regular"), False),
    case("torus, stretched on the axis, paper", "g_11 [kg m^2]", lambda: along(on_axis, "paper"), False),
    case("torus, folded on the axis, regular", "g_11 [kg m^2]", lambda: along(FOLDED, "regular"), False),
    case("torus, stretched beside the axis, regular", "g_11 [kg m^2]", lambda: along(BESIDE, "regular"), False),
    case("torus, stretched beside the axis, arrow", "g_11 [kg m^2]", lambda: along(BESIDE, "arrow"), False),
)


def paper_spin() -> Iterator[Figure]:
    """Yield the errors of the frame of the paper, which divides by sin(theta) = 1e-3 at one pose."""
    for figure in along(spinning, "paper", INERTIAS):
        yield Figure(figure.value, 1e3 * ROUNDINGS, figure.distance, figure.condition, figure.note)
