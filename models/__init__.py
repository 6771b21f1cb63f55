"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.contributions import split_torques
from models.cylinder import cylindrical
from models.estimation import Estimate, estimate
from models.export import right_hand_side, write_code, write_function
from models.loads import DriveLoad, Envelope
from models.manipulator import Manipulator
from models.motion import Motion
from models.parameters import Parameter
from models.path_timing import path_system, path_through, timed
from models.scene import Scene
from models.sphere import spherical
from models.tool_motion import along_tool_path, through_tool_points
from models.tool_path import arc, line, sampled
from models.toroid import torus
from models.torque_table import TorqueTable
from models.torques import drive_dynamics, inverse_dynamics, recover

__all__ = [
    "DriveLoad", "Envelope", "Estimate", "Manipulator", "Motion", "Parameter", "Scene", "TorqueTable",
    "along_tool_path", "arc", "cylindrical", "drive_dynamics", "estimate", "inverse_dynamics", "line", "path_system",
    "path_through", "recover", "right_hand_side", "sampled", "spherical", "split_torques", "through_tool_points",
    "timed", "torus", "write_code", "write_function",
]  # fmt: skip
