"""Machines: the metric derived again from the bodies, and every parameter checked by name."""

import re

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import MAKERS, NAMES, evaluate, kinetic_energy, machine, parameters, relative, states

from models import Parameter, cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange

FORMS = (lagrange, hamel, canonical)
MAKE = (cylindrical, spherical, torus)
EACH_MACHINE = pytest.mark.parametrize("make", MAKE, ids=lambda make: make.__name__)
TENSORS = {
    "Theta_2": {"Theta_2_11": 1.0, "Theta_2_22": 1.0, "Theta_2_33": 1.0},
    "Theta_3": {"Theta_3_11": 1.0, "Theta_3_22": 1.0, "Theta_3_33": 1.0},
}


def instructions(system):
    return ca.Function("f", [system.x, system.u, system.p], [system.rate]).n_instructions()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_metric_is_that_of_the_bodies(name, seed):
    arm = machine(name, seed)
    q, _, _ = states(arm)
    derived, _ = ca.hessian(kinetic_energy(arm), arm.v)
    expected, got = evaluate([arm.q], [derived, arm.metric], q)
    length = np.sqrt(np.einsum("iik->ik", expected))
    # Each entry on its own scale, as the rows have different units.
    assert relative(got, expected, length[:, None] * length[None, :]) < 1e-13
    assert np.array_equal(got, np.swapaxes(got, 0, 1))
    assert np.all(np.linalg.eigvalsh(np.moveaxis(got, 2, 0)) > 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_orientations_are_rotations(name):
    arm = machine(name)
    q, _, _ = states(arm)
    for body in arm.bodies:
        (turned,) = evaluate([arm.q], [body.orientation], q)
        squares = np.einsum("jik,jlk->ilk", turned, turned)
        assert np.max(np.abs(squares - np.eye(3)[:, :, None])) < 1e-15 * 8
        assert np.allclose(np.linalg.det(np.moveaxis(turned, 2, 0)), 1.0, rtol=0, atol=1e-14)
        assert np.all(np.linalg.eigvalsh(np.array(ca.DM(body.inertia))) >= -1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_tool_and_skeleton(name):
    arm = machine(name)
    q, _, _ = states(arm)
    skeleton, tool, tip = evaluate([arm.q], [arm.skeleton, arm.tool, arm.bodies[-1].centre], q)
    assert np.array_equal(skeleton[:, -1], tool)
    assert np.array_equal(skeleton[:, 0], np.zeros_like(tool))
    distance = np.linalg.norm(tool - tip, axis=0)
    assert relative(distance, np.full_like(distance, arm.nominal["l_T"])) < 1e-14
    slope = ca.jacobian(arm.tool, arm.q)
    expected, metric = evaluate([arm.q], [slope.T @ slope, arm.tool_metric], q)
    assert relative(metric, expected, np.max(np.abs(expected), axis=(0, 1))) < 1e-14


@EACH_MACHINE
def test_wrong_name_lists_the_right_ones(make):
    with pytest.raises(TypeError, match=rf"{make.__name__} has no parameter 'mass'") as caught:
        make(mass=1.0)
    assert all(name in str(caught.value) for name in make().nominal)
    with pytest.raises(TypeError, match="keyword arguments only"):
        make(0.5)


BAD = [None, "2.0", b"2", "heavy", True, np.nan, np.inf, -np.inf, 1 + 2j, np.array([1.0, 2.0]), [1.0, 2.0], [], {}]
BAD_OF_NUMPY = [np.complex128(1 + 2j), np.array(1 + 2j), np.bool_(True), np.array("2.0")]


@pytest.mark.parametrize("value", BAD + BAD_OF_NUMPY, ids=lambda value: f"{type(value).__name__} {value}")
@EACH_MACHINE
def test_values_that_are_no_finite_number(make, value):
    for name in ("m_2", "Theta_1_33", "l_T"):
        for given in (value, Parameter(value)):
            with pytest.raises(ValueError, match=rf"^{name}: .*expected one finite number in (kg|kg m\^2|m)$"):
                make(**{name: given})


@EACH_MACHINE
def test_every_parameter_is_checked(make):
    for name in make().nominal:
        with pytest.raises(ValueError, match=rf"^{name}: "):
            make(**{name: np.nan})


@pytest.mark.parametrize("value", [0.0, -1.0])
@EACH_MACHINE
def test_masses_and_moments_are_positive(make, value):
    names = ["m_2", "m_3", "Theta_1_33"] + (["Theta_2_33", "Theta_3_33"] if make is cylindrical else [])
    names += ["L_2", "L_3"] if make is torus else []
    for name in names:
        for given in (value, Parameter(value)):
            with pytest.raises(ValueError, match=rf"^{name}: got {value:g} .*expected a .*> 0"):
                make(**{name: given})


@pytest.mark.parametrize("body", TENSORS)
@pytest.mark.parametrize("make", [spherical, torus], ids=lambda make: make.__name__)
def test_inertia_tensors_are_those_of_bodies(make, body):
    good = TENSORS[body]
    make(**good)
    for name in good:
        for value in (0.0, -1.0):
            with pytest.raises(ValueError, match=rf"{name}.*not positive definite"):
                make(**{**good, name: value})
        make(**{**good, name: 2.0})  # a flat body: the sum of the others, exactly
        with pytest.raises(ValueError, match=rf"{name}.*break the triangle inequality"):
            make(**{**good, name: 2.001})
    if make is torus:
        for pair in ("12", "13", "23"):
            make(**good, **{f"{body}_{pair}": 0.3})
            with pytest.raises(ValueError, match=rf"{body}_{pair}.*not positive definite"):
                make(**good, **{f"{body}_{pair}": -1.1})
            with pytest.raises(ValueError, match=rf"{body}_{pair}.*triangle inequality"):
                make(**good, **{f"{body}_{pair}": 0.6})


def test_idealised_bodies_where_they_are_asked_for():
    none = dict.fromkeys(("Theta_1_33", "Theta_2_33", "Theta_3_33"), 0.0)
    assert cylindrical(m_2=0.0, **none, physical=False).nominal["m_2"] == 0.0
    for bad in ({"m_2": 0.0}, {"Theta_1_33": 0.0}, {"Theta_2_33": 0.0}):
        spherical(**bad, physical=False)
        with pytest.raises(ValueError, match=next(iter(bad))):
            spherical(**bad)
    with pytest.raises(ValueError, match="L_2"):  # a length is never idealised away
        torus(L_2=0.0, physical=False)


def test_defaults_that_follow():
    assert spherical(Theta_3_11=0.7).nominal["Theta_3_22"] == 0.7
    assert spherical(Theta_3_11=0.7, Theta_3_22=0.68).nominal["Theta_3_22"] == 0.68
    assert torus(L_3=1.3).nominal["l_T"] == 0.65
    assert torus(L_3=1.3, l_T=0.1).nominal["l_T"] == 0.1
    symbolic = torus(L_3=Parameter(1.3))
    assert list(symbolic.symbols) == ["L_3"]
    tool, q = ca.Function("tool", [symbolic.q, symbolic.symbols["L_3"]], [symbolic.tool]), np.zeros(3)
    assert np.allclose(np.array(tool(q, 2.0)).ravel(), [0.7 + 2.0, 0.0, 0.0], rtol=0, atol=1e-15)


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
@pytest.mark.parametrize("name", NAMES)
def test_parameters_that_stay_symbols(name, form):
    numbers = parameters(name)
    arm = MAKERS[name](**{key: Parameter(value) for key, value in numbers.items()})
    plain = form(machine(name), [Gravity(9.7)])
    system = form(arm, [Gravity(Parameter(9.7))])
    assert system.nominal == {**numbers, "gravity.g": 9.7}
    assert [symbol.name() for symbol in ca.vertsplit(system.p)] == list(system.nominal)
    q, v, tau = states(arm, 20)
    p = np.tile(np.array(list(system.nominal.values()))[:, None], 20)
    wanted = ("v", "tool", "power", "energy")
    expected = evaluate([plain.x, plain.u], [plain.rate, *map(plain.__getitem__, wanted)], np.vstack([q, v]), tau)
    inputs = [system.x, system.u, system.p]
    got = evaluate(inputs, [system.rate, *map(system.__getitem__, wanted)], np.vstack([q, v]), tau, p)
    for one, other in zip(got[:-1], expected[:-1], strict=True):
        assert relative(one, other) < 1e-12
    assert relative(got[-1], expected[-1], np.max(np.abs(expected[-1]))) < 1e-12


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
def test_special_cases_fall_out_short(form):
    def count(arm):
        return instructions(form(arm, [Gravity()]))

    products = dict.fromkeys([f"Theta_{k}_{ij}" for k in (2, 3) for ij in ("12", "13", "23")], 0.0)
    assert count(spherical()) == count(spherical(Theta_3_22=spherical().nominal["Theta_3_11"]))
    assert count(torus()) == count(torus(B=0.0, **products))
    assert count(cylindrical(A=0.0)) < count(cylindrical(A=0.1))
    assert count(spherical()) < count(spherical(Theta_3_22=0.88))
    assert count(torus()) < count(torus(B=0.1)) < count(torus(B=0.1, Theta_2_13=0.01))
    # Theta_3_22 follows a symbol: the difference of the two is still seen to vanish.
    followed = spherical(Theta_3_11=Parameter(0.9))
    assert count(followed) < count(spherical(Theta_3_11=Parameter(0.9), Theta_3_22=Parameter(0.9))) - 10
    assert form(followed).notes == form(spherical()).notes == ()


def test_machines_say_what_they_are():
    assert re.fullmatch(r"Manipulator spherical: q = \(theta \[rad\], .*r \[m\]\), frames .*", repr(spherical()))
    assert [c.force_unit for c in spherical().coordinates] == ["N m", "N m", "N m", "N"]
