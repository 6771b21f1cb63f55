"""Torques of motions: closed forms, forward simulation, loads of drives, solutions, exported code."""

import ctypes
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import machine

from models import (
    Envelope,
    Motion,
    along_tool_path,
    cylindrical,
    inverse_dynamics,
    line,
    path_system,
    path_through,
    right_hand_side,
    spherical,
    timed,
    torus,
    write_code,
    write_function,
)  # fmt: skip
from models.effects import (
    Coulomb,
    ElasticDrive,
    Gravity,
    Payload,
    RotorInertia,
    ToolForce,
    TorqueSpeed,
    Viscous,
)  # fmt: skip
from models.forms import canonical, hamel, lagrange
from models.torques.drive_loads import SLACK
from models.torques.limit_check import broken_limits
from ocp import (
    Bolza,
    Control,
    Free,
    Problem,
    along,
    end,
    load,
    point_to_point,
    radau,
    save,
    simulate,
    solve,
    start,
    uniform,
)  # fmt: skip

G, MASS = 9.81, 2.0
NOTHING = {f"Theta_{k}_{ii}": 0.0 for k in (2, 3) for ii in ("11", "22", "33")}
CYLINDER = cylindrical(A=0.0, m_2=0.0, m_3=MASS, **{f"Theta_{k}_33": 0.0 for k in (1, 2, 3)}, l_T=0.0, physical=False)
SPHERE = spherical(s_2=0.0, m_2=0.0, m_3=MASS, Theta_1_33=0.0, **NOTHING, l_T=0.0, physical=False)
ARM = torus(L_2=0.6, L_3=1.0, m_2=0.0, m_3=MASS, Theta_1_33=0.0, **NOTHING, l_T=0.0, physical=False)


def test_bead_on_a_rod_at_constant_rotation():
    w, r0, m = 1.3, 0.4, MASS
    motion = Motion.of_time(lambda t: [w * t, 0.2, r0 * np.cosh(w * t)], 1.5)
    table = motion.torques(CYLINDER)
    expected = np.stack([m * r0**2 * w**2 * np.sinh(2 * w * table.t), 0 * table.t, 0 * table.t], axis=1)
    assert np.max(np.abs(table.tau - expected)) < 1e-10
    parts = table.split
    assert set(parts) == {"inertia", "coriolis"}
    assert np.max(np.abs(parts["coriolis"][:, 2] + m * r0 * np.cosh(w * table.t) * w**2)) < 1e-10


def test_conical_motion_needs_the_tension_only():
    b, length = 0.7, 0.9  # angle from the downward vertical
    w = np.sqrt(G / (length * np.cos(b)))
    motion = Motion.of_time(lambda t: [np.pi - b, w * t, 0.0, length], 2.0)
    tau = motion.torques(SPHERE, [Gravity(G)]).tau
    expected = [0.0, 0.0, 0.0, -MASS * G / np.cos(b)]
    assert np.max(np.abs(tau - expected)) < 1e-10


def test_static_holding_torques():
    rng = np.random.default_rng(2)
    for arm, hold in (
        (cylindrical(), lambda n, q: [0.0, (n["m_2"] + n["m_3"]) * G, 0.0]),
        (
            spherical(),
            lambda n, q: [
                -(n["m_2"] * n["s_2"] + n["m_3"] * q[3]) * G * np.sin(q[0]), 0.0, 0.0, n["m_3"] * G * np.cos(q[0])
            ],
        ),
        (
            torus(),
            lambda n, q: [
                0.0,
                (n["m_2"] / 2 + n["m_3"]) * n["L_2"] * G * np.cos(q[1])
                + n["m_3"] / 2 * n["L_3"] * G * np.cos(q[1] + q[2]),
                n["m_3"] / 2 * n["L_3"] * G * np.cos(q[1] + q[2]),
            ],
        ),
    ):  # fmt: skip
        for q in rng.uniform(-1.5, 1.5, (20, len(arm.coordinates))):
            tau = Motion.of_time(lambda t, q=q: list(q), 1.0).torques(arm, [Gravity(G)], times=[0.0, 1.0]).tau
            assert np.max(np.abs(tau - hold(arm.nominal, q))) < 1e-10


