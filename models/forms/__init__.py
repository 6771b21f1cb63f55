"""The three forms of the equations of motion: same arguments, same signals, different states."""

from models.forms.canonical_form import canonical
from models.forms.hamel_form import hamel
from models.forms.lagrange_form import lagrange

__all__ = ["canonical", "hamel", "lagrange"]
