"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.cylinder import cylindrical
from models.manipulator import Manipulator
from models.parameters import Parameter
from models.sphere import spherical
from models.torques import inverse_dynamics
from models.toroid import torus

__all__ = ["Manipulator", "Parameter", "cylindrical", "inverse_dynamics", "spherical", "torus"]
