"""Long horizons: energy and momentum over a million steps and ten thousand swings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from models import Manipulator, spherical, torus
from models.effects import Counterbalance, Gravity
from models.forms import canonical, lagrange
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from ocp import System, integrators, simulate
from ocp.checks import Array
from ocp.integrators.contracts import Method

EPS = float(np.finfo(float).eps)
G = 9.81
SETTLED = 10_000  # steps, a hundred swings: the motion has been everywhere on its torus about once
BOUNDED = 2.0  # the bound of the energy error does not depend on the time (Hairer, Lubich, Wanner, IX.8)
POWER = 0.1  # of the growth N^0 or N^1 of the energy error, read between two decades
SPRING, REST = 4000.0, 0.7  # along the arm of the spherical machine [N/m], [m]


@dataclass(frozen=True)
class Swing:
    """A hanging arm that swings, its conserved quantities written out by hand."""

    machine: Manipulator
    effects: tuple[Effect, ...]
    q: Sequence[float]
    v: Sequence[float]
    conserved: Callable[[Array, Array], Array]  # q, v (K, n) -> (K, m): energy, momenta
    step: float  # [s]; about a hundredth of a swing

    def start(self, form: str) -> tuple[System, Array]:
        """Return the system of a form with its state at the start."""
        if form == "lagrange":
            return lagrange(self.machine, self.effects), np.concatenate([self.q, self.v])
        metric = ca.Function("metric", [self.machine.q], [assemble(self.machine, self.effects).metric])
        momenta = np.array(metric(self.q)) @ np.array(self.v)
        return canonical(self.machine, self.effects, frame="coordinate"), np.concatenate([self.q, momenta])


def hanging_torus() -> Swing:
    """Return the torus-like arm hanging down, both links swinging, the column turning: 100 steps in a swing of 2 s."""
    return Swing(torus(), (Gravity(G),), (0.0, 0.3 - np.pi / 2, 0.2), (0.4, 0.0, 0.0), torus_constants, 0.02)


def hanging_sphere() -> Swing:
    """Return the spherical machine as an elastic spherical pendulum, its arm turning about itself."""
    hung = Counterbalance(stiffness=SPRING, free_length=REST, body=spherical().bodies[2].name)
    return Swing(spherical(), (Gravity(G), hung), (2.8, 0.1, 0.2, 0.75), (0.2, 0.5, 1.0, 0.0), sphere_constants, 0.01)


def torus_constants(q: Array, v: Array) -> Array:
    """Return energy and momentum about the vertical of the torus-like arm, B = 0, diagonal inertia, in alpha, beta."""
    n = torus().nominal
    alpha, beta, rate = q[:, 1], q[:, 1] + q[:, 2], v[:, 1] + v[:, 2]
    mass = n["m_2"] / 4 + n["m_3"]
    i_2, i_3 = n["Theta_2_22"] + mass * n["L_2"] ** 2, n["Theta_3_22"] + n["m_3"] * n["L_3"] ** 2 / 4
    kappa = n["m_3"] * n["L_2"] * n["L_3"]
    g_11 = (
        n["Theta_1_33"] + n["Theta_2_11"] + n["Theta_3_11"] + kappa * np.cos(alpha) * np.cos(beta)
        + (n["Theta_2_33"] - n["Theta_2_11"] + mass * n["L_2"] ** 2) * np.cos(alpha) ** 2
        + (n["Theta_3_33"] - n["Theta_3_11"] + n["m_3"] * n["L_3"] ** 2 / 4) * np.cos(beta) ** 2
    )  # fmt: skip
    kinetic = g_11 * v[:, 0] ** 2 + i_2 * v[:, 1] ** 2 + i_3 * rate**2 + kappa * np.cos(beta - alpha) * v[:, 1] * rate
    weight = (n["m_2"] / 2 + n["m_3"]) * n["L_2"] * np.sin(alpha) + n["m_3"] * n["L_3"] / 2 * np.sin(beta)
    return np.stack([kinetic / 2 + G * weight, g_11 * v[:, 0]], axis=1)


def sphere_constants(q: Array, v: Array) -> Array:
    """Return energy and the momenta of psi and phi of the spherical machine on its spring."""
    n = spherical().nominal
    theta, r = q[:, 0], q[:, 3]
    far = n["m_2"] * n["s_2"] ** 2 + n["m_3"] * r**2
    along = n["Theta_2_11"] + n["Theta_3_11"] + far
    fixed = n["Theta_1_33"] + n["Theta_2_33"]
    across = fixed + (n["Theta_3_11"] + n["Theta_2_22"] - n["Theta_2_33"] + far) * np.sin(theta) ** 2
    spin = n["Theta_3_33"] * (v[:, 2] + np.cos(theta) * v[:, 1])
    kinetic = along * v[:, 0] ** 2 + across * v[:, 1] ** 2 + spin**2 / n["Theta_3_33"] + n["m_3"] * v[:, 3] ** 2
    potential = G * (n["m_2"] * n["s_2"] + n["m_3"] * r) * np.cos(theta) + SPRING * (r - REST) ** 2 / 2
    return np.stack([kinetic / 2 + potential, across * v[:, 1] + np.cos(theta) * spin, spin], axis=1)


def errors(swing: Swing, form: str, method: Method, steps: int) -> tuple[Array, Array, str]:
    """Return numbers of steps, largest errors of all constants up to them (K, m) as a share of their size, message.

    The energy is compared with the largest change of the potential, momenta with themselves.
    """
    system, x0 = swing.start(form)
    counts = np.unique(np.concatenate([np.arange(0, 101), np.arange(0, steps + 1, max(1, steps // 20_000))]))
    motion = simulate(system, x0, np.zeros(len(swing.q)), swing.step * counts, method=method)
    q, v = motion.signal("q"), motion.signal("v")
    result, still = swing.conserved(q, v), swing.conserved(q, 0.0 * v)
    size = np.concatenate([[np.ptp(still[:, 0])], np.abs(result[0, 1:])])
    return counts, np.maximum.accumulate(np.abs(result - result[0]), axis=0) / size, motion.message


def decades(swing: Swing, form: str, method: Method, steps: int, drifts: bool) -> Iterator[Figure]:
    """Yield the energy error after 1, 10, ... steps, and the power of its growth over the last decade.

    A bounded error stays within twice that of the first hundred swings; one that drifts grows like the steps.
    """
    counts, all_errors, message = errors(swing, form, method, steps)
    energy = all_errors[:, 0]
    settled = float(energy[counts <= SETTLED][-1])
    for n in 10 ** np.arange(round(np.log10(steps)) + 1):
        grown = max(1.0, n / SETTLED) if drifts else 1.0
        yield Figure(float(energy[counts <= n][-1]), BOUNDED * grown * settled, float(n), note=message)
    power = np.log10(energy[-1] / energy[counts <= steps // 10][-1])
    yield Figure(float(abs(power - float(drifts))), POWER, note=f"grows like N^{power:.3f}")


def momenta(swing: Swing, form: str, method: Method, steps: int, each: float) -> Iterator[Figure]:
    """Yield the error of the cyclic momenta after 1, 10, ... steps, allowed to grow by `each` in a step."""
    counts, all_errors, message = errors(swing, form, method, steps)
    # Momenta are formed from q and v, twenty operations of the size of their largest term.
    for n in 10 ** np.arange(round(np.log10(steps)) + 1):
        worst = float(np.max(all_errors[counts <= n][-1, 1:]))
        yield Figure(worst, 1e2 * EPS + float(n) * each, float(n), note=message)


def order_of_the_bound(name: str, order: int) -> Iterator[Figure]:
    """Yield how far halving the step is from dividing the energy error by 2^order, over a hundred swings."""
    make = BOUNDED_METHODS[name]
    swing = hanging_torus()
    results = []
    for part in (1, 2):
        shorter = Swing(swing.machine, swing.effects, swing.q, swing.v, swing.conserved, swing.step / part)
        _, every, _ = errors(shorter, "canonical", make(shorter.step), SETTLED * part)
        results.append(float(every[-1, 0]))
    # The next term of the error is an order or two higher, with steps of a hundredth of a swing.
    yield Figure(
        float(abs(np.log2(results[0] / results[1]) - order)), 0.5, note=f"order {np.log2(results[0] / results[1]):.2f}"
    )


BOUNDED_METHODS: dict[str, Callable[[float], Method]] = {
    "gauss(1)": partial(integrators.gauss, 1),
    "gauss(2)": partial(integrators.gauss, 2),
    "stoermer_verlet": integrators.stoermer_verlet,
}
ORDERS = {"gauss(1)": 2, "gauss(2)": 4, "stoermer_verlet": 2}
DRIFTING: dict[str, Callable[[float], Method]] = {
    "runge_kutta_4": integrators.runge_kutta_4,
    "dormand_prince_8 at 1e-9": lambda _: integrators.dormand_prince_8(1e-9, 1e-9),
}


def _energy(name: str, steps: int, drifts: bool) -> Callable[[], Iterator[Figure]]:
    swing = hanging_torus()
    method = (DRIFTING if drifts else BOUNDED_METHODS)[name](swing.step)
    return lambda: decades(swing, "lagrange" if drifts else "canonical", method, steps, drifts)


def _momentum(form: str, method: Callable[[float], Method], steps: int, each: float) -> Callable[[], Iterator[Figure]]:
    swing = hanging_sphere()
    return lambda: momenta(swing, form, method(swing.step), steps, each)


def _cases() -> Iterator[Case]:
    group, energy, steps = "long horizons", "energy error, share of the energy that swings", "steps"
    for count, fast in ((100_000, True), (1_000_000, False)):
        words = "1e3 swings" if fast else "1e4 swings"
        for name in BOUNDED_METHODS if not fast else ("gauss(2)",):
            yield Case(group, f"{name} over {words}: bounded", energy, steps, _energy(name, count, False), fast)
        for name in DRIFTING if not fast else ("runge_kutta_4",):
            yield Case(group, f"{name} over {words}: linear", energy, steps, _energy(name, count, True), fast)
    for name in BOUNDED_METHODS:
        yield Case(group, f"{name}: order of the bound", "order", "", partial(order_of_the_bound, name, ORDERS[name]))
    share = "error of the momenta of psi and phi, relative"
    kept = _momentum("canonical", BOUNDED_METHODS["gauss(1)"], 1_000_000, EPS)
    yield Case(group, "momenta in canonical coordinates: rounding only", share, steps, kept, fast=False)
    tolerance = 1e-9
    loose = _momentum("lagrange", lambda _: integrators.dormand_prince_8(tolerance, tolerance), 100_000, tolerance)
    yield Case(group, "momenta in Lagrange form, dormand_prince_8: a tolerance a step", share, steps, loose, fast=False)


CASES: tuple[Case, ...] = tuple(_cases())
