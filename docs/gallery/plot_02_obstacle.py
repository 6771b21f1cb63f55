"""
Around a post
=============

The cylindrical manipulator passes a post that stands between start and goal. The tool keeps out of it along the whole
motion.
"""

from dataclasses import replace

from models import cylindrical, plots
from models.effects import Gravity
from models.forms import canonical
from ocp import Cylinder, outside, point_to_point, solve, uniform

post = Cylinder([-0.28, 0.77, 0.0], [0.0, 0.0, 1.0], 0.12)
arm = canonical(cylindrical(), [Gravity()])
free = point_to_point(
    arm, [0.0, 0.2, 0.6], [2.0, 0.8, 0.8], q=([-3.0, 0.0, 0.3], [3.0, 1.2, 1.0]), tau=[150.0, 1000.0, 300.0]
)
task = replace(free, subject_to=(*free.subject_to, outside(post, arm["tool"])))
around, straight = solve(task, grid=uniform(40)), solve(free, grid=uniform(40))
print(f"with the post {around.duration:.4f} s, without it {straight.duration:.4f} s")
plots.motion(around, cylindrical(), obstacles=[post])
