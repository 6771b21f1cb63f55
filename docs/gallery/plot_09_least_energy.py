"""
Least effort instead of least time
==================================

The same task in twice the shortest time: the drives of the cheapest motion never meet their limits, and lose a
fraction of the heat.
"""

import casadi as ca
import numpy as np

from models import cylindrical, plots
from models.effects import Gravity
from models.forms import canonical
from ocp import Bolza, Control, Fixed, point_to_point, radau, solve, uniform

arm = canonical(cylindrical(), [Gravity()])
ends, limit = ([0.0, 0.2, 0.6], [2.0, 0.8, 0.8]), np.array([150.0, 1000.0, 300.0])
fast = solve(point_to_point(arm, *ends, tau=limit), grid=uniform(40))
heat = Bolza(running=ca.sumsqr(arm["tau"] / ca.DM(limit)))
easy = point_to_point(arm, *ends, tau=limit, minimise=heat, horizon=Fixed(2.0 * fast.duration))
cheap = solve(easy, radau(3, control=Control.LINEAR), uniform(30))
t = np.linspace(0.0, fast.duration, 2001)
spent = np.trapezoid(np.sum((fast.signal("tau", t) / limit) ** 2, axis=1), t)
print(f"integral of (tau / limit)^2: fastest {spent:.3f} s, cheapest in twice the time {cheap.cost:.3f} s")
plots.motion(cheap, cylindrical())
