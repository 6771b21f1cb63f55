"""Manipulators as symbolic ODEs in Lagrange, Boltzmann-Hamel and canonical form."""

from models.contributions import split_torques
from models.cylinder import cylindrical
from models.estimation import Estimate, estimate
from models.manipulator import Manipulator
from models.parameters import Parameter
from models.scene import Scene
from models.sphere import spherical
from models.toroid import torus
from models.torques import drive_dynamics, inverse_dynamics, recover

__all__ = [
    "Estimate", "Manipulator", "Parameter", "Scene", "cylindrical", "drive_dynamics", "estimate", "inverse_dynamics",
    "recover", "spherical", "split_torques", "torus",
]  # fmt: skip
