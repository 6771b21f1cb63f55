"""Studies with known results, for tests in several processes."""

import os
import time
from pathlib import Path

import casadi as ca

from ocp import Ipopt, Problem, Study, System, along, end, start, uniform

# m a = u, |u| <= limit, rest to rest over d: T = 2 sqrt(m d / limit).
STATE, CONTROL, MASS = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
CART = System(STATE, CONTROL, MASS, ca.vertcat(STATE[1], CONTROL / MASS), {"q": STATE[0], "v": STATE[1]}, {"mass": 1.0})
QUIET = Ipopt(tol=1e-10, progress=False)


def cart(limit=1.0, distance=1.0):
    return Problem(CART, subject_to=(
        start(CART.x, 0.0), end(CART.x, [distance, 0.0]), along(CART.u, -limit, limit)))  # fmt: skip


def carts(**changes):
    given = dict(over={"mass": [0.5, 1.0, 2.0, 4.0], "limit": [0.5, 1.0, 2.0]}, grid=uniform(10), solver=QUIET)
    return Study(cart, **{**given, **changes})


def wide(store):
    axes = {"mass": [0.5 + 0.25 * k for k in range(12)], "limit": [0.5 + 0.1 * k for k in range(15)]}
    return carts(over=axes, store=store, grid=uniform(20))


def slow_square(x, folder):
    """Take some time, and leave a mark that the case was computed."""
    time.sleep(0.02)
    with (Path(folder) / "marks").open("a") as file:
        file.write(f"{x}\n")
    if x == 13:
        raise ArithmeticError("13 is\nunlucky")
    return {"square": float(x * x), "parity": x % 2 == 0}


def squares(folder, count=40):
    return Study(slow_square, over={"x": range(count), "folder": [str(folder)]}, store=Path(folder) / "s.db")


def dies(x):
    if x == 3:
        os._exit(1)
    return x


def plain(a, b=2.0):
    return a + b


def with_memory(solution):
    """Note the memory that the process has [MB]; Linux only."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return {"duration": solution.duration, "memory": pages * os.sysconf("SC_PAGE_SIZE") / 1e6}
