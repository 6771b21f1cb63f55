"""Machines and states for the tests: random ones that a body can have, and what is known of them beforehand."""

from functools import cache

import casadi as ca
import numpy as np

from models import cylindrical, spherical, torus

MAKERS = {
    "cylinder": cylindrical,
    "cylinder_left": cylindrical,  # A < 0
    "cylinder_centred": cylindrical,  # A = 0
    "sphere": spherical,  # Theta_3_11 = Theta_3_22
    "sphere_general": spherical,
    "torus": torus,  # B = 0, diagonal inertia
    "torus_offset": torus,  # B != 0, diagonal inertia
    "torus_general": torus,  # B != 0, full tensors
}
NAMES = tuple(MAKERS)
VERTICAL = {"cylindrical": 0, "spherical": 1, "torus": 0}  # index of the coordinate that turns about e_3
SINGULAR = {"cylinder_centred": {"paper"}}  # frames that do not exist by parameters


def parameters(name, seed=0):
    """Return random parameters of the kind of machine called `name`."""
    rng = np.random.default_rng([NAMES.index(name), seed])
    if name.startswith("cylinder"):
        offset = {"cylinder": 1.0, "cylinder_left": -1.0, "cylinder_centred": 0.0}[name] * rng.uniform(0.05, 0.6)
        moments = {f"Theta_{k}_33": rng.uniform(0.3, 5.0) for k in (1, 2, 3)}
        masses = {"m_2": rng.uniform(2.0, 50.0), "m_3": rng.uniform(2.0, 30.0)}
        return {"A": offset, **masses, **moments, "l_T": rng.uniform(0.1, 0.8)}
    common = {
        "m_2": rng.uniform(5.0, 40.0),
        "m_3": rng.uniform(3.0, 20.0),
        "Theta_1_33": rng.uniform(0.5, 4.0),
        "l_T": rng.uniform(0.1, 0.8),
    }
    if name.startswith("sphere"):
        arm = diagonal(3, tensor(rng))
        if name == "sphere":
            del arm["Theta_3_22"]
            arm["Theta_3_33"] = arm["Theta_3_11"] * rng.uniform(0.1, 1.5)
        return {"s_2": rng.uniform(0.1, 0.5), **common, **diagonal(2, tensor(rng)), **arm}
    lengths = {"L_2": rng.uniform(0.4, 1.1), "L_3": rng.uniform(0.4, 1.1)}
    if name == "torus":
        return {**lengths, **common, **diagonal(2, tensor(rng)), **diagonal(3, tensor(rng))}
    offset = {"B": rng.uniform(0.1, 0.5) * rng.choice([-1.0, 1.0])}
    entries = diagonal if name == "torus_offset" else full
    return {**lengths, **offset, **common, **entries(2, tensor(rng)), **entries(3, tensor(rng))}


def tensor(rng):
    """Return the inertia tensor of a random cloud of mass, J = tr(S) 1 - S: no body breaks any inequality."""
    axes = rng.normal(size=(3, 3))
    second_moments = axes.T @ np.diag(rng.uniform(0.05, 0.4, 3)) @ axes
    return np.trace(second_moments) * np.eye(3) - second_moments


def diagonal(body, inertia):
    """Return the principal moments, named, of an inertia tensor."""
    return {f"Theta_{body}_{i + 1}{i + 1}": moment for i, moment in enumerate(np.linalg.eigvalsh(inertia))}


def full(body, inertia):
    """Return all six components, named, of an inertia tensor."""
    return {f"Theta_{body}_{i + 1}{j + 1}": inertia[i, j] for i in range(3) for j in range(i, 3)}


@cache
def machine(name, seed=0):
    """Return the random machine of a kind; the same object whenever it is asked for."""
    return MAKERS[name](**parameters(name, seed))


def frames_of(name):
    """Return the names of the frames that the machines of a kind have."""
    return [frame for frame in machine(name).frames if frame not in SINGULAR.get(name, set())]


EVERY_FRAME = [(name, frame) for name in NAMES for frame in frames_of(name)]


def states(arm, count=200, seed=1):
    """Return random q, v and tau, one column for each state; lengths of either sign, all angles."""
    rng = np.random.default_rng(seed)
    span = np.array([[np.pi if c.unit == "rad" else 1.2] for c in arm.coordinates])
    n = len(arm.coordinates)
    return span * rng.uniform(-1, 1, (n, count)), rng.uniform(-2.5, 2.5, (n, count)), rng.uniform(-60, 60, (n, count))


def evaluate(inputs, outputs, *columns):
    """Evaluate SX expressions at many points, one column of each input for one point; matrices become (n, m, K)."""
    function = ca.Function("f", inputs, [ca.densify(ca.vec(output)) for output in outputs])
    count = columns[0].shape[1]
    results = function.map(count).call([ca.DM(column) for column in columns])
    shapes = [(-1, count) if output.shape[1] == 1 else (*output.shape, count) for output in outputs]
    return [np.array(result).reshape(shape, order="F") for result, shape in zip(results, shapes, strict=True)]


def relative(got, expected, scale=None):
    """Return the largest error over all points, each relative to `scale` or to its largest expected component."""
    got, expected = np.asarray(got, dtype=float), np.asarray(expected, dtype=float)
    assert got.shape == expected.shape
    assert np.all(np.isfinite(got))
    size = np.max(np.abs(expected), axis=0) if scale is None else scale
    return float(np.max(np.abs(got - expected) / size))


def acceleration(system):
    """Return d^2 q / dt^2 of a System in any form, as d/dt of its signal v along its rate."""
    return ca.jtimes(system["v"], system.x, system.rate)


def kinetic_energy(arm):
    """Return T(q, v) summed over the bodies, from nothing but mass centres, rotation matrices and inertia."""
    total = ca.SX(0)
    for body in arm.bodies:
        velocity = ca.jacobian(body.centre, arm.q) @ arm.v
        turning = ca.reshape(ca.jacobian(ca.vec(ca.densify(body.orientation)), arm.q) @ arm.v, 3, 3)
        spin = body.orientation.T @ turning
        omega = ca.inv_skew((spin - spin.T) / 2)
        total += body.mass * ca.dot(velocity, velocity) / 2 + ca.dot(omega, body.inertia @ omega) / 2
    return total


def weight(arm, g):
    """Return U(q) of the bodies in a field g along -e_3."""
    return sum((body.mass * g * body.centre[2] for body in arm.bodies), ca.SX(0))
