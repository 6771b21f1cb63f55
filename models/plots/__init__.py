"""Pictures of results, one line each: plots.motion(solution), structure, torques, study, machine."""

from models.plots.machines import machine
from models.plots.solutions import motion
from models.plots.structures import structure
from models.plots.studies import study
from models.plots.tables import torques

__all__ = ["machine", "motion", "structure", "study", "torques"]