# J* = 12 m^2 d^2 / T^3 + m^2 g^2 T of a point mass m that a straight line of length d takes in T = 1.2 s.
STRAIGHT = {
    "cylindrical": (CYLINDER, [0.0, 0.2, 1.0], [1.2, 0.5, 0.6], 490.1324659619),
    "spherical": (SPHERE, [np.pi / 2 + 0.3, 0.0, 0.0, 0.9], [np.pi / 2 - 0.5, 1.1, 0.0, 0.7], 489.6930762671),
    "torus": (ARM, [0.0, 0.9, -1.4], [1.0, 0.5, -1.0], 483.5248056321),
}


@pytest.mark.parametrize("name", STRAIGHT)
def test_straight_lines_of_a_point_mass(name):
    arm, q0, q1, cost = STRAIGHT[name]
    tool = ca.Function("tool", [arm.q], [arm.tool])
    p0, p1 = (np.array(tool(q)).ravel() for q in (q0, q1))
    duration, path = 1.2, line(p0, p1)
    law = Motion.of_time(lambda t: path.length * (3 * (t / duration) ** 2 - 2 * (t / duration) ** 3), duration)
    motion = along_tool_path(arm, path, law, near=q0)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    t = duration * (nodes + 1) / 2
    table = motion.torques(arm, [Gravity(G)], times=t)
    acceleration = law.a(t) * (p1 - p0) / path.length
    force = MASS * acceleration + [0.0, 0.0, MASS * G]
    slope = ca.Function("J", [arm.q], [ca.jacobian(arm.tool, arm.q)])
    expected = np.array([np.array(slope(q)).T @ f for q, f in zip(table.q, force, strict=True)])
    assert np.max(np.abs(table.tau - expected)) < 1e-10 * np.max(np.abs(expected))
    slopes = [np.array(slope(q)).T for q in table.q]
    squares = [np.linalg.lstsq(j, tau, rcond=1e-12)[0] for j, tau in zip(slopes, table.tau, strict=True)]
    assert duration / 2 * weights @ np.sum(np.square(squares), axis=1) == pytest.approx(cost, abs=1e-9)


ENDS = {
    "cylindrical": (cylindrical(), [0.1, 0.2, 0.4], [1.2, 0.6, 0.8]),
    "spherical": (spherical(), [0.9, 0.0, 0.0, 0.7], [1.6, 1.3, 0.5, 0.9]),
    "torus": (machine("torus_general"), [0.0, 0.4, -0.9], [1.5, 0.9, -1.6]),
}
EFFECTS = {
    "none": [],
    "gravity": [Gravity()],
    "many": [Gravity(), Payload(2.0), RotorInertia(inertia=1e-3, ratio=30.0), Viscous(3.0), Coulomb(5.0, width=0.05),
             ToolForce(force=lambda t: [10 * t, 5.0, -3.0])],
}  # fmt: skip


@pytest.mark.parametrize("effects", EFFECTS)
@pytest.mark.parametrize("name", ENDS)
def test_the_torques_make_the_motion(name, effects):
    arm, q0, q1 = ENDS[name]
    motion = Motion.septic(q0, q1, 0.8)
    table = motion.torques(arm, EFFECTS[effects])
    assert np.max(np.abs(sum(table.split.values()) - table.tau)) < 1e-11 * np.max(np.abs(table.tau))
    system, n = lagrange(arm, EFFECTS[effects]), len(arm.coordinates)
    torques = inverse_dynamics(arm, EFFECTS[effects])
    timed_inputs = torques.n_in() == 5

    def control(t):
        now = min(t, 0.8)
        inputs = [motion.q(now), motion.v(now), motion.a(now), []]
        return np.array(torques(*inputs, *([now] if timed_inputs else []))).ravel()

    x0 = np.concatenate([q0, np.zeros(system.x.numel() - n)])
    errors = []
    for tolerance in (1e-6, 1e-11):
        found = simulate(system, x0, control, [0.4, 0.8], rtol=tolerance, atol=tolerance)
        assert found.ok
        errors.append(np.max(np.abs(found.x[:, :n] - motion.q(found.t))))
    assert errors[1] < 1e-9
    assert errors[0] < 1e-4


