"""Genuine singularities: a metric without inertia about a coordinate is found, named, and no NaN gets out."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import numpy as np

from hard_cases.case import Case, Figure
from hard_cases.frames import Approach, along, poses
from models import Manipulator, Motion, cylindrical, inverse_dynamics, line, spherical, torus
from models.effects import Gravity, RotorInertia
from models.forms import canonical, hamel, lagrange
from models.motions.tool_motion import along_tool_path
from ocp import Ipopt, point_to_point, radau, simulate, solve, uniform, verify

FORMS = (lagrange, hamel, canonical)


def light_column(axial: float = 0.0) -> Manipulator:
    """Return the spherical machine with C = axial [kg m^2]."""
    return spherical(Theta_1_33=axial / 2.0, Theta_2_33=axial / 2.0, physical=False)


def point_on_axis(own: float = 0.0) -> Manipulator:
    """Return the cylindrical machine as a point mass, J_0 = own [kg m^2]."""
    return cylindrical(A=0.0, Theta_1_33=own, Theta_2_33=0.0, Theta_3_33=0.0, physical=False)


def thin_arm(own: float = 0.0) -> Manipulator:
    """Return the torus-like machine with g_11 = own [kg m^2] when the arm is on the vertical axis."""
    return torus(Theta_1_33=own, Theta_2_11=0.0, Theta_3_11=0.0, physical=False)


# Machine, position at the singularity, position away from it, the coordinate named and a parameter that cures it.
Singular = tuple[Callable[..., Manipulator], list[float], list[float], str, str]
SINGULAR_POSES: tuple[Singular, ...] = (
    (light_column, [0.0, 0.2, 0.1, 0.8], [0.9, 0.2, 0.1, 0.8], "psi", "Theta_1_33 or Theta_2_33"),
    (light_column, [np.pi, 0.2, 0.1, 0.8], [2.2, 0.2, 0.1, 0.8], "psi", "Theta_1_33 or Theta_2_33"),
    (point_on_axis, [0.3, 0.1, 0.0], [0.3, 0.1, 0.7], "phi", "Theta_1_33, Theta_2_33 or Theta_3_33"),
    (thin_arm, [0.3, np.pi / 2, 0.0], [0.3, 0.4, -0.9], "q1", "Theta_1_33, Theta_2_11 or Theta_3_11"),
    (thin_arm, [0.3, np.pi / 2, np.pi], [0.3, 0.4, -0.9], "q1", "Theta_1_33, Theta_2_11 or Theta_3_11"),
)


def names(words: str, machine: Manipulator, coordinate: str, cure: str) -> bool:
    """Return whether a sentence says which machine, which coordinate and what cures it."""
    return machine.name in words and f"no inertia about {coordinate}" in words and cure in words


def simulated() -> Iterator[Figure]:
    """Yield 0 where a motion that starts at a singularity does not start, and says why."""
    for make, at, _, coordinate, cure in SINGULAR_POSES:
        machine = make()
        for form in FORMS:
            system = form(machine, [Gravity()])
            got = simulate(system, [*at, *[0.0] * len(at)], np.ones(len(at)), 0.1)
            good = not got.ok and names(got.message, machine, coordinate, cure)
            yield Figure(0.0 if good else 1.0, 0.0, note=got.message or "not noticed")


def run_into() -> Iterator[Figure]:
    """Yield 0 where a motion that runs into the singularity stops with the sentence, or passes it without a NaN.

    With no momentum about the coordinate the way through is smooth; with some of it the motion turns back before.
    """
    for make, at, away, coordinate, cure in SINGULAR_POSES:
        machine = make()
        system = lagrange(machine, [Gravity()])
        speed = (np.array(at) - np.array(away)) / 0.2
        for turning in (0.0, 1.0):
            v = speed + turning * (np.arange(len(at)) == [c.name for c in machine.coordinates].index(coordinate))
            got = simulate(system, [*away, *v], np.zeros(len(at)), 0.4, rtol=1e-9, atol=1e-9)
            reached = np.all(np.isfinite(got.x), axis=1)
            explained = names(got.message, machine, coordinate, cure) or "the step vanished" in got.message
            yield Figure(
                0.0 if reached.all() == got.ok and (got.ok or explained) else 1.0, 0.0, note=got.message or "passed"
            )


def solved() -> Iterator[Figure]:
    """Yield 0 where a solve from a singularity fails by value with the sentence and finite states, verify included."""
    for make, at, away, coordinate, cure in SINGULAR_POSES:
        machine = make()
        for form in FORMS:
            task = point_to_point(form(machine, [Gravity()]), at, away, tau=400.0)
            result = solve(task, radau(3), uniform(10), Ipopt(max_iter=40))
            report = verify(result)
            good = not result.ok and names(result.message, machine, coordinate, cure) and bool(report.failures)
            good = good and bool(np.all(np.isfinite(result.states)) and np.all(np.isfinite(result.controls)))
            yield Figure(0.0 if good else 1.0, 0.0, note=result.message)


def torques() -> Iterator[Figure]:
    """Yield how far the torques at a singularity are from those beside it: nothing is inverted, nothing is singular."""
    for make, at, _, _, _ in SINGULAR_POSES:
        function = inverse_dynamics(make(), [Gravity()])
        n = len(at)
        v, a = np.linspace(0.5, 1.0, n), np.linspace(-1.0, 2.0, n)
        here, near = (np.array(function(np.array(at) + step, v, a, [])).ravel() for step in (0.0, 1e-9))
        size = np.max(np.abs(near))
        # Smooth in q, with slopes of ten times its size at most at these speeds.
        yield Figure(float(np.max(np.abs(here - near))) / size, 1e-7, 1e-9)


def nowhere() -> Iterator[Figure]:
    """Yield 0 where a machine without inertia at every position is refused when its equations are built."""
    none = (
        (spherical(Theta_3_33=0.0, physical=False), "phi", "Theta_3_33"),
        (spherical(m_3=0.0, physical=False), "r", "m_3"),
        (cylindrical(m_3=0.0, physical=False), "r", "m_3"),
    )
    for machine, coordinate, cure in none:
        for form in FORMS:
            for frame in ("regular", "paper"):
                try:
                    form(machine, [Gravity()], frame)
                    said = ""
                except ValueError as error:
                    said = str(error)
                yield Figure(0.0 if names(said, machine, coordinate, cure) else 1.0, 0.0, note=said or "not refused")


def cured() -> Iterator[Figure]:
    """Yield 0 where an effect with inertia lifts the singularity."""
    for make, at, _, _, _ in SINGULAR_POSES:
        rotors = RotorInertia(1e-4, tuple([70.0] * len(at)))
        system = canonical(make(), [Gravity(), rotors])
        got = simulate(system, [*at, *[0.0] * len(at)], np.ones(len(at)), 0.1)
        yield Figure(0.0 if got.ok and not system.singular else 1.0, 0.0, note=got.message)


def kinematics() -> Iterator[Figure]:
    """Yield 0 where the inverse kinematics names its singularity and a path through it gives numbers or a sentence."""
    for machine in (cylindrical(), cylindrical(A=0.0), spherical(), torus(), torus(B=0.2)):
        assert machine.inverse is not None
        axis = np.array([[0.0, 0.0, 0.9], [0.15, 0.0, 0.2], [0.0, 0.0, 0.0]])
        result = machine.inverse(axis)
        for k in range(len(axis)):
            free = bool(np.any(np.isnan(result.q[k][:, :2])))
            explained = bool(result.singularities(k) or result.why(k))
            yield Figure(1.0 if free and not explained else 0.0, 0.0, note="; ".join(result.singularities(k)))
        for start, end in (([0.5, 0.0, 0.6], [-0.5, 0.0, 0.6]), ([0.0, 0.0, 0.6], [0.0, 0.5, 0.6])):
            path = line(start, end)
            law = Motion.trapezoidal(0.0, path.length, 0.5, 2.0)
            try:
                motion = along_tool_path(machine, path, law)
                values = np.concatenate([part(motion.times) for part in (motion.q, motion.v, motion.a)])
                good, said = bool(np.all(np.isfinite(values))), "passed"
            except ValueError as error:
                said = str(error)
                good = "singular" in said or "reached" in said or "jumps" in said
            yield Figure(0.0 if good else 1.0, 0.0, note=f"{machine.name}: {said}")


def column(distance: float) -> Approach:
    """Return the spherical machine with C = distance, upright and at an angle at which J is twice C."""
    return light_column(distance), poses(4, [0.0, 0.4, -0.3, 0.8], [(distance / 13.0) ** 0.5, 0.4, -0.3, 0.8])


def centre(distance: float) -> Approach:
    """Return the cylindrical machine with J_0 = distance, the arm at and near the axis."""
    return point_on_axis(distance), poses(3, [0.3, -0.2, 0.0], [0.3, -0.2, (distance / 20.0) ** 0.5])


def quiet(measure: Callable[[], Iterator[Figure]]) -> Iterator[Figure]:
    """Yield figures; a warning of numpy on the way becomes an exception, as it means that a NaN was made."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield from measure()


def case(
    name: str, quantity: str, measure: Callable[[], Iterator[Figure]], fast: bool = True, towards: str = ""
) -> Case:
    """Return a case of this group."""
    return Case("singular", name, quantity, towards, lambda: quiet(measure), fast)


Q = "accelerations, relative, over their condition number"
CASES: tuple[Case, ...] = (
    case("simulated from a singularity", "motions without the sentence", simulated),
    case("simulated into a singularity", "motions without the sentence", run_into, False),
    case("solved from a singularity", "solves without the sentence", solved, False),
    case("torques at a singularity", "torques against those beside it, relative", torques),
    case("no inertia anywhere", "forms not refused", nowhere),
    case("cured by rotors", "motions that fail", cured),
    case("inverse kinematics on the axis", "singularities not named", kinematics, False),
    case("sphere, C to 0 near the pole", Q, lambda: along(column, "regular"), False, "C [kg m^2]"),
    case("cylinder, J_0 to 0 near the axis", Q, lambda: along(centre, "regular"), False, "J_0 [kg m^2]"),
)
