"""
6. An arm from a URDF file
==========================

Most robots come with a URDF file. Joints, links, limits and friction are read from it; ``models.robots`` has the data
of some arms ready (``ur5``, ``ur10``, ``panda``, ``puma560``, ``manutec_r3``).
"""

# %%
# A file
# ------

import tempfile
from pathlib import Path

LINK = """<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>
  <inertia ixx="0.01" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="{4}"/>
  <limit lower="-2.9" upper="2.9" effort="{5}" velocity="3.0"/></joint>"""
file = Path(tempfile.mkdtemp()) / "arm.urdf"
file.write_text(
    '<robot name="three"><link name="base"/>'
    + LINK.format("column", 0.0, 8.0, 0.1)
    + LINK.format("upper", 0.25, 6.0, 0.15)
    + LINK.format("fore", 0.2, 4.0, 0.08)
    + '<link name="hand"/>'
    + JOINT.format("waist", "base", "column", "0 0 0.3", "0 0 1", 60)
    + JOINT.format("shoulder", "column", "upper", "0 0 0.1", "0 -1 0", 80)
    + JOINT.format("elbow", "upper", "fore", "0.5 0 0", "0 -1 0", 40)
    + '<joint name="flange" type="fixed"><parent link="fore"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>'
    + "</robot>",
    encoding="utf-8",
)

# %%
# The arm
# -------
# The drawing shows at once whether axes and zero position are what one believes.

from models import from_urdf, plots

arm = from_urdf(file, tip="hand")
print(arm)
plots.machine(arm, [0.5, 0.6, -1.0])

# %%
# Its limits
# ----------
# The limits of the file are data; they hold only where they are asked for.

print(arm.limits)

# %%
# Its fastest motion
# ------------------

from models.effects import Gravity
from models.forms import lagrange
from ocp import point_to_point, solve, uniform

task = point_to_point(
    lagrange(arm, [Gravity()]), [0.0, 0.9, -1.4], [1.5, 0.3, -0.6], tau=[60.0, 80.0, 40.0], v=[3.0, 3.0, 3.0]
)
solution = solve(task, grid=uniform(30))
print(solution)
plots.motion(solution, arm)
