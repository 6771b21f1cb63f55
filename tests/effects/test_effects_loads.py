"""Loads, tool forces and counterbalances against bodies, statics and virtual work."""

import casadi as ca
import numpy as np
import pytest
from catalogue.effect_cases import TENSOR
from catalogue.machines import NAMES, VERTICAL, evaluate, machine, relative, states

from models import Parameter, cylindrical, inverse_dynamics, spherical, torus
from models.effects import Counterbalance, Gravity, Payload, RotorInertia, Terms, ToolForce, Viscous
from models.forms import canonical, hamel, lagrange
from models.mechanics.mechanics import Mechanics, assemble
from ocp import simulate

G = 9.81
OFFSET = (0.07, -0.04, 0.12)
EMPTY = np.zeros((0, 40))


def torques(arm, effects, q, v, a):
    return np.array(inverse_dynamics(arm, effects).map(q.shape[1])(q, v, a, np.zeros((0, q.shape[1]))))


def body_energy(arm, mass, offset, tensor):
    """Return T of a load on the last body from its place and rotation alone, and its height."""
    turned = arm.bodies[-1].orientation
    place = arm.tool + turned @ ca.DM(offset)
    velocity = ca.jacobian(place, arm.q) @ arm.v
    turning = ca.reshape(ca.jacobian(ca.vec(ca.densify(turned)), arm.q) @ arm.v, 3, 3)
    # omega from R' R' in inertial axes, the tensor turned to them: another way than that of the product.
    omega = ca.inv_skew((turning @ turned.T - turned @ turning.T) / 2)
    xx, yy, zz, xy, xz, yz = tensor
    inertia = turned @ ca.DM([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T
    return mass * ca.dot(velocity, velocity) / 2 + ca.dot(omega, inertia @ omega) / 2, place[2]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("offset", "tensor"), [(OFFSET, TENSOR), (OFFSET, (0.0,) * 6), ((0.0,) * 3, TENSOR)])
def test_rigid_load_moves_as_its_body(name, offset, tensor):
    arm, mass = machine(name), 4.3
    q, v, a = states(arm, 40, seed=11)
    kinetic, height = body_energy(arm, mass, offset, tensor)
    symbol = ca.SX.sym("a", len(q))
    momentum = ca.gradient(kinetic, arm.v)
    needed = ca.jacobian(momentum, arm.v) @ symbol + ca.jtimes(momentum, arm.q, arm.v)
    needed -= ca.gradient(kinetic - mass * G * height, arm.q)
    (expected,) = evaluate([arm.q, arm.v, symbol], [needed], q, v, a)
    effects = [Gravity(G), Payload(mass, offset, tensor)]
    got = torques(arm, effects, q, v, a) - torques(arm, effects[:1], q, v, a)
    assert relative(got, expected, np.max(np.abs(torques(arm, effects, q, v, a)), axis=0)) < 1e-11


def test_load_held_at_rest():
    # Statics by hand: the weight at its lever arms.
    arm, mass, q = spherical(), 7.0, [0.8, 0.3, 0.2, 0.9]
    reach = 0.9 + arm.nominal["l_T"]
    hold = np.array(inverse_dynamics(arm, [Gravity(G), Payload(mass)])(q, [0] * 4, [0] * 4, [])).ravel()
    empty = np.array(inverse_dynamics(arm, [Gravity(G)])(q, [0] * 4, [0] * 4, [])).ravel()
    expected = [-mass * G * reach * np.sin(0.8), 0.0, 0.0, mass * G * np.cos(0.8)]
    assert np.max(np.abs(hold - empty - expected)) < 1e-12
    arm, q = torus(), [0.3, 0.5, -0.9]
    n = arm.nominal
    hold, empty = (np.array(inverse_dynamics(arm, e)(q, [0] * 3, [0] * 3, [])).ravel()
                   for e in ([Gravity(G), Payload(mass, (0.1, 0, 0))], [Gravity(G)]))  # fmt: skip
    outer = (n["L_3"] / 2 + n["l_T"] + 0.1) * np.cos(0.5 - 0.9)
    assert np.max(np.abs(hold - empty - mass * G * np.array([0, n["L_2"] * np.cos(0.5) + outer, outer]))) < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_point_loads_keep_the_short_form_of_cylinder_and_sphere(name):
    arm = machine(name)
    system = canonical(arm, [Gravity(), Payload(5.0)])
    assert (assemble(arm, [Payload(5.0)]).frame(None).diagonal) == (name in ("cylinder_centred", "cylinder", "sphere",
                                                                           "cylinder_left"))  # fmt: skip
    assert ("payload" in " ".join(system.notes)) == (not assemble(arm, [Payload(5.0)]).frame(None).diagonal)
    # A load on the axis of the arm that turns about it keeps it as well.
    if name == "sphere":
        assert assemble(arm, [Payload(5.0, (0, 0, 0.1), (0.02, 0.02, 0.01))]).frame(None).diagonal


def instructions(system):
    return ca.Function("rate", [system.x, system.u, system.p], [system.rate]).n_instructions()


# Instructions of x' = f(x, u) with a rigid load off the tool point: by recursion over the links, and from the metric.
RIGID = {"spherical": (spherical, 188, 395), "cylindrical": (cylindrical, 49, 61), "torus": (torus, 164, 296)}


@pytest.mark.parametrize("name", RIGID)
def test_a_load_costs_no_more_than_the_inertia_of_a_link(name):
    make, most, before = RIGID[name]
    loaded = canonical(make(), [Payload(5.0, (0.1, 0.05, 0.1), (0.1, 0.1, 0.1))])
    assert instructions(loaded) <= most < before
    assert f"instructions; the metric would take {before}" in " ".join(loaded.notes) or before - most < 20
    # An effect that adds a metric of its own leaves the recursion no place.
    bent = lambda arm, so_far: Terms(metric=ca.diag(arm.q**2))  # noqa: E731
    assert "built by" not in " ".join(canonical(make(), [Payload(5.0, (0.1, 0.0, 0.1)), bent]).notes)


def check_links(name, forms, effects, monkeypatch):
    arm = machine(name)
    short = [form(arm, effects) for form in forms]
    monkeypatch.setattr(Mechanics, "links", None)
    for one, form in zip(short, forms, strict=True):
        other = form(arm, effects)
        assert "built by" not in " ".join(other.notes)
        assert "built by" in " ".join(one.notes) or "cylinder" in name
        rng = np.random.default_rng(5)
        x, u = rng.uniform(0.3, 1.4, one.x.numel()), rng.uniform(-5, 5, one.u.numel())
        values = [
            np.concatenate([part.full().ravel() for part in ca.Function("f", [s.x, s.u, s.p], [s.rate, s["energy"]])
                            (x, u, [4.0])]) for s in (one, other)
        ]  # fmt: skip
        assert np.max(np.abs(values[0] - values[1])) < 1e-12 * np.max(np.abs(values[1]))


@pytest.mark.parametrize("name", ["cylinder", "sphere", "torus"])
def test_a_load_by_recursion_moves_as_by_the_metric(name, monkeypatch):
    check_links(name, (canonical,), [Gravity(G), Payload(Parameter(4.0), OFFSET, TENSOR)], monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cylinder_left", "sphere_general", "torus_offset", "torus_general"])
def test_loads_by_recursion_move_as_by_the_metric(name, monkeypatch):
    spring = Counterbalance(mass=2.0, at=(0.1, 0.0, -0.2), stiffness=50.0, anchor=(0.0, 0.0, 0.3))
    effects = [Gravity(G), Payload(Parameter(4.0), OFFSET, TENSOR), RotorInertia(1e-4, 30.0), Viscous(0.4), spring]
    check_links(name, (canonical, hamel, lagrange), effects, monkeypatch)


def test_load_goes_to_none():
    q0, v0 = np.array([0.8, 0.1, 0.2, 0.9]), np.array([0.6, -0.8, 0.5, 0.2])
    arm = spherical()

    def end(effects):
        return simulate(lagrange(arm, [Gravity(), *effects]), np.append(q0, v0), np.zeros(4), [0.5]).signal("q")[0]

    bare = end([])
    errors = [np.max(np.abs(end([Payload(m, OFFSET, np.multiply(m, TENSOR))]) - bare)) for m in (0.04, 0.02, 0.01)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.05)


def test_loads_that_are_none():
    for wrong, message in (
        ({"mass": -1.0}, r"^payload\.mass: got -1 kg, expected a number >= 0"),
        ({"mass": (1.0, 2.0)}, r"^payload\.mass: got \(1\.0, 2\.0\), expected one finite number in kg"),
        ({"offset": (0.0, 1.0)}, r"^payload\.offset: got .*expected three numbers"),
        ({"offset": 0.1}, r"^payload\.offset: got .*expected three numbers"),
        ({"inertia": (1.0, 1.0, 3.0)}, r"^payload\.inertia: principal moments .*no rigid body has them"),
        ({"inertia": (1.0, 1.0, 1.0, 2.0, 0.0, 0.0)}, r"^payload\.inertia: principal moments"),
        ({"inertia": (1.0, np.nan, 1.0)}, r"^payload\.inertia_2: got nan"),
    ):
        with pytest.raises(ValueError, match=message):
            Payload(**{"mass": 1.0, **wrong})


@pytest.mark.parametrize("name", NAMES)
def test_tool_wrench_does_its_virtual_work(name):
    arm, force, moment = machine(name), np.array([12.0, -8.0, 5.0]), np.array([2.0, 3.0, -4.0])
    q, v, a = states(arm, 40, seed=12)
    turned = arm.bodies[-1].orientation
    speed = ca.jtimes(arm.tool, arm.q, arm.v)
    turning = ca.reshape(ca.jtimes(ca.vec(ca.densify(turned)), arm.q, arm.v), 3, 3)
    omega = ca.inv_skew((turning @ turned.T - turned @ turning.T) / 2)
    speed, omega, rotation = evaluate([arm.q, arm.v], [speed, omega, turned], q, v)
    for inside in (False, True):
        effect = ToolForce(tuple(force), tuple(moment), in_tool_axes=inside)
        pull = torques(arm, [], q, v, a) - torques(arm, [effect], q, v, a)
        f, m = (np.einsum("ijk,j->ik", rotation, vector) if inside else vector[:, None] for vector in (force, moment))
        work = np.sum(f * speed + m * omega, axis=0)
        assert relative(np.sum(pull * v, axis=0), work, np.sum(np.abs(pull * v), axis=0) + 1.0) < 1e-12


def test_tool_force_of_time_carries_a_clock():
    arm = cylindrical(A=0.0)
    system = lagrange(arm, [ToolForce(lambda t: (0.0, 0.0, 50.0 * ca.sin(4.0 * t)))])
    assert [str(label) for label in system.labels["x"][6:]] == ["time [s]"]
    assert system.initial == {"time": 0.0}
    motion = simulate(system, [0, 0.2, 0.6, 0, 0, 0, 0], np.zeros(3), 1.0)
    way = 50.0 / 65.0 * (motion.t / 4.0 - np.sin(4.0 * motion.t) / 16.0)
    assert np.max(np.abs(motion.signal("q")[:, 1] - 0.2 - way)) < 1e-12
    # Two functions of time share the clock, and a CasADi function serves as well.
    t = ca.SX.sym("t")
    function = ca.Function("F", [t], [ca.vertcat(0, 0, 25.0 * ca.sin(4.0 * t))])
    twice = lagrange(arm, [ToolForce(function), ToolForce(lambda t: (0, 0, 25.0 * ca.sin(4.0 * t)))])
    again = simulate(twice, [0, 0.2, 0.6, 0, 0, 0, 0], np.zeros(3), 1.0)
    assert np.max(np.abs(again.x - motion.x)) < 1e-12
    torque = inverse_dynamics(arm, [ToolForce(function)])
    assert torque.name_in() == ["q", "v", "a", "p", "t"]
    assert float(torque([0] * 3, [0] * 3, [0] * 3, [], 0.3)[1]) == pytest.approx(-25.0 * np.sin(1.2))


def test_tool_forces_that_are_none():
    for wrong, message in (
        ({"force": (1.0, 2.0)}, r"^tool_force\.force: got .*expected three numbers or a function"),
        ({"force": "down"}, r"^tool_force\.force: got 'down'"),
        ({"moment": (1.0, np.inf, 0.0)}, r"^tool_force\.moment_2: got inf"),
    ):
        with pytest.raises(ValueError, match=message):
            ToolForce(**wrong)
    for effect, message in (
        (ToolForce(lambda t: (t, t)), r"^tool_force\.force: the function returned .*three expressions in time"),
        (ToolForce(lambda t: (ca.SX.sym("x"), 0, 0)), r"^tool_force\.force: the function returned"),
        (ToolForce(lambda t, s: (t, 0, 0)), r"^tool_force\.force: the function of time failed"),
        (ToolForce(lambda t: (t, 0, 0), of="wear"), r"^tool_force reads the signal 'wear', which no effect"),
    ):
        with pytest.raises(ValueError, match=message):
            canonical(spherical(), [effect])
    assert lagrange(spherical(), [ToolForce((Parameter(3.0), 0, 0))]).nominal == {"tool_force.force_1": 3.0}


def test_spring_of_free_length_zero_balances_a_link_at_every_angle():
    # k a b = m g l: here for the swivelling body of the sphere and its arm at one length r.
    arm, above, along = spherical(), 0.5, 0.3
    n, r = arm.nominal, 0.8
    moment = (n["m_2"] * n["s_2"] + n["m_3"] * r) * G
    spring = Counterbalance(stiffness=moment / (above * along), at=(0, 0, along - n["s_2"]), anchor=(0, 0, above))
    theta = np.linspace(0.1, 3.0, 40)
    q = np.array([theta, 0.4 + 0 * theta, 0.2 + 0 * theta, r + 0 * theta])
    held = torques(arm, [Gravity(G), spring], q, 0 * q, 0 * q)
    alone = torques(arm, [Gravity(G)], q, 0 * q, 0 * q)
    assert np.max(np.abs(held[0])) < 1e-12 * np.max(np.abs(alone[0]))
    # A counterweight behind the axis does the same with a mass, and adds its inertia.
    behind = 0.4
    weight = Counterbalance(mass=moment / G / behind, at=(0, 0, -behind - n["s_2"]))
    assert np.max(np.abs(torques(arm, [Gravity(G), weight], q, 0 * q, 0 * q)[0])) < 1e-12 * np.max(np.abs(alone[0]))
    a = np.zeros_like(q)
    a[0] = 1.0
    inertia = torques(arm, [weight], q, 0 * q, a)[0] - torques(arm, [], q, 0 * q, a)[0]
    assert inertia == pytest.approx(np.full(40, moment / G * behind))


def test_spring_with_a_free_length_pulls_along_its_line():
    arm = cylindrical(A=0.2)
    spring = Counterbalance(stiffness=500.0, at=(-0.1, 0, 0), anchor=(0.3, 0.0, 1.5), free_length=0.4)
    pull = float(inverse_dynamics(arm, [spring])([0.7, 0.3, 0.6], [0] * 3, [0] * 3, [])[1])
    length = np.hypot(0.3, 1.2)
    assert pull == pytest.approx(-500.0 * (length - 0.4) * 1.2 / length)
    with pytest.raises(ValueError, match=r"^counterbalance\.body: cylindrical has no body 'wing'; it has column, carr"):
        lagrange(arm, [Counterbalance(mass=1.0, body="wing")])
    with pytest.raises(ValueError, match=r"^counterbalance\.at: got .*expected three numbers"):
        Counterbalance(mass=1.0, at=(0.0, 1.0))


@pytest.mark.parametrize("name", NAMES)
def test_what_loads_add_does_not_depend_on_the_direction_of_the_column(name):
    arm = machine(name)
    for effect in (Payload(5.0, OFFSET, TENSOR), Counterbalance(3.0, 900.0, OFFSET, (0.1, 0.2, 0.5))):
        terms = effect(arm, assemble(arm, []).terms)
        used = ca.vertcat(ca.vec(ca.densify(terms.metric)), terms.potential)
        assert not ca.depends_on(used, arm.q[VERTICAL[arm.name]])
