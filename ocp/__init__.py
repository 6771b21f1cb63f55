"""Optimal control of x' = f(x, u, p) by direct collocation and IPOPT."""

from ocp.accuracy.error_estimate import estimate
from ocp.accuracy.refinement import solve_to_accuracy
from ocp.accuracy.report import Allowed, Report
from ocp.accuracy.tolerances import Cost, Seconds, Share, Signal, Tolerance
from ocp.accuracy.verification import verify
from ocp.arcs.carry_over import PreparedStructure, prepare_structure
from ocp.arcs.least_effort import gentle, gentlest
from ocp.arcs.polishing import polish
from ocp.integrators.simulation import Trajectory, simulate
from ocp.problem.constraints import Constraint, along, end, integral, periodic, start
from ocp.problem.dynamic_extension import extend, time_derivative
from ocp.problem.nonsmooth import absolute, positive_part
from ocp.problem.problem import Bolza, Fixed, Free, Problem
from ocp.problem.regions import Ball, Box, Cylinder, HalfSpace, inside, outside
from ocp.problem.rest_to_rest import point_to_point
from ocp.problem.sequence import Sequence
from ocp.sensitivities.motion_derivatives import Held
from ocp.sensitivities.post_optimal import sensitivity
from ocp.sensitivities.sensitivity import Sensitivity
from ocp.sensitivities.sequence_sensitivity import SequenceSensitivity
from ocp.solution.accuracy import Accuracy, Errors
from ocp.solution.sequence_solution import SequenceSolution
from ocp.solution.solution import Solution, Status, Timings
from ocp.solution.storage import load, save
from ocp.solution.structure import Structure
from ocp.solving.first_guesses import smooth, straight_line
from ocp.solving.guess_rungs import CoarseGrid, ParameterPath, Smooth, StraightLine, WiderLimits
from ocp.solving.ipopt import Ipopt
from ocp.solving.local_optima import Optimum, multistart
from ocp.solving.prepared_nlp import Prepared, prepare
from ocp.solving.resolving_grid import resolved
from ocp.solving.solver import solve
from ocp.studies.designs import LatinHypercube, Listed, Product, Random, Sobol, Zip
from ocp.studies.store import Store, StoreError
from ocp.studies.study import Study
from ocp.studies.sweeping import Outcome, sweep
from ocp.studies.table import StudyTable
from ocp.system import Label, System
from ocp.transcription.grid import Grid, given, uniform
from ocp.transcription.guess import Guess
from ocp.transcription.packing import Multipliers
from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.lobatto_iiia import lobatto
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

__all__ = [
    "Accuracy", "Allowed", "Ball", "Bolza", "Box", "CoarseGrid", "Constraint", "Control", "Cost", "Cylinder", "Errors",
    "Fixed", "Free", "Grid", "Guess", "HalfSpace", "Held", "Ipopt", "Label", "LatinHypercube", "Listed",
    "Multipliers", "Optimum", "Outcome", "ParameterPath", "Prepared", "PreparedStructure", "Problem", "Product",
    "Random", "Report", "Scheme", "Seconds", "Sensitivity", "Sequence", "SequenceSensitivity",
    "SequenceSolution", "Share", "Signal",
    "Smooth", "Sobol", "Solution", "Status", "Store", "StoreError", "StraightLine", "Structure", "Study",
    "StudyTable", "System", "Timings", "Tolerance", "Trajectory", "WiderLimits", "Zip", "absolute", "along", "end",
    "estimate", "extend", "gentle", "gentlest", "given", "inside", "integral", "integrators", "legendre", "load",
    "lobatto", "multistart", "outside", "periodic", "point_to_point", "polish", "positive_part", "prepare",
    "prepare_structure", "radau", "resolved", "save", "sensitivity", "simulate", "smooth", "solve",
    "solve_to_accuracy",
    "start", "straight_line", "sweep", "time_derivative", "uniform", "verify",
]  # fmt: skip
