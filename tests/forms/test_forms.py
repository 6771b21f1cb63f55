"""The three forms against each other, against the bodies, against conservation laws and against closed solutions."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import (
    EVERY_FRAME,
    NAMES,
    VERTICAL,
    acceleration,
    evaluate,
    frames_of,
    kinetic_energy,
    machine,
    relative,
    start,
    states,
    weight,
)

from models import cylindrical, inverse_dynamics, recover, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from ocp import simulate

FORMS = (lagrange, hamel, canonical)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
G = 9.81


@cache
def system_of(form, name, frame="regular"):
    return form(machine(name), [Gravity(G)], frame)


@cache
def bodies(name):
    """Return states and what follows for them from the bodies alone: accelerations, energy, size of its terms."""
    arm = machine(name)
    q, v, tau = states(arm)
    kinetic, potential = kinetic_energy(arm), weight(arm, G)
    momentum = ca.gradient(kinetic, arm.v)
    bias = ca.jtimes(momentum, arm.q, arm.v) - ca.gradient(kinetic - potential, arm.q)
    wanted = [ca.jacobian(momentum, arm.v), bias, kinetic, potential]
    metric, bias, kinetic, potential = evaluate([arm.q, arm.v], wanted, q, v)
    a = np.linalg.solve(np.moveaxis(metric, 2, 0), (tau - bias).T[:, :, None])[:, :, 0].T
    return q, v, tau, a, kinetic + potential, kinetic + np.abs(potential)


@EACH_FORM
@pytest.mark.parametrize(("name", "frame"), EVERY_FRAME)
def test_every_form_in_every_frame_moves_the_bodies(name, frame, form):
    q, v, tau, a, energy, size = bodies(name)
    system = system_of(form, name, frame)
    x = start(form.__name__, machine(name), q, v, frame)
    wanted = [acceleration(system), system["energy"], system["power"], system["v"], system["q"], system["tau"]]
    got = evaluate([system.x, system.u], wanted, x, tau)
    assert relative(got[0], a) < 1e-11
    assert relative(got[1][0], energy[0], size[0]) < 1e-11
    assert relative(got[2][0], np.sum(tau * v, axis=0), np.max(np.abs(tau * v), axis=0)) < 1e-11
    assert relative(got[3], v) < 1e-11
    assert np.array_equal(got[4], q)
    assert np.array_equal(got[5], tau)


@pytest.mark.parametrize("name", NAMES)
def test_inverse_dynamics_undoes_forward_dynamics(name):
    arm = machine(name)
    q, v, tau = states(arm, seed=2)
    torques = inverse_dynamics(arm, [Gravity(G)])
    for form in FORMS:
        system = system_of(form, name)
        x = start(form.__name__, arm, q, v)
        a, rate = evaluate([system.x, system.u], [acceleration(system), system.rate], x, tau)
        assert relative(np.array(torques.map(200)(q, v, a, np.zeros((0, 200)))), tau) < 1e-11
        recovered = recover(system, arm, [Gravity(G)]).map(200)(x, rate, np.zeros((0, 200)))
        for got, expected in zip(recovered, (q, v, a, tau), strict=True):
            assert relative(np.array(got), expected) < 1e-11


@EACH_FORM
@pytest.mark.parametrize(("name", "frame"), EVERY_FRAME)
def test_balances_of_energy_and_of_momentum(name, frame, form):
    arm, system = machine(name), system_of(form, name, frame)
    q, v, tau = states(arm, seed=3)
    x = start(form.__name__, arm, q, v, frame)
    vertical = arm.metric[VERTICAL[arm.name], :] @ system["v"]
    wanted = [
        ca.jtimes(system["energy"], system.x, system.rate),
        system["power"],
        # The rates are sums of terms that cancel; what is left is held against the largest of them.
        ca.norm_inf(ca.gradient(system["energy"], system.x) * system.rate),
        ca.jtimes(vertical, system.x, system.rate),
        ca.norm_inf(ca.gradient(vertical, system.x) * system.rate),
    ]
    work, power, most_work, turning, most_turning = evaluate([system.x, system.u], wanted, x, tau)
    assert relative(work, power, most_work) < 1e-11
    # gravity has no moment about e_3, so the drive there is all that changes the momentum
    assert relative(turning[0], tau[VERTICAL[arm.name]], most_turning[0]) < 1e-11


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_conservation_along_a_motion(name, form):
    arm, system = machine(name), system_of(form, name)
    q, v, tau = states(arm, 1, seed=4)
    x, drives = start(form.__name__, arm, q, v / 2)[:, 0], tau[:, 0] / 4
    drives[VERTICAL[arm.name]] = 0.0
    vertical = arm.metric[VERTICAL[arm.name], :] @ system["v"]
    free = simulate(system, x, 0 * drives, 0.5)
    driven = simulate(system, x, drives, 0.5)
    assert free.ok
    assert driven.ok
    energy = free.signal("energy")
    assert np.max(np.abs(energy / energy[0] - 1)) < 1e-9
    for motion in (free, driven):
        momentum = motion.signal(vertical)
        assert np.max(np.abs(momentum / momentum[0] - 1)) < 1e-9
    assert np.ptp(driven.signal("energy")) > 1e-3 * abs(energy[0, 0])


# Closed solutions. The bodies are idealised: exactly without the inertia that the solution leaves out, as that
# still leaves a regular metric in each case.


def begin(form, arm, q, v):
    """Return the state (nx,) of a form at coordinates q and velocities v."""
    return start(form.__name__, arm, np.transpose([q]), np.transpose([v]))[:, 0]


@EACH_FORM
def test_free_point_mass_in_cylindrical_coordinates(form):
    arm = cylindrical(A=0.0, m_2=0.0, m_3=2.5, Theta_1_33=0.0, Theta_2_33=0.0, Theta_3_33=0.0, physical=False)
    r0, w0 = 0.7, 1.9
    system = form(arm)
    motion = simulate(
        system, start(form.__name__, arm, [[0.0], [0.0], [r0]], [[w0], [0.3], [0.0]])[:, 0], np.zeros(3), 1.5
    )
    phi, xi, r = motion.signal("q").T
    t = motion.t
    assert motion.ok
    assert np.max(np.abs(r - np.sqrt(r0**2 + (r0 * w0 * t) ** 2))) < 1e-11
    assert np.max(np.abs(phi - np.arctan(w0 * t))) < 1e-11
    assert np.max(np.abs(xi - 0.3 * t)) < 1e-11
    assert np.max(np.abs(motion.signal(arm.metric[0, :] @ system["v"]) - 2.5 * r0**2 * w0)) < 1e-11


def test_bead_on_a_rod_kept_turning():
    arm = cylindrical(A=0.0, m_2=0.0, m_3=2.5, Theta_1_33=0.0, Theta_2_33=0.0, Theta_3_33=0.0, physical=False)
    r0, w, t = 0.4, 1.3, np.linspace(0.0, 1.5, 31)
    r, speed, zero = r0 * np.cosh(w * t), r0 * w * np.sinh(w * t), 0 * t
    q, v, a = (w * t, zero, r), (zero + w, zero, speed), (zero, zero, w**2 * r)
    torques = np.array(inverse_dynamics(arm).map(31)(np.array(q), np.array(v), np.array(a), np.zeros((0, 31))))
    expected = 2.5 * r0**2 * w**2 * np.sinh(2 * w * t)
    assert np.max(np.abs(torques[0] - expected)) < 1e-13 * np.max(expected)
    assert np.max(np.abs(torques[1:])) < 1e-13 * np.max(expected)


@pytest.mark.parametrize("spin", [0.0, 6.0])
@EACH_FORM
def test_free_symmetric_top(form, spin):
    # Neither the column nor the swivelling body has inertia about the arm: only the arm itself spins.
    none = {"Theta_1_33": 0.0, "Theta_2_33": 0.0}
    across = {"Theta_2_11": 0.8, "Theta_2_22": 0.8, "Theta_3_11": 0.5}
    arm = spherical(**none, **across, Theta_3_33=0.2, s_2=0.3, m_2=4.0, m_3=2.0, physical=False)
    system = form(arm)
    theta, psi_dot = 1.1, 0.9
    v = [0.7, psi_dot, spin - np.cos(theta) * psi_dot, 0.4]
    motion = simulate(system, begin(form, arm, [theta, 0.3, 0.2, 0.9], v), np.zeros(4), 1.0)
    assert motion.ok
    (theta, psi, _, r), v = motion.signal("q").T, motion.signal("v").T
    n = np.array([-np.sin(psi) * np.sin(theta), np.cos(psi) * np.sin(theta), np.cos(theta)])
    across = np.array([-np.sin(psi) * np.cos(theta), np.cos(psi) * np.cos(theta), -np.sin(theta)])
    around = np.array([-np.cos(psi), -np.sin(psi), 0 * psi]) * np.sin(theta)
    turning = v[0] * across + v[1] * around  # dn/dt
    inertia = 0.8 + 0.5 + 4.0 * 0.3**2 + 2.0 * r**2
    momentum = inertia * np.cross(n, turning, axis=0) + 0.2 * spin * n
    assert np.max(np.abs(momentum - momentum[:, :1])) < 1e-10 * np.linalg.norm(momentum[:, 0])
    assert np.max(np.abs(v[2] + np.cos(theta) * v[1] - spin)) < 1e-10
    speed = np.linalg.norm(turning, axis=0)
    radial = motion.signal(acceleration(system)[3])[:, 0]
    assert np.max(np.abs(radial - r * speed**2)) < 1e-10
    assert np.max(np.abs(inertia * speed / (inertia[0] * speed[0]) - 1)) < 1e-10
    on_great_circle = np.max(np.abs(momentum[:, 0] @ n)) < 1e-10 * np.linalg.norm(momentum[:, 0])
    assert on_great_circle == (spin == 0.0)


def test_conical_pendulum_on_a_string():
    # Nothing but a point mass: inverse dynamics needs no inertia of the joints.
    nothing = dict.fromkeys(["Theta_1_33", *(f"Theta_{k}_{i}{i}" for k in (2, 3) for i in (1, 2, 3)), "m_2"], 0.0)
    arm = spherical(**nothing, m_3=2.0, physical=False)
    length, below = 0.6, 0.7
    q = [np.pi - below, 0.4, 0.0, length]
    torques = inverse_dynamics(arm, [Gravity(G)])(q, [0, np.sqrt(G / (length * np.cos(below))), 0, 0], np.zeros(4), [])
    assert np.allclose(np.array(torques).ravel(), [0, 0, 0, -2.0 * G / np.cos(below)], rtol=0, atol=1e-13)


def pendulum(column):
    """Return an arm whose link 2 is a pendulum, a point mass half way, and its length; link 3 only keeps its angle."""
    none = dict.fromkeys(("m_3", "Theta_2_11", "Theta_2_22", "Theta_2_33", "Theta_3_11", "Theta_3_33"), 0.0)
    return torus(**none, L_2=1.2, m_2=3.0, Theta_1_33=column, Theta_3_22=1.0, physical=False), 0.6


@EACH_FORM
def test_conical_motion_of_a_pendulum(form):
    arm, length = pendulum(column=0.0)
    below = 0.7
    turning = np.sqrt(G / (length * np.cos(below)))
    x = begin(form, arm, [0.0, below - np.pi / 2, 0.0], [turning, 0.0, 0.0])
    motion = simulate(form(arm, [Gravity(G)]), x, np.zeros(3), 1.5)
    assert motion.ok
    assert np.max(np.abs(motion.signal("q")[:, 1] - (below - np.pi / 2))) < 1e-10
    assert np.max(np.abs(motion.signal("v")[:, 0] - turning)) < 1e-10


@EACH_FORM
def test_period_of_a_plane_pendulum(form):
    arm, length = pendulum(column=1.0)
    amplitude = 2.0
    one, other = 1.0, np.cos(amplitude / 2)  # K(k) = pi / (2 agm(1, sqrt(1 - k^2))), k = sin(amplitude / 2)
    while abs(one - other) > 1e-15:
        one, other = (one + other) / 2, np.sqrt(one * other)
    period = 4 * np.sqrt(length / G) * np.pi / (2 * one)
    x = begin(form, arm, [0.4, amplitude - np.pi / 2, 0.2], [0.0, 0.0, 0.0])
    system = form(arm, [Gravity(G)])
    motion = simulate(system, x, np.zeros(3), period * np.array([0.0, 0.25, 0.5, 0.75, 1.0]))
    assert motion.ok
    assert np.max(np.abs(motion.signal("q")[:, 1] + np.pi / 2 - amplitude * np.array([1, 0, -1, 0, 1]))) < 1e-9


DRIVES = {
    "cylindrical": {"M_phi": 1, "K_xi": 1, "K_r": 1},
    "spherical": {"M_theta": -1, "M_psi": 1, "M_phi": 1, "K_r": 1},
    "torus": {"M_1": 1, "M_2": -1, "M_3": -1},
}


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_signals_sizes_and_units(name, form):
    arm, system = machine(name), system_of(form, name)
    n = len(arm.coordinates)
    sizes = {"q": n, "v": n, "tau": n, "tool": 3, "power": 1, "energy": 1, **dict.fromkeys(DRIVES[arm.name], 1)}
    third = {lagrange: {}, hamel: {"w": n}, canonical: {"p": n}}[form]
    assert {key: value.numel() for key, value in system.signals.items()} == {**sizes, **third}
    assert (system.x.numel(), system.u.numel(), system.p.numel()) == (2 * n, n, 0)
    units = {key: [label.unit for label in system.label(key, size)] for key, size in sizes.items()}
    lengths = {"cylindrical": [1, 2], "spherical": [3], "torus": []}[arm.name]
    along = ["m" if i in lengths else "rad" for i in range(n)]
    forces = ["N" if i in lengths else "N m" for i in range(n)]
    assert units["q"] == along
    assert units["v"] == [f"{unit}/s" for unit in along]
    assert units["tau"] == [label.unit for label in system.labels["u"]] == forces
    assert [units[drive] for drive in DRIVES[arm.name]] == [[force] for force in forces]
    assert (units["tool"], units["power"], units["energy"]) == (["m"] * 3, ["W"], ["J"])
    assert [str(label) for label in system.labels["x"][:n]] == [f"{c.name} [{c.unit}]" for c in arm.coordinates]
    for (drive, sign), force in zip(DRIVES[arm.name].items(), ca.vertsplit(system["tau"]), strict=True):
        assert ca.is_equal(system[drive], sign * force, 1)


@pytest.mark.parametrize("name", NAMES)
def test_frames_are_those_that_are_meant(name):
    known = {"paper", "regular", "ldl", "udu", "coordinate"}
    known |= {"arrow", "other_root"} if name.startswith("torus") else set()
    assert set(frames_of(name)) == known - ({"paper"} if name == "cylinder_centred" else set())