def test_torques_of_solutions_are_their_controls(tmp_path):
    limit = [250.0, 600.0, 220.0]
    for form, frame in ((canonical, "regular"), (hamel, "ldl"), (lagrange, None)):
        arm = form(torus(), [Gravity()], frame)
        task = point_to_point(arm, ENDS["torus"][1], [1.2, 0.8, -1.3], tau=limit)
        solution = solve(task, scheme=radau(3), grid=uniform(20))
        assert solution.ok
        table = Motion.of(solution).torques(torus(), [Gravity()])
        assert np.max(np.abs(table.tau - solution.u(table.t)) / limit) < 1e-7
        save(solution, tmp_path / "solution.npz")
        loaded = load(tmp_path / "solution.npz")
        np.testing.assert_array_equal(Motion.of(loaded, arm).torques(torus(), [Gravity()]).tau, table.tau)
        with pytest.raises(ValueError, match="without its problem"):
            Motion.of(loaded)
        if form is not lagrange:
            with pytest.raises(ValueError, match="not those of this system"):
                Motion.of(loaded, form(torus(), [Gravity()], "udu"))


def test_waypoints_without_times_in_minimum_time():
    # One axis lifts a mass: bang-bang in closed form; the other axes stand still.
    arm, top = cylindrical(), 1000.0
    path = path_through([[0.3, 0.2, 0.6], [0.3, 1.0, 0.6]])
    system = path_system(arm, [Gravity(G)], path)
    limit = np.array([1e3, top, 1e3])
    problem = Problem(system, Free(1.0), Bolza(time=1.0), (
        start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0),
        along(system["tau"], -limit, limit),
    ))  # fmt: skip
    up, down = top / 65.0 - G, top / 65.0 + G
    errors = []
    for elements in (25, 100):
        solution = solve(problem, scheme=radau(3, control=Control.LINEAR), grid=uniform(elements))
        errors.append(solution.duration - np.sqrt(2 * 0.8 * (1 / up + 1 / down)))
    assert 0.0 < errors[1] < 2e-4
    assert errors[0] > 3.0 * errors[1]
    motion = timed(path, solution)
    table = motion.torques(arm, [Gravity(G)], times=np.linspace(0.0, motion.end, 400))
    assert np.max(np.abs(table.tau) / limit) < 1.0 + 1e-3
    np.testing.assert_allclose(motion.q(motion.end), [0.3, 1.0, 0.6], atol=1e-6)
    assert np.max(np.abs(np.gradient(table.q, table.t, axis=0)[1:-1] - table.v[1:-1])) < 0.05


def test_loads_of_a_swinging_axis():
    # xi = sin(2 pi t), no gravity: tau = -M w^2 sin, v = w cos, one period.
    w, mass = 2 * np.pi, 65.0
    table = Motion.of_time(lambda t: [0.0, np.sin(w * t), 0.5], 1.0).torques(
        cylindrical(), limits=[Envelope(), Envelope(peak=2000.0, speed=7.0, corner=3.0, continuous=1500.0), Envelope()]
    )
    lift = table.loads[1]
    assert lift.rms == pytest.approx(mass * w**2 / np.sqrt(2), rel=1e-5)
    assert abs(lift.peak) == pytest.approx(mass * w**2, rel=1e-5)
    assert lift.peak_time in (pytest.approx(0.25, abs=2e-3), pytest.approx(0.75, abs=2e-3))
    assert lift.speed == pytest.approx(w, rel=1e-9)
    assert lift.mean_power == pytest.approx(0.0, abs=1e-6)
    assert lift.peak_power == pytest.approx(mass * w**3 / 2, rel=1e-4)
    assert lift.peak_braking == pytest.approx(-mass * w**3 / 2, rel=1e-4)
    assert lift.motor_energy == pytest.approx(mass * w**2, rel=1e-4)
    assert lift.brake_energy == pytest.approx(-mass * w**2, rel=1e-4)
    assert lift.overheated
    # |tau| = M w^2 |sin| against 2000 at |v| = w |cos| <= 3, and a line to zero at 7 beyond.
    first = lift.exceeded[0]
    fine = np.linspace(0.0, 1.0, 2_000_001)
    speed = np.abs(w * np.cos(w * fine))
    over = mass * w**2 * np.abs(np.sin(w * fine)) > np.interp(speed, [0, 3, 7], [2000, 2000, 0]) * (1 + SLACK)
    assert first.start == pytest.approx(fine[np.argmax(over)], abs=1e-5)
    assert sum(e.end - e.start for e in lift.exceeded) == pytest.approx(np.mean(over), abs=1e-4)
    assert table.loads[0].exceeded == ()


