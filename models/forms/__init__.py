"""The three forms of the equations of motion; one signature, the same signals, other states."""

from models.forms.hamiltonian import canonical
from models.forms.lagrangian import lagrange
from models.forms.quasivelocity import hamel

__all__ = ["canonical", "hamel", "lagrange"]
