"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.cylinder import cylindrical
from models.loads import DriveLoad, Envelope
from models.manipulator import Manipulator
from models.motion import Motion
from models.parameters import Parameter
from models.sphere import spherical
from models.toroid import torus
from models.torque_table import TorqueTable
from models.torques import inverse_dynamics, recover

__all__ = [
    "DriveLoad", "Envelope", "Manipulator", "Motion", "Parameter", "TorqueTable", "cylindrical", "inverse_dynamics",
    "recover", "spherical", "torus",
]  # fmt: skip
