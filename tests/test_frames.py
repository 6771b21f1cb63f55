"""Frames: anholonomity, hand-written equations, operation counts; and effects, which only add."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from machines import (
    EVERY_FRAME,
    NAMES,
    acceleration,
    evaluate,
    frames_of,
    machine,
    relative,
    sphere_by_hand,
    start,
    states,
    torus_by_hand,
    weight,
)

from models import Parameter, cylindrical, inverse_dynamics, spherical, torus
from models.effects import Gravity, Payload
from models.forms import canonical, hamel, lagrange
from models.frames import Frame, anholonomity
from models.terms import Quantity, State, Terms

FORMS = (lagrange, hamel, canonical)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
G = 9.81


@pytest.mark.parametrize(("name", "frame"), EVERY_FRAME)
def test_inverse_and_metric_belong_to_the_frame(name, frame):
    arm = machine(name)
    basis = arm.frame(frame)
    assert basis.name == frame
    q, _, _ = states(arm)
    f, s, g, own = evaluate([arm.q], [basis.matrix, basis.inverse, arm.metric, basis.metric], q)
    f, s, g, own = (np.moveaxis(m, 2, 0) for m in (f, s, g, own))
    scale = np.max(np.abs(s), axis=(1, 2), keepdims=True) * np.max(np.abs(f), axis=(1, 2), keepdims=True)
    assert relative(s @ f, np.broadcast_to(np.eye(len(q)), f.shape), scale) < 1e-14
    length = np.sqrt(np.einsum("kii->ki", own))
    assert relative(s.swapaxes(1, 2) @ g @ s, own, length[:, :, None] * length[:, None, :]) < 1e-12
    if frame in ("ldl", "udu"):
        unit = np.triu(f) if frame == "ldl" else np.tril(f)
        assert np.array_equal(unit, f)
        assert np.array_equal(np.einsum("kii->ki", f), np.ones(f.shape[:2]))
        assert np.all(np.einsum("kii->ki", own) > 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_which_frames_are_orthogonal(name):
    coupled = {"paper", "regular", "other_root"} if name in ("torus_offset", "torus_general") else set()
    for frame in frames_of(name):
        assert machine(name).frame(frame).diagonal == (frame not in coupled)
        notes = hamel(machine(name), frame=frame).notes
        assert len(notes) == (frame in coupled)
        assert all(f"frame {frame!r}" in note and "(1, 2), (1, 3)" in note for note in notes)


def objects(name, frame):
    """Return q and the anholonomity object at q as A[b, c, a, state], zero-based, of a machine."""
    arm = machine(name)
    q, _, _ = states(arm)
    return q, np.array(evaluate([arm.q], anholonomity(arm.frame(frame)), q))


def skew(n, q, entries):
    """Return A[b, c, a, state] from its entries {(b, c, a): values}, one-based as in the text."""
    result = np.zeros((n, n, n, q.shape[1]))
    for (b, c, a), values in entries.items():
        result[b - 1, c - 1, a - 1] = values
        result[b - 1, a - 1, c - 1] = -values
    return result


@pytest.mark.parametrize(
    ("name", "frame"),
    [(name, frame) for name, frame in EVERY_FRAME if name.startswith("cylinder")]
    + [(name, frame) for name in ("torus", "torus_general") for frame in ("paper", "regular", "other_root")],
)
def test_holonomic_frames(name, frame):
    assert all(part.nnz() == 0 for part in anholonomity(machine(name).frame(frame)))


def test_anholonomity_of_the_sphere():
    q, got = objects("sphere", "regular")
    assert relative(got, skew(4, q, {(3, 2, 1): np.sin(q[0])}), 1.0) < 1e-14
    q, got = objects("sphere", "paper")
    cotangent = 1 / np.tan(q[0])
    expected = skew(4, q, {(2, 1, 2): cotangent, (3, 2, 1): np.ones_like(q[0])})
    assert relative(got, expected, 1 + np.abs(cotangent)) < 1e-13


def test_anholonomity_of_the_general_sphere():
    q, got = objects("sphere_general", "regular")
    theta, _, phi, r = q
    n = machine("sphere_general").nominal
    difference = n["Theta_3_11"] - n["Theta_3_22"]
    g11 = n["Theta_2_11"] + n["m_2"] * n["s_2"] ** 2 + n["m_3"] * r**2
    g11 = g11 + n["Theta_3_11"] * np.cos(phi) ** 2 + n["Theta_3_22"] * np.sin(phi) ** 2
    g12 = difference / 2 * np.sin(2 * phi) * np.sin(theta)
    by_theta = difference / 2 * np.sin(2 * phi) * np.cos(theta) / g11
    by_phi = difference * np.cos(2 * phi) * np.sin(theta) / g11 + g12 * difference * np.sin(2 * phi) / g11**2
    by_r = -2 * g12 * n["m_3"] * r / g11**2
    entries = {(1, 1, 2): by_theta, (1, 3, 2): by_phi, (1, 4, 2): by_r, (3, 1, 2): -np.sin(theta)}
    for upper, expected in zip(got, skew(4, q, entries), strict=True):
        assert relative(upper, expected, np.max(np.abs(expected)) or 1.0) < 1e-13


@pytest.mark.parametrize(("name", "by_hand"), [("sphere", sphere_by_hand), ("torus", torus_by_hand)])
def test_equations_by_hand(name, by_hand):
    arm = machine(name)
    q, w, tau = states(arm)
    *_, metric = by_hand(arm.nominal, q, w, w, tau, G)
    p = np.array(metric) * w
    q_rate, w_rate, p_rate, energy, _ = by_hand(arm.nominal, q, w, p, tau, G)
    for form, symbol, rate in ((hamel, w, w_rate), (canonical, p, p_rate)):
        system = form(arm, [Gravity(G)])
        got, total = evaluate([system.x, system.u], [system.rate, system["energy"]], np.vstack([q, symbol]), tau)
        assert relative(got[: len(q)], q_rate) < 1e-12
        assert relative(got[len(q) :], rate) < 1e-12
        assert relative(total[0], energy, np.max(np.abs(energy))) < 1e-12


def test_a_frame_of_ones_own():
    # Absolute angles, not orthogonal: P_alpha = p_q2 - p_q3, P_beta = p_q3.
    arm = machine("torus")
    n = arm.nominal
    matrix, inverse = ca.SX.eye(3), ca.SX.eye(3)
    matrix[2, 1], inverse[2, 1] = 1, -1
    absolute = Frame("absolute angles", arm.q, matrix, inverse, inverse.T @ arm.metric @ inverse)
    system = canonical(arm, [Gravity(G)], frame=absolute)
    assert "'absolute angles'" in system.notes[0]
    q, p, tau = states(arm)
    (rate,) = evaluate([system.x, system.u], [system.rate], np.vstack([q, p]), tau)
    i2 = n["Theta_2_22"] + (n["m_2"] / 4 + n["m_3"]) * n["L_2"] ** 2
    i3, kappa = n["Theta_3_22"] + n["m_3"] * n["L_3"] ** 2 / 4, n["m_3"] * n["L_2"] * n["L_3"]
    half, factor = kappa * np.cos(q[2]) / 2, i2 * i3 - (kappa * np.cos(q[2]) / 2) ** 2
    alpha_rate, beta_rate = (i3 * p[1] - half * p[2]) / factor, (i2 * p[2] - half * p[1]) / factor
    assert relative(rate[1:3], np.array([alpha_rate, beta_rate - alpha_rate])) < 1e-12
    assert np.array_equal(rate[3], tau[0])
    plain = lagrange(arm, [Gravity(G)])
    q, v, tau = states(arm)
    w = np.array([v[0], v[1], v[1] + v[2]])
    (expected,) = evaluate([plain.x, plain.u], [acceleration(plain)], np.vstack([q, v]), tau)
    for form, third in ((lagrange, v), (hamel, w)):
        system = form(arm, [Gravity(G)], frame=absolute)
        (got,) = evaluate([system.x, system.u], [acceleration(system)], np.vstack([q, third]), tau)
        assert relative(got, expected) < 1e-12


@EACH_FORM
def test_unknown_frame_lists_the_known(form):
    for name in NAMES:
        with pytest.raises(ValueError, match=f"no frame 'orthogonal'; it has {', '.join(machine(name).frames)}"):
            form(machine(name), frame="orthogonal")
    with pytest.raises(ValueError, match="no frame 3"):
        form(machine("torus"), frame=3)


@EACH_FORM
def test_frame_of_the_source_is_refused_where_it_does_not_exist(form):
    cube = dict.fromkeys(("Theta_3_11", "Theta_3_22", "Theta_3_33"), 23.16144)  # I_2 = I_3 up to the last bit
    equal = torus(L_2=0.83, L_3=0.67, m_2=29.9, m_3=29.5, Theta_2_22=1.0, **cube)
    for arm in (cylindrical(A=0.0), cylindrical(A=Parameter(0.0)), equal):
        with pytest.raises(ValueError, match=r"'paper'.* singular at .*use frame='regular'"):
            form(arm, frame="paper")


FULL = {"B": 0.1, **{f"Theta_{k}_{ij}": 0.01 * i for k in (2, 3) for i, ij in enumerate(("12", "13", "23"), start=1)}}
COUNTS = [  # reference counts in closed form by hand, and what was reached here: canonical, Boltzmann-Hamel
    (cylindrical, {}, (33, 37), (36, 38)),
    (spherical, {}, (63, 72), (71, 78)),
    (torus, {}, (78, 86), (88, 96)),
    (torus, FULL, (136, 161), (158, 170)),
]


def instructions(system):
    return ca.Function("f", [system.x, system.u, system.p], [system.rate]).n_instructions()


@pytest.mark.parametrize(("make", "given", "by_hand", "reached"), COUNTS, ids=["cylinder", "sphere", "torus", "full"])
def test_operation_counts(make, given, by_hand, reached):
    counts = [instructions(form(make(**given), [Gravity()])) for form in (canonical, hamel)]
    assert counts[0] <= 1.2 * by_hand[0]
    assert counts[1] <= 1.3 * by_hand[1]
    assert all(count <= before for count, before in zip(counts, reached, strict=True)), counts


# Effects.


@dataclass(frozen=True)
class Viscous:
    coefficient: float = 0.8

    def __call__(self, machine, so_far):
        return Terms(force=-self.coefficient * machine.v)


@dataclass(frozen=True)
class Rotors:
    inertia: float = 0.4

    def __call__(self, machine, so_far):
        return Terms(metric=self.inertia * ca.SX.eye(machine.q.numel()))


@dataclass(frozen=True)
class Heating:
    state: str = "temperature"
    signal: str = "losses"

    def __call__(self, machine, so_far):
        temperature = ca.SX.sym(self.state)
        losses = 0.01 * ca.dot(machine.tau, machine.tau) + 0.3 * ca.dot(machine.v, machine.v)
        rate = losses - 0.2 * temperature
        return Terms(states={self.state: State(temperature, rate, "K")}, signals={self.signal: Quantity(losses, "W")})


def torques_of(arm, effects, *motion):
    return np.array(inverse_dynamics(arm, effects).map(200)(*motion, np.zeros((0, 200))))


@EACH_FORM
@pytest.mark.parametrize(("name", "frame"), EVERY_FRAME)
def test_effects_written_outside_the_package(name, frame, form):
    arm = machine(name)
    q, given, tau = states(arm)
    n = len(q)
    temperature = np.linspace(-5.0, 90.0, 200)[None, :]
    system = form(arm, [Gravity(G), Viscous(), Rotors(), Heating()], frame)
    wanted = [system.rate, system["v"], acceleration(system), system["energy"], system["losses"], system["temperature"]]
    x = np.vstack([start(form.__name__, arm, q, given, frame, 0.4 * ca.SX.eye(n)), temperature])
    rate, v, a, energy, losses, same = evaluate([system.x, system.u], wanted, x, tau)
    assert relative(v, given) < 1e-11
    # The bare machine needs these torques for the motion; friction and the rotors take theirs out of the drives.
    bare = torques_of(arm, [Gravity(G)], q, v, a)
    size = np.max(np.abs([bare, 0.8 * v, 0.4 * a, tau]), axis=(0, 1))
    assert relative(bare + 0.8 * v + 0.4 * a, tau, size) < 1e-11
    assert relative(torques_of(arm, [Gravity(G), Viscous(), Rotors()], q, v, a), tau, size) < 1e-11
    (potential, metric) = evaluate([arm.q], [weight(arm, G), arm.metric], q)
    kinetic = np.einsum("ik,ijk,jk->k", v, metric, v) / 2 + 0.2 * np.sum(v**2, axis=0)
    assert relative(energy[0], kinetic + potential[0], kinetic + np.abs(potential[0])) < 1e-11
    expected = 0.01 * np.sum(tau**2, axis=0) + 0.3 * np.sum(v**2, axis=0)
    assert relative(losses[0], expected) < 1e-13
    assert relative(rate[2 * n], expected - 0.2 * temperature[0], expected + 20) < 1e-13
    assert np.array_equal(same, temperature)
    assert str(system.labels["x"][2 * n]) == "temperature [K]"
    assert [str(label) for label in system.labels["losses"]] == ["losses [W]"]


@EACH_FORM
def test_state_of_an_effect_is_a_signal_with_its_unit(form):
    assert str(form(machine("torus"), [Heating()]).label("temperature", 1)[0]) == "temperature [K]"


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_effects_commute(name, form):
    arm = machine(name)
    q, third, tau = states(arm, 20)
    x = np.vstack([q, third, tau[:1]])
    one = [Gravity(G), Viscous(), Rotors(), Heating(), Viscous(0.3), Payload(4), Viscous(0.5), Gravity(2, (1, 0, 0))]
    systems = [form(arm, effects) for effects in (one, one[::-1], one[5:] + one[:5])]
    first, *others = (evaluate([s.x, s.u], [s.rate, s["energy"]], x, tau) for s in systems)
    for other in others:
        assert relative(other[0], first[0]) < 1e-11
        assert relative(other[1], first[1], np.max(np.abs(first[1]))) < 1e-11


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_payload_is_a_point_mass_at_the_tool(name, form):
    arm, mass = machine(name), 3.7
    q, v, tau = states(arm)
    system = form(arm, [Payload(mass), Gravity(G)])
    x = start(form.__name__, arm, q, v, added=mass * arm.tool_metric)
    (a,) = evaluate([system.x, system.u], [acceleration(system)], x, tau)
    symbol = ca.SX.sym("a", len(q))
    slope = ca.jacobian(arm.tool, arm.q)
    moving = ca.jtimes(slope @ arm.v, arm.q, arm.v) + slope @ symbol + ca.vertcat(0, 0, G)
    (load,) = evaluate([arm.q, arm.v, symbol], [mass * slope.T @ moving], q, v, a)
    bare = torques_of(arm, [Gravity(G)], q, v, a)
    assert relative(bare + load, tau, np.max(np.abs([bare, load, tau]), axis=(0, 1))) < 1e-11
    assert relative(torques_of(arm, [Gravity(G), Payload(mass)], q, v, a), tau) < 1e-11


def test_masses_that_no_load_has():
    for mass in (-1.0, np.nan, None, "2"):
        with pytest.raises(ValueError, match=r"^payload\.mass: got "):
            Payload(mass)


@EACH_FORM
def test_names_that_are_taken(form):
    arm = machine("torus")
    form(arm, [Heating(), Heating("oil", "friction")])
    for taken, kind in (
        (Heating("temperature", "other"), "state 'temperature'"),
        (Heating("other", "losses"), "signal 'losses'"),
        (Heating("other", "energy"), "signal 'energy'"),
        (Heating("losses", "other"), "'losses'"),  # a state in the place of a signal
        (Heating("power", "other"), "'power'"),
    ):
        with pytest.raises(ValueError, match=f"(two effects define|an effect defines) the .*{kind}"):
            form(arm, [Heating(), taken])


def test_inverse_dynamics_refuses_states():
    with pytest.raises(ValueError, match="temperature, oil"):
        inverse_dynamics(machine("torus"), [Gravity(), Heating(), Heating("oil", "friction")])


@EACH_FORM
def test_what_is_no_machine_and_no_effect(form):
    arm = machine("sphere")
    for effects in (Gravity(), Gravity, "gravity", [Gravity], ["gravity"], [None], [9.81]):
        with pytest.raises(TypeError, match=r"^effects: got .*expected .*Gravity\(\)"):
            form(arm, effects)
    with pytest.raises(TypeError, match=r"^machine: got .*spherical\(\)"):
        form(spherical, [Gravity()])


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_what_is_off_leaves_no_trace(name, form):
    arm = machine(name)
    never = instructions(form(arm))
    for off in ([], [Gravity(0.0)], [Payload(0.0)], [lambda machine, so_far: Terms()], [Viscous(0.0)]):
        assert instructions(form(arm, off)) == never
    assert instructions(form(arm, [Gravity()])) > never


@pytest.mark.parametrize("name", NAMES)
def test_field_of_any_direction(name):
    arm = machine(name)
    q, v, _ = states(arm)
    direction = np.array([0.3, -0.5, -0.7])
    field = 9.7 * direction / np.linalg.norm(direction)
    places = evaluate([arm.q], [body.centre for body in arm.bodies[1:]], q)
    masses = arm.nominal["m_2"], arm.nominal["m_3"]
    expected = sum(-m * field @ place for m, place in zip(masses, places, strict=True))
    size = 9.7 * sum(m * np.linalg.norm(place, axis=0) for m, place in zip(masses, places, strict=True))
    for scale in (1.0, 250.0):  # the length of the direction does not matter
        effects = [Gravity(9.7, tuple(scale * direction))]
        system = lagrange(arm, effects)
        (energy,) = evaluate([system.x], [system["energy"]], np.vstack([q, 0 * v]))
        assert relative(energy[0], expected, size) < 1e-13
        slopes = evaluate([arm.q], [ca.jacobian(body.centre, arm.q) for body in arm.bodies[1:]], q)
        holding = sum(-m * np.einsum("i,ijk->jk", field, slope) for m, slope in zip(masses, slopes, strict=True))
        assert relative(torques_of(arm, effects, q, 0 * v, 0 * v), holding) < 1e-12


def test_fields_that_are_none():
    for direction in ((0, 0, 0), (0, -1), (0, 0, 0, -1), None, 5.0, (0, 0, np.nan), (0, 0, np.inf), "down", "xyz"):
        with pytest.raises(ValueError, match=r"^gravity\.direction: got "):
            Gravity(9.81, direction)
    for g in (None, "9.81", np.nan, np.inf, 1j, (9.81, 9.81), True):
        for given in (g, Parameter(g)):
            with pytest.raises(ValueError, match=r"^gravity\.g: got .*expected one finite number in m/s\^2"):
                Gravity(given)


@EACH_FORM
def test_field_as_a_parameter(form):
    arm = machine("sphere")
    system, plain = form(arm, [Gravity(Parameter(9.81))]), form(arm, [Gravity(1.62)])
    assert system.nominal == {"gravity.g": 9.81}
    q, third, tau = states(arm)
    x, p = np.vstack([q, third]), np.full((1, 200), 1.62)
    (got,) = evaluate([system.x, system.u, system.p], [system.rate], x, tau, p)
    (expected,) = evaluate([plain.x, plain.u], [plain.rate], x, tau)
    assert relative(got, expected) < 1e-13
