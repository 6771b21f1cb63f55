"""True against estimated errors on the problems whose optimum is known."""

from dataclasses import dataclass

import numpy as np
from catalogue import problems

from ocp import Control, estimate, legendre, lobatto, radau, solve, uniform

# Name, how it is made, half a unit of the last digit of its optimum.
KNOWN = {
    "COPS robot arm": (problems.cops, 5e-13),
    "two-link arm": (problems.two_link, 5e-13),
    "double integrator": (problems.double_integrator_2d, 0.0),
    "lift up": (problems.lift_fastest, 0.0),
    "lift down": (lambda: problems.lift_fastest(up=False), 0.0),
    "lift up, speed limit": (lambda: problems.lift_fastest(speed=1.2), 0.0),
    "lift down, speed limit": (lambda: problems.lift_fastest(up=False, speed=1.2), 0.0),
    "lift weightless": (lambda: problems.lift_fastest(g=0.0), 0.0),
    "lift, effort, fixed duration": (lambda: problems.lift_cheapest(0.8), 0.0),
    "lift, effort, free duration": (problems.lift_cheapest, 0.0),
    "lift, time and effort": (problems.lift_compromise, 0.0),
    "Bryson-Denham, arc": (lambda: problems.bryson_denham(0.1), 0.0),
    "Bryson-Denham, touch": (lambda: problems.bryson_denham(0.2), 0.0),
    "Bryson-Denham, free": (lambda: problems.bryson_denham(0.3), 0.0),
    "brachistochrone": (problems.brachistochrone, 5e-15),
    "straight line, cylindrical": (lambda: problems.straight_line("cylindrical"), 5e-11),
    "straight line, spherical": (lambda: problems.straight_line("spherical"), 5e-11),
    "straight line, torus": (lambda: problems.straight_line("torus"), 5e-11),
    "straight line in least time, cylindrical": (lambda: problems.straight_line("cylindrical", True), 5e-11),
    "straight line in least time, spherical": (lambda: problems.straight_line("spherical", True), 5e-11),
    "straight line in least time, torus": (lambda: problems.straight_line("torus", True), 5e-11),
    "container crane": (problems.crane, 5e-8),
    "cart-pole": (problems.cart_pole, 5e-6),
}
# Without those whose solves themselves take long.
QUICK = tuple(
    name for name in KNOWN if not name.startswith(("straight line in least", "brachisto", "lift, effort, free"))
)
SCHEMES = (
    *(radau(d, c) for d in (2, 3, 4) for c in Control),
    *(legendre(3, c) for c in (Control.CONSTANT, Control.COLLOCATED)),
    *(lobatto(3, c) for c in (Control.CONSTANT, Control.LINEAR, Control.COLLOCATED)),
)
GRIDS = (10, 20, 40)
ROUNDING = 1e-11  # share of the cost; what the solver leaves of an exact discretisation


@dataclass(frozen=True)
class Case:
    """One solve of one problem: the error of its cost, and the estimate of it."""

    name: str
    scheme: str
    elements: int
    true: float
    estimated: float
    rounding: bool  # the true error is not above rounding or the digits of the optimum

    @property
    def bounded(self) -> bool:
        """Whether the estimate is not below the true error."""
        return self.true <= self.estimated

    @property
    def ratio(self) -> float:
        """Estimated over true error."""
        return self.estimated / max(self.true, 1e-300)


def measure(names=KNOWN, schemes=SCHEMES, grids=GRIDS):
    """Yield the cases; solves that fail or find another local optimum are no cases."""
    for name in names:
        make, digits = KNOWN[name]
        known = make()
        for scheme in schemes:
            for elements in grids:
                solution = solve(known.problem, scheme, uniform(elements), guess=known.guess)
                if not solution.ok or solution.cost > 1.5 * known.cost:
                    continue
                true = abs(solution.cost - known.cost)
                small = true <= max(ROUNDING * abs(known.cost), 5.0 * digits)
                yield Case(name, repr(scheme), elements, true, estimate(solution).cost, small)


def summary(cases):
    """Return the share of bounded cases, and the median ratio, of those above rounding."""
    counted = [case for case in cases if not case.rounding]
    return float(np.mean([case.bounded for case in counted])), float(np.median([case.ratio for case in counted]))
