"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.machines.cylindrical_arm import cylindrical
from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter
from models.machines.spherical_arm import spherical
from models.machines.torus_arm import torus
from models.motions.motion import Motion
from models.motions.path_timing import path_system, timed
from models.motions.paths import path_through
from models.motions.straight_timing import states_along, straight_path
from models.motions.tool_motion import along_tool_path, through_tool_points
from models.motions.tool_paths import arc, line, sampled
from models.rigid_bodies import (
    DhRow,
    Joint,
    Kind,
    Link,
    along_poses,
    dh,
    from_urdf,
    inverse_kinematics,
    orientation_error,
    robots,
    serial,
    tree,
)
from models.scenes.scene import Scene
from models.torques.code_export import right_hand_side, write_code, write_function
from models.torques.drive_loads import DriveLoad, Envelope
from models.torques.effect_estimates import Estimate, estimate
from models.torques.gear_sizing import Motor, Sizing, size_gears
from models.torques.torque_functions import drive_dynamics, inverse_dynamics, recover
from models.torques.torque_split import split_torques
from models.torques.torque_table import TorqueTable

__all__ = [
    "DhRow", "DriveLoad", "Envelope", "Estimate", "Joint", "Kind", "Link", "Manipulator", "Motion", "Motor",
    "Parameter", "Scene", "Sizing", "TorqueTable", "along_poses", "along_tool_path", "arc", "cylindrical", "dh",
    "drive_dynamics", "estimate", "from_urdf", "inverse_dynamics", "inverse_kinematics", "line", "orientation_error",
    "path_system", "path_through", "recover", "right_hand_side", "robots", "sampled", "serial", "size_gears",
    "spherical", "split_torques", "states_along", "straight_path", "through_tool_points", "timed", "torus", "tree",
    "write_code", "write_function",
]  # fmt: skip
