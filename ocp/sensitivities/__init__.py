"""Derivatives of an optimal motion and its cost with respect to parameters, limits and boundary values."""
