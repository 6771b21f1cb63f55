"""The forms of the equations of motion: same arguments, same signals, different states or controls."""

from models.forms.canonical_form import canonical
from models.forms.hamel_form import hamel
from models.forms.inverse_form import inverse
from models.forms.lagrange_form import lagrange

__all__ = ["canonical", "hamel", "inverse", "lagrange"]
