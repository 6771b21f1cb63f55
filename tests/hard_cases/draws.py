"""Random machines, states and effects of the stability suite: ratios over six decades, every draw from a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from models import Parameter, cylindrical, spherical, torus
from models.effects import Coulomb, Counterbalance, Gravity, LaggedDrive, Payload, RotorInertia, ToolForce, Viscous
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from ocp.checks import Array

Maker = Callable[..., Manipulator]
# Kinds of machines differ in the structure of their metric: offset or none, symmetric arm, full tensors.
KINDS: Mapping[str, Maker] = {
    "cylinder": cylindrical,
    "cylinder without offset": cylindrical,
    "sphere": spherical,
    "sphere, Theta_3_11 != Theta_3_22": spherical,
    "torus": torus,
    "torus with offset": torus,
    "torus, full tensors": torus,
}
# Of each machine the kind with all its parameters.
WHOLE = {
    "cylindrical": "cylinder",
    "spherical": "sphere, Theta_3_11 != Theta_3_22",
    "torus": "torus, full tensors",
}
DECADES = 3.0  # to either side: parameters of one dimension differ by up to six decades
NEAR = 0.25  # share of the coordinates that are drawn near a special position of the machine


def parameters(kind: str, random: np.random.Generator, decades: float = DECADES) -> dict[str, float]:
    """Return parameters of a machine, each size 10^e with e uniform in [-decades, decades] (lengths: half of it).

    Args:
        kind: one of KINDS.
        random: generator.
        decades: to either side of one.
    """

    def size(width: float = decades) -> float:
        return float(10.0 ** random.uniform(-width, width))

    def length() -> float:
        return size(decades / 2.0)

    sign = random.choice([-1.0, 1.0])
    common = {"m_2": size(), "m_3": size(), "Theta_1_33": size(), "l_T": length()}
    if kind.startswith("cylinder"):
        offset = 0.0 if "without" in kind else sign * length()
        return {**common, "A": offset, "Theta_2_33": size(), "Theta_3_33": size()}
    bodies = {2: size() * tensor(random, decades / 2.0), 3: size() * tensor(random, decades / 2.0)}
    if kind.startswith("sphere"):
        common |= {"s_2": length(), **principal(2, bodies[2]), **principal(3, bodies[3])}
        if kind == "sphere":  # a symmetric arm: from a needle to a disc
            del common["Theta_3_22"]
            common["Theta_3_33"] = common["Theta_3_11"] * min(size(decades), 2.0)
        return common
    entries = full if "full" in kind else principal
    offset = 0.0 if kind == "torus" else sign * length()
    return {**common, "L_2": length(), "L_3": length(), "B": offset, **entries(2, bodies[2]), **entries(3, bodies[3])}


def tensor(random: np.random.Generator, decades: float) -> Array:
    """Return the inertia tensor (3, 3) of a cloud of mass, J = tr(S) 1 - S, so that a body may have it.

    Args:
        random: generator.
        decades: of the principal second moments S below one.
    """
    axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
    second = axes @ np.diag(10.0 ** random.uniform(-decades, 0.0, 3)) @ axes.T
    inertia = np.trace(second) * np.eye(3) - second
    return np.asarray((inertia + inertia.T) / 2.0)


def principal(body: int, inertia: Array) -> dict[str, float]:
    """Return the principal moments of a tensor (3, 3) as parameters of a body, in random order of the axes."""
    moments = np.linalg.eigvalsh(inertia)
    return {f"Theta_{body}_{i + 1}{i + 1}": float(moment) for i, moment in enumerate(np.roll(moments, body))}


def full(body: int, inertia: Array) -> dict[str, float]:
    """Return all components of a tensor (3, 3) as parameters of a body."""
    return {f"Theta_{body}_{i + 1}{j + 1}": float(inertia[i, j]) for i in range(3) for j in range(i, 3)}


def symbolic(machine: str) -> Manipulator:
    """Return a machine whose parameters all stay symbols, so that one function serves all of their values.

    Args:
        machine: key of WHOLE.
    """
    kind = WHOLE[machine]
    drawn = parameters(kind, np.random.default_rng(1), 0.5)
    return KINDS[kind](**{name: Parameter(value) for name, value in drawn.items()})


def states(
    machine: Manipulator, given: Mapping[str, float], count: int, random: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Return q, v and tau (n, count); a quarter of the angles lies 1e-7 .. 1 rad from a multiple of pi / 2.

    Lengths are of the sizes of the machine, of either sign or nearly zero; velocities and torques over six decades.

    Args:
        machine: whose coordinates are meant.
        given: its parameters.
        count: number of states.
        random: generator.
    """
    n = len(machine.coordinates)
    sizes = [abs(given[name]) for name in ("A", "s_2", "l_T") if given.get(name)]
    q = np.empty((n, count))
    for i, coordinate in enumerate(machine.coordinates):
        near = 10.0 ** random.uniform(-7.0, 0.0, count) * random.choice([-1.0, 1.0], count)
        if coordinate.unit == "rad":
            special, anywhere = np.pi / 2.0 * random.integers(-2, 3, count), random.uniform(-np.pi, np.pi, count)
            q[i] = np.where(random.random(count) < NEAR, special + near, anywhere)
        else:
            typical = random.choice(sizes, count) * random.normal(size=count)
            q[i] = np.where(random.random(count) < NEAR, near * typical, typical)
    v = random.normal(size=(n, count)) * 10.0 ** random.uniform(-3.0, 3.0, (1, count))
    tau = random.normal(size=(n, count)) * 10.0 ** random.uniform(-3.0, 3.0, (1, count))
    return q, v, tau


def effects(random: np.random.Generator, n: int, decades: float = 1.0, lagged: float = 0.15) -> list[Effect]:
    """Return some of seven effects with random parameters, none at all in one draw of 2^7.

    Args:
        random: generator.
        n: number of drives.
        decades: of every size to either side of its usual one.
        lagged: probability that the drives lag.
    """

    def size(usual: float) -> float:
        return float(usual * 10.0 ** random.uniform(-decades, decades))

    def each(usual: float) -> tuple[float, ...]:
        return tuple(size(usual) for _ in range(n))

    down = random.normal(size=3)
    possible: Sequence[Effect] = (
        Gravity(size(9.81), tuple(down / np.linalg.norm(down))) if random.random() < 0.5 else Gravity(size(9.81)),
        Payload(size(3.0), tuple(random.normal(size=3) * 0.1)) if random.random() < 0.5 else Payload(size(3.0)),
        Viscous(each(1.0)),
        Coulomb(each(1.0), each(0.1)),
        RotorInertia(size(1e-4), each(50.0)),
        ToolForce(tuple(random.normal(size=3) * size(5.0))),
        Counterbalance(size(3.0), at=tuple(random.normal(size=3) * 0.2)),
    )
    lag = [LaggedDrive(size(0.02))] if random.random() < lagged else []
    return [effect for effect in possible if random.random() < 0.5] + lag
