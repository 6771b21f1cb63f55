"""
The torques of a straight line
==============================

The tool of the spherical manipulator follows a straight line with limited speed, acceleration and jerk. Inverse
kinematics and dynamics are closed formulas: nothing is optimised here.
"""

from models import Motion, along_tool_path, line, plots, spherical
from models.effects import Gravity, Payload

path = line([0.3, 0.9, 0.4], [-0.5, 0.8, 0.7])
motion = along_tool_path(spherical(), path, Motion.s_curve(0.0, path.length, 0.5, 2.0, 20.0))
table = motion.torques(spherical(), [Gravity(), Payload(3.0)])
print(table)
plots.torques(table)
