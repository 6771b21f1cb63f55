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
    count = np.shape(columns[0])[1]
    results = function.map(count).call([ca.DM(np.array(column, dtype=float)) for column in columns])
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


def start(form, arm, q, v, frame="regular", added=None):
    """Return states x of the form called `form` at coordinates q and velocities v, one column for each state."""
    if form == "lagrange":
        return np.vstack([q, v])
    basis = arm.frame(frame, added)
    third = basis.matrix @ arm.v
    if form == "canonical":
        third = basis.metric @ third
    return np.vstack([q, *evaluate([arm.q, arm.v], [third], q, v)])


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


# Equations of motion by hand: P. Maisser, Modellgleichungen fuer Manipulatoren, in frames that are regular everywhere.


def sphere_by_hand(n, q, w, p, force, g):
    """Return q', w', p', H and the metric: (4.6) and (4.7), but with omega_2 = psi'."""
    theta, _, _, r = q
    s, c = np.sin(theta), np.cos(theta)
    own = n["m_2"] * n["s_2"] ** 2 + n["m_3"] * r**2
    theta11 = n["Theta_2_11"] + n["Theta_3_11"] + own
    d = n["Theta_3_11"] + n["Theta_2_22"] - n["Theta_2_33"] + own
    spin, m3, weight = n["Theta_3_33"], n["m_3"], (n["m_2"] * n["s_2"] + n["m_3"] * r) * g
    j = n["Theta_1_33"] + n["Theta_2_33"] + d * s**2
    m_theta, m_psi, m_phi, k_r = -force[0], force[1], force[2], force[3]
    w1, w2, w3, w4 = w
    q_rate = np.array([w1, w2, w3 - c * w2, w4])
    w_rate = [
        (-m_theta + weight * s - 2 * m3 * r * w1 * w4 + s * w2 * (d * c * w2 - spin * w3)) / theta11,
        (m_psi - c * m_phi + s * (w1 * (spin * w3 - 2 * d * c * w2) - 2 * m3 * r * s * w2 * w4)) / j,
        m_phi / spin,
        k_r / m3 - g * c + r * (w1**2 + s**2 * w2**2),
    ]
    p1, p2, p3, p4 = p
    v1, v2 = p1 / theta11, p2 / j
    p_rate = [
        -m_theta + weight * s + s * v2 * (d * c * v2 - p3),
        m_psi - c * m_phi + s * v1 * p3,
        m_phi,
        k_r - m3 * g * c + m3 * r * (v1**2 + s**2 * v2**2),
    ]
    energy = p1**2 / (2 * theta11) + p2**2 / (2 * j) + p3**2 / (2 * spin) + p4**2 / (2 * m3) + weight * c
    return q_rate, np.array(w_rate), np.array(p_rate), energy, (theta11, j, 0 * j + spin, 0 * j + m3)


def torus_by_hand(n, q, w, p, force, g):
    """Return q', w', p', H and the metric: (5.6) and (5.7), but with 2 omega_2,3 = alpha' -+ beta' / sigma."""
    m2, m3, l2, l3 = n["m_2"], n["m_3"], n["L_2"], n["L_3"]
    i2, i3 = n["Theta_2_22"] + m2 * l2**2 / 4 + m3 * l2**2, n["Theta_3_22"] + m3 * l3**2 / 4
    kappa, sigma = m3 * l2 * l3, np.sqrt(i2 / i3)
    b1 = n["Theta_1_33"] + n["Theta_2_11"] + n["Theta_3_11"]
    b2 = n["Theta_2_33"] - n["Theta_2_11"] + m2 * l2**2 / 4 + m3 * l2**2
    b3 = n["Theta_3_33"] - n["Theta_3_11"] + m3 * l3**2 / 4
    (c2, s2), (c3, s3), (c23, s23) = ((np.cos(a), np.sin(a)) for a in (q[1], q[2], q[1] + q[2]))
    g11 = b1 + b2 * c2**2 + b3 * c23**2 + kappa * c2 * c23
    x2, x3 = -s2 * (b2 * c2 + kappa * c23 / 2), -s23 * (b3 * c23 + kappa * c2 / 2)
    weight2, weight3 = (m2 / 2 + m3) * l2 * g, m3 / 2 * l3 * g
    m_1, m_2, m_3 = force[0], -force[1], -force[2]
    minus, plus = 2 * i2 - sigma * kappa * c3, 2 * i2 + sigma * kappa * c3
    w1, alpha_rate, beta_rate = w[0], w[1] + w[2], sigma * (w[2] - w[1])
    along2 = m_3 - m_2 - weight2 * c2 + x2 * w1**2
    along3 = -m_3 - weight3 * c23 + x3 * w1**2
    f_alpha, f_beta = along2 + kappa * s3 * beta_rate**2 / 2, along3 - kappa * s3 * alpha_rate**2 / 2
    w_rate = [
        (m_1 - 2 * w1 * (x2 * alpha_rate + x3 * beta_rate)) / g11,
        (f_alpha - sigma * f_beta) / minus,
        (f_alpha + sigma * f_beta) / plus,
    ]
    mixed = kappa * s3 * alpha_rate * beta_rate / 2
    n_alpha, n_beta = along2 + mixed, along3 - mixed
    p_rate = [m_1, n_alpha - sigma * n_beta, n_alpha + sigma * n_beta]
    energy = p[0] ** 2 / (2 * g11) + p[1] ** 2 / (2 * minus) + p[2] ** 2 / (2 * plus) + weight2 * s2 + weight3 * s23
    q_rate = np.array([w1, alpha_rate, beta_rate - alpha_rate])
    return q_rate, np.array(w_rate), np.array(p_rate), energy, (g11, minus, plus)


def instructions(system):
    return ca.Function("f", [system.x, system.u, system.p], [system.rate]).n_instructions()
