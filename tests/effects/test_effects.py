"""Effects only add: forces, states, loads and fields, in every form and frame, without a trace where they are off."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import (
    EVERY_FRAME,
    NAMES,
    acceleration,
    evaluate,
    instructions,
    machine,
    relative,
    start,
    states,
    weight,
)

from models import Parameter, inverse_dynamics, spherical
from models.effects import Gravity, Payload
from models.forms import canonical, hamel, lagrange
from models.mechanics.terms import Quantity, State, Terms

FORMS = (lagrange, hamel, canonical)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
G = 9.81


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
        (Heating("losses", "other"), "'losses'"),  # a state in the centre of a signal
        (Heating("power", "other"), "'power'"),
    ):
        with pytest.raises(ValueError, match=f"(two effects define|an effect defines) the .*{kind}"):
            form(arm, [Heating(), taken])


@dataclass(frozen=True)
class Stiffening:
    """A force that depends on a state, which the motion does not fix."""

    def __call__(self, machine, so_far):
        wear = ca.SX.sym("wear")
        return Terms(force=-wear * machine.v, states={"wear": State(wear, ca.dot(machine.v, machine.v), "1")})


def test_inverse_dynamics_needs_no_states_but_those_that_forces_depend_on():
    arm = machine("torus")
    q, v, a = states(arm, seed=5)
    idle = [Gravity(), Heating(), Heating("oil", "friction")]
    assert np.array_equal(torques_of(arm, idle, q, v, a), torques_of(arm, [Gravity()], q, v, a))
    with pytest.raises(ValueError, match=r"forces of effects depend on wear, which q\(t\) alone does not fix"):
        inverse_dynamics(arm, [*idle, Stiffening()])


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
    centres = evaluate([arm.q], [body.centre for body in arm.bodies[1:]], q)
    masses = arm.nominal["m_2"], arm.nominal["m_3"]
    expected = sum(-m * field @ centre for m, centre in zip(masses, centres, strict=True))
    size = 9.7 * sum(m * np.linalg.norm(centre, axis=0) for m, centre in zip(masses, centres, strict=True))
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
