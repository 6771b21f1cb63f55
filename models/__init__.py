"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.cylinder import cylindrical
from models.manipulator import Manipulator
from models.parameters import Parameter
from models.sphere import spherical
from models.toroid import torus
from models.torques import drive_dynamics, inverse_dynamics, recover

__all__ = [
    "Manipulator", "Parameter", "cylindrical", "drive_dynamics", "inverse_dynamics", "recover", "spherical", "torus",
]  # fmt: skip
