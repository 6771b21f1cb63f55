"""Studies as a user wrote them for release 0.1.0, whose program filled the stores in tests/studies/data."""

from models import Manipulator, Motion, Parameter, Scene, TorqueTable, cylindrical, spherical
from models.effects import (
    Coulomb,
    Gravity,
    JointStop,
    LaggedDrive,
    MotorDrive,
    Payload,
    PowerLimit,
    ToolForce,
    TorqueSpeed,
    Viscous,
)
from models.forms import canonical
from ocp import (
    Ball,
    Bolza,
    Free,
    Ipopt,
    Label,
    Problem,
    Solution,
    Status,
    Structure,
    Study,
    System,
    Tolerance,
    integrators,
    point_to_point,
    radau,
    uniform,
)

QUIET = Ipopt(tol=1e-10, progress=False)
ARM = canonical(cylindrical(), [Gravity(), Payload(Parameter(2.0))])
MACHINE = spherical(m_3=Parameter(15.0))
EFFECTS = (Gravity(), Viscous(0.5), Coulomb([1.0, 1.0, 1.0, 1.0]))
KINDS = {"models": Manipulator, "ocp": (System, Problem, Solution, Structure, Status, Label, Tolerance)}


def names_classes(x, scale=2.0):
    """Name classes and objects of the package, as a function that builds its problem by itself does."""
    kinds = (Gravity, Parameter, Bolza, TorqueSpeed, PowerLimit, JointStop, ToolForce, Scene, Motion, TorqueTable)
    more = (Free, Ball, MotorDrive, LaggedDrive, *KINDS["ocp"], integrators.gauss)
    return {"names": len(kinds) + len(more) + len(EFFECTS), "double": scale * x}


def names_machine(x):
    """Name a machine that was built once."""
    assert isinstance(MACHINE, KINDS["models"])
    return {"coordinates": len(MACHINE.coordinates) * x}


def shortest(limit):
    """Return a problem over a system that is built once."""
    drives = [160.0 * limit, 1100.0 * limit, 320.0 * limit]
    return point_to_point(ARM, [0.0, 0.2, 0.6], [1.0, 0.5, 0.7], tau=drives)


def studies(folder):
    """Return name -> study: numbers, a function that returns problems, polished ones, a single problem."""
    axes = {"payload.mass": [0.0, 2.0], "limit": [0.9, 1.0]}
    short = dict(scheme=radau(3), grid=uniform(8), solver=QUIET)
    return {
        "numbers": Study(names_classes, over={"x": [1.0, 2.0]}, store=folder / "numbers.db", settings={"table": "7b"}),
        "machine": Study(names_machine, over={"x": [1.0, 2.0]}, store=folder / "machine.db"),
        "shortest": Study(shortest, over=axes, store=folder / "shortest.db", **short),
        "polished": Study(shortest, over={"limit": [0.9, 1.0]}, store=folder / "polished.db", polished=True,
                          slopes=True, **short),
        "problem": Study(shortest(1.0), over={"payload.mass": [0.0, 1.0]}, store=folder / "problem.db",
                         grid=uniform(8)),
    }  # fmt: skip
