"""Optimal control of x' = f(x, u, p) by direct collocation and IPOPT."""

from ocp.collocation import Control, Scheme, legendre, radau
from ocp.grid import Grid, given, uniform
from ocp.guess import Guess
from ocp.problem import Bolza, Constraint, Fixed, Free, Problem, along, end, start
from ocp.solution import Solution, Status, Timings
from ocp.solver import Ipopt, Prepared, prepare, solve
from ocp.system import Label, System
from ocp.tasks import point_to_point
