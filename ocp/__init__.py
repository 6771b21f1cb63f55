"""Optimal control of x' = f(x, u, p) by direct collocation and IPOPT."""

from ocp import integrators
from ocp.collocation import Control, Scheme, legendre, lobatto, radau
from ocp.constraint import Constraint, along, end, periodic, start
from ocp.design import LatinHypercube, Listed, Product, Random, Sobol, Zip
from ocp.error import Errors, estimate
from ocp.extension import extend, time_derivative
from ocp.grid import Grid, given, uniform
from ocp.guess import Guess, smooth, straight_line
from ocp.ipopt import Ipopt
from ocp.ladder import CoarseGrid, ParameterPath, Smooth, StraightLine, WiderLimits
from ocp.optima import Optimum, multistart
from ocp.outcome import Outcome, sweep
from ocp.polishing import polish
from ocp.problem import Bolza, Fixed, Free, Problem
from ocp.refinement import solve_to_accuracy
from ocp.region import Ball, Box, Cylinder, HalfSpace, inside, outside
from ocp.sensitivities import Sensitivity, sensitivity
from ocp.sequence import Sequence, SequenceSolution
from ocp.simulation import Trajectory, simulate
from ocp.solution import Accuracy, Multipliers, Solution, Status, Timings
from ocp.solver import Prepared, prepare, solve
from ocp.storage import load, save
from ocp.store import Store, StoreError
from ocp.structure import Structure
from ocp.study import Study
from ocp.study_table import StudyTable
from ocp.succession import PreparedStructure, prepare_structure
from ocp.system import Label, System
from ocp.tasks import point_to_point
from ocp.tolerance import Cost, Seconds, Share, Signal, Tolerance
from ocp.variation import Held
from ocp.verification import Report, verify

__all__ = [
    "Accuracy", "Ball", "Bolza", "Box", "CoarseGrid", "Constraint", "Control", "Cost", "Cylinder", "Errors",
    "Fixed", "Free", "Grid", "Guess", "HalfSpace", "Held", "Ipopt", "Label", "LatinHypercube", "Listed",
    "Multipliers", "Optimum", "Outcome", "ParameterPath", "Prepared", "PreparedStructure", "Problem", "Product",
    "Random", "Report", "Scheme", "Seconds", "Sensitivity", "Sequence", "SequenceSolution", "Share", "Signal",
    "Smooth", "Sobol", "Solution", "Status", "Store", "StoreError", "StraightLine", "Structure", "Study",
    "StudyTable", "System", "Timings", "Tolerance", "Trajectory", "WiderLimits", "Zip", "along", "end", "estimate",
    "extend", "given", "inside", "integrators", "legendre", "load", "lobatto", "multistart", "outside", "periodic",
    "point_to_point", "polish", "prepare", "prepare_structure", "radau", "save", "sensitivity", "simulate",
    "smooth", "solve", "solve_to_accuracy", "start", "straight_line", "sweep", "time_derivative", "uniform",
    "verify",
]  # fmt: skip
