"""
Elastic joints
==============

The same motion with rigid joints and with joints that yield. The motors behind the springs have states of their own,
and the motion ends only when the springs are at rest, too.
"""

from models import plots, torus
from models.effects import ElasticDrive, Gravity
from models.forms import lagrange
from ocp import point_to_point, solve, uniform

ends, limit = ([0.0, 0.4, -0.9], [1.0, 0.8, -1.3]), [250.0, 600.0, 220.0]
rigid = solve(point_to_point(lagrange(torus(), [Gravity()]), *ends, tau=limit), grid=uniform(30))
springs = ElasticDrive((2e4, 3e4, 1.5e4), (0.4, 0.6, 0.3), (20.0, 20.0, 10.0))
arm = lagrange(torus(), [Gravity(), springs])
elastic = solve(point_to_point(arm, *ends, motor_tau=limit), grid=uniform(40))
print(f"rigid {rigid.duration:.4f} s, elastic {elastic.duration:.4f} s ({elastic.status.name.lower()})")
plots.motion(elastic, torus())
