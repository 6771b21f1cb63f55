"""Switching structure: arcs are detected, and the switching times solved for as unknowns (polishing)."""
