"""Optimal control of x' = f(x, u, p) by direct collocation and IPOPT."""

from ocp.collocation import Control, Scheme, legendre, radau
from ocp.grid import Grid, given, uniform
from ocp.guess import Guess, straight_line
from ocp.problem import Bolza, Constraint, Fixed, Free, Problem, along, end, start
from ocp.simulation import Trajectory, simulate
from ocp.solution import Solution, Status, Timings
from ocp.solver import Ipopt, Prepared, prepare, solve
from ocp.storage import load, save
from ocp.system import Label, System
from ocp.tasks import point_to_point
from ocp.verification import Report, verify

__all__ = [
    "Bolza", "Constraint", "Control", "Fixed", "Free", "Grid", "Guess", "Ipopt", "Label", "Prepared", "Problem",
    "Report", "Scheme", "Solution", "Status", "System", "Timings", "Trajectory", "along", "end", "given", "legendre",
    "load", "point_to_point", "prepare", "radau", "save", "simulate", "solve", "start", "straight_line", "uniform",
    "verify",
]  # fmt: skip
