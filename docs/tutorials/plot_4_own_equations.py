"""
4. Equations of your own: a crane
=================================

``ocp`` knows no robots. Any ODE x' = f(x, u) in CasADi will do: here a trolley with a load on a rope, moved as fast
as possible from rest to rest without a swing at the end.
"""

# %%
# The system
# ----------
# Trolley position s, rope angle a; the force F moves the trolley of mass M, the load m hangs on a rope of length l.

import casadi as ca
import numpy as np

from ocp import System

M, m, length, g = 500.0, 1000.0, 8.0, 9.81
s, a, ds, da, F = (ca.SX.sym(name) for name in ("s", "a", "ds", "da", "F"))
sine, cosine = ca.sin(a), ca.cos(a)
dds = (F + m * sine * (length * da**2 + g * cosine)) / (M + m * sine**2)
dda = -(dds * cosine + g * sine) / length
x = ca.vertcat(s, a, ds, da)
crane = System(x, F, ca.SX(0, 1), ca.vertcat(ds, da, dds, dda), {"q": x[:2], "v": x[2:], "force": F}, {})

# %%
# The shortest time
# -----------------

from ocp import point_to_point, polish, solve, solve_to_accuracy, uniform, verify

task = point_to_point(crane, [0.0, 0.0], [10.0, 0.0], force=2000.0)
solution = solve(task, grid=uniform(50))
print(solution)
print(verify(solution))

# %%
# A wanted accuracy
# -----------------
# The grid is refined until the estimated error of the duration is below the tolerance.

for step in solve_to_accuracy(task, tol=1e-7, finish=polish, seconds=20.0):
    print(f"{step.duration:.9f} s, error estimated {step.accuracy.error:.0e} s")

# %%
# Costates
# --------
# The costate is the gradient of the shortest time with respect to the state: what a small push is worth at each time.
# The force switches where that of the trolley's speed, weighted by the equations, changes its sign.

import matplotlib.pyplot as plt

from models import plots

t = np.linspace(0.0, step.duration, 400)
plt.figure(figsize=(7, 3))
plt.plot(t, step.costate(t)[:, 2:], label=["costate of ds/dt [s/(m/s)]", "costate of da/dt [s/(rad/s)]"])
plt.xlabel("t [s]")
plt.legend()
if step.structure is not None:
    print(step.structure)
    plots.structure(step)