def test_limits_of_effects_along_a_motion():
    arm, q0, q1 = ENDS["torus"]
    effects = [Gravity(), TorqueSpeed(stall=(400.0, 900.0, 300.0), no_load=6.0, peak=(1e4, 250.0, 1e4))]
    # Seven rows know nothing of the motion between them; the limits are checked along the motion.
    found = broken_limits(Motion.septic(q0, q1, 0.8).torques(arm, effects, times=np.linspace(0.0, 0.8, 7)))
    table = Motion.septic(q0, q1, 0.8).torques(arm, effects, times=np.linspace(0.0, 0.8, 40_001))
    share = table.tau / [400.0, 900.0, 300.0] + table.v / 6.0
    outside = np.any(np.abs(share) > 1.0 + SLACK, axis=1) | (np.abs(table.tau[:, 1]) > 250.0 * (1 + SLACK))
    covered = np.any([(table.t >= span.start) & (table.t <= span.end) for span in found], axis=0)
    assert 0.1 < np.mean(outside) < 0.9
    assert np.mean(covered != outside) < 2e-4
    assert {span.limit for span in found} <= {-1.0, 1.0, 250.0, -250.0}
    assert broken_limits(Motion.septic(q0, q1, 0.8).torques(arm, [Gravity()])) == ()


def test_what_the_drives_need_beside_the_torque():
    arm, q0, q1 = ENDS["torus"]
    effects = [Gravity(), ElasticDrive(stiffness=2e4, inertia=1.5)]
    table = Motion.septic(q0, q1, 0.8).torques(arm, effects, times=np.linspace(0.0, 0.8, 1001))
    np.testing.assert_allclose(table.drives["motor_q"], table.q + table.tau / 2e4, rtol=1e-12)
    # The motor accelerates its own inertia: motor_tau - tau = J d^2 motor_q / dt^2, by differences.
    inner = slice(2, -2)
    bent = np.gradient(np.gradient(table.drives["motor_q"], table.t, axis=0), table.t, axis=0)[inner]
    own = (table.drives["motor_tau"] - table.tau)[inner] / 1.5
    assert np.max(np.abs(bent - own)) < 1e-2 * np.max(np.abs(own))
    with pytest.raises(ValueError, match="jumps; use a smoother motion"):
        Motion.trapezoidal(q0, q1, 2.0, 9.0).torques(arm, effects).drives  # noqa: B018


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_exported_code_computes_the_same(tmp_path):
    arm = torus()
    functions = [inverse_dynamics(arm, [Gravity(), Payload(2.0)]), right_hand_side(hamel(arm, [Gravity()]))]
    code, header = write_code(functions, tmp_path / "arm.c")
    assert "int inverse_dynamics(const double** arg" in header.read_text().replace("casadi_real", "double")
    library = tmp_path / "arm.so"
    command = ["gcc", "-O1", "-Wall", "-Werror=implicit", "-shared", "-fPIC", str(code), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    compiled = ctypes.CDLL(str(library))
    rng = np.random.default_rng(4)
    for function in functions:
        inputs = [rng.normal(size=function.numel_in(i)) for i in range(function.n_in())]
        expected, got = np.array(function(*inputs)).ravel(), np.zeros(function.numel_out(0))
        pointers = (ctypes.POINTER(ctypes.c_double) * function.sz_arg())()
        for i, array in enumerate(inputs):
            pointers[i] = array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        results = (ctypes.POINTER(ctypes.c_double) * function.sz_res())()
        results[0] = got.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        whole, work = (ctypes.c_longlong * max(function.sz_iw(), 1))(), (ctypes.c_double * max(function.sz_w(), 1))()
        assert getattr(compiled, function.name())(pointers, results, whole, work, 0) == 0
        np.testing.assert_allclose(got, expected, rtol=1e-13)
        file = write_function(function, tmp_path / f"{function.name()}.casadi")
        again = ca.Function.load(str(file))
        np.testing.assert_array_equal(np.array(again(*inputs)).ravel(), expected)
        assert again.name_in() == function.name_in()
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".c", ".casadi", ".casadi", ".h", ".so"]
    with pytest.raises(ValueError, match="no name twice"):
        write_code([functions[0], functions[0]], tmp_path / "two.c")
    with pytest.raises(ValueError, match=r"ends in \.c"):
        write_code(functions, tmp_path / "arm.cpp")
