"""
4. Equations of your own: a crane, a double pendulum
====================================================

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

# %%
# A double pendulum on a cart
# ---------------------------
# Longer equations are better derived than written: kinetic and potential energy as expressions, Lagrange's equations by
# differentiation. Two loads hang below each other on a cart that is pushed from rest to rest over one metre.

q, v, push = ca.SX.sym("q", 3), ca.SX.sym("v", 3), ca.SX.sym("push")
cart, load, rope = 2.0, 0.5, 0.5
upper = ca.vertcat(q[0] + rope * ca.sin(q[1]), -rope * ca.cos(q[1]))
lower = upper + rope * ca.vertcat(ca.sin(q[2]), -ca.cos(q[2]))
speeds = [ca.jacobian(point, q) @ v for point in (upper, lower)]
kinetic = cart * v[0] ** 2 / 2 + sum(load * ca.dot(speed, speed) / 2 for speed in speeds)
potential = load * g * (upper[1] + lower[1])
metric = ca.hessian(kinetic, v)[0]
forces = ca.vertcat(push, 0, 0) - ca.gradient(potential, q) + ca.gradient(kinetic, q) - ca.jacobian(metric @ v, q) @ v
rate = ca.vertcat(v, ca.solve(metric, forces))
pendulum = System(ca.vertcat(q, v), push, rate=rate, signals={"q": q, "v": v, "push": push})

best = polish(solve(point_to_point(pendulum, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], push=10.0), grid=uniform(50)))
print(best.structure)
print(verify(best))
plots.structure(best)

t = np.linspace(0.0, best.duration, 400)
plt.figure(figsize=(7, 3))
plt.plot(t, best.costate(t)[:, 3:], label=["costate of the cart's speed", "of the upper rope", "of the lower rope"])
plt.xlabel("t [s]")
plt.legend()
