"""Frames: anholonomity, hand-written equations, operation counts."""

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import (
    EVERY_FRAME,
    NAMES,
    acceleration,
    evaluate,
    frames_of,
    instructions,
    machine,
    relative,
    sphere_by_hand,
    states,
    torus_by_hand,
)

from models import Parameter, cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.machines.frames import Frame, anholonomity

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
    pairs = dict.fromkeys(coupled, "(1, 2), (1, 3)")
    # In the coordinates themselves only the cylinder without offset is orthogonal.
    own = {"cylinder": "(1, 3)", "sphere": "(2, 3)", "sphere_general": "(1, 2), (2, 3)", "torus": "(2, 3)"}
    own |= {"cylinder_left": "(1, 3)", "torus_offset": "(1, 2), (1, 3), (2, 3)"}
    if name != "cylinder_centred":
        pairs["coordinate"] = own.get(name, "(1, 2), (1, 3), (2, 3)")
    coupled = set(pairs)
    for frame in frames_of(name):
        assert machine(name).frame(frame).diagonal == (frame not in coupled)
        notes = hamel(machine(name), frame=frame).notes
        assert len(notes) == (frame in coupled)
        assert all(f"frame {frame!r}" in note and pairs[frame] in note for note in notes)


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


@pytest.mark.parametrize(("make", "given", "by_hand", "reached"), COUNTS, ids=["cylinder", "sphere", "torus", "full"])
def test_operation_counts(make, given, by_hand, reached):
    counts = [instructions(form(make(**given), [Gravity()])) for form in (canonical, hamel)]
    assert counts[0] <= 1.2 * by_hand[0]
    assert counts[1] <= 1.3 * by_hand[1]
    assert all(count <= before for count, before in zip(counts, reached, strict=True)), counts
