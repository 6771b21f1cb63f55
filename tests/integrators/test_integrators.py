"""Every integrator: order, tolerance, jumps of the control, structure, long-time energy, stiffness, failures."""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from models import cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, lagrange
from ocp import Bolza, Control, Fixed, Problem, System, end, integrators, legendre, simulate, solve, start, uniform
from ocp.integrators.adaptive_step import AdaptiveStep
from ocp.integrators.cvodes import Cvodes
from ocp.integrators.fixed_step import FixedStep
from ocp.integrators.runge_kutta import RungeKutta
from ocp.integrators.symplectic import asymmetry, canonical_matrix
from ocp.integrators.tableaux import DORMAND_PRINCE_5, DORMAND_PRINCE_8, KUTTA, Tableau, gauss, radau_iia
from ocp.integrators.trapezoid import PredictorCorrector

none = ca.SX(0, 1)
# name -> (method of a step, order, numbers of steps over the interval)
COARSE, MEDIUM, FINE = (6, 9, 13, 19), (20, 30, 45, 67), (200, 300, 450, 675)
FIXED = {
    "euler": (integrators.euler, 1, FINE),
    "heun": (integrators.heun, 2, FINE),
    "runge_kutta_4": (integrators.runge_kutta_4, 4, MEDIUM),
    "predictor_corrector, 1 correction": (lambda h: integrators.predictor_corrector(h, 1), 2, FINE),
    "predictor_corrector, 2 corrections": (integrators.predictor_corrector, 2, FINE),
    "predictor_corrector, 5 corrections": (lambda h: integrators.predictor_corrector(h, 5), 2, FINE),
    "stoermer_verlet": (integrators.stoermer_verlet, 2, FINE),
    "gauss(1), implicit midpoint": (lambda h: integrators.gauss(1, h), 2, FINE),
    "gauss(2)": (lambda h: integrators.gauss(2, h), 4, MEDIUM),
    "gauss(3)": (lambda h: integrators.gauss(3, h), 6, COARSE),
    "radau_iia(1), implicit Euler": (lambda h: integrators.radau_iia(1, h), 1, FINE),
    "radau_iia(2)": (lambda h: integrators.radau_iia(2, h), 3, FINE),
    "radau_iia(3)": (lambda h: integrators.radau_iia(3, h), 5, MEDIUM),
    "dormand_prince_5": (lambda h: FixedStep(RungeKutta(DORMAND_PRINCE_5), h), 5, MEDIUM),
    "dormand_prince_8": (lambda h: FixedStep(RungeKutta(DORMAND_PRINCE_8), h), 8, COARSE),
}
ADAPTIVE = {
    "extrapolation": integrators.extrapolation,
    "dormand_prince_5": integrators.dormand_prince_5,
    "dormand_prince_8": integrators.dormand_prince_8,
    "radau_5": integrators.radau_5,
    "adams": integrators.adams,
    "bdf": integrators.bdf,
}
EVERY = {
    **{name: make(0.01) for name, (make, _, _) in FIXED.items()},
    **{n: make(1e-9, 1e-9) for n, make in ADAPTIVE.items()},
}


@cache
def oscillator():
    """Return a Hamiltonian system that is not separable, H = p^2 (1 + q^2 / 2) / 2 - cos q - u q."""
    q, p, u = ca.SX.sym("q"), ca.SX.sym("p"), ca.SX.sym("u")
    energy = p**2 * (1 + q**2 / 2) / 2 - ca.cos(q) - u * q
    return System(ca.vertcat(q, p), u, none, ca.vertcat(ca.gradient(energy, p), -ca.gradient(energy, q)))


def push(t):
    return [0.3 * np.cos(2 * t)]


@cache
def exact(duration):
    return simulate(oscillator(), [0.8, 0.5], push, [duration], rtol=1e-13, atol=1e-13).x[0]


def measured_order(make, counts, duration=2.0):
    errors = [
        np.max(
            np.abs(simulate(oscillator(), [0.8, 0.5], push, [duration], method=make(duration / n)).x - exact(duration))
        )
        for n in counts
    ]
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0], errors


@pytest.mark.parametrize("name", FIXED)
def test_order(name):
    make, order, counts = FIXED[name]
    found, errors = measured_order(make, counts)
    assert min(errors) > 3e-13  # no rounding
    assert max(errors) < 0.3
    assert found == pytest.approx(order, abs=0.35)
    assert make(0.1).rule.order == order


@pytest.mark.parametrize("name", ADAPTIVE)
def test_error_follows_the_tolerance(name):
    tolerances = [1e-5, 1e-7, 1e-9, 1e-11] if name != "bdf" else [1e-4, 1e-6, 1e-8]
    found = [simulate(oscillator(), [0.8, 0.5], push, [2.0], method=ADAPTIVE[name](tol, tol)) for tol in tolerances]
    errors = [np.max(np.abs(motion.x - exact(2.0))) for motion in found]
    assert all(error < 100 * tol for error, tol in zip(errors, tolerances, strict=True))
    assert errors[-1] < 1e-3 * errors[0]
    counts = [motion.evaluations for motion in found]
    assert counts == sorted(counts)


@pytest.mark.parametrize("name", EVERY)
def test_jumps_of_the_control_end_steps(name):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system, jump = System(x, u, none, ca.vertcat(x[1], u)), 1 / 3
    found = simulate(
        system, [0.0, 0.0], lambda t: [1.0 if t < jump else -1.0], [jump, 0.8], breaks=[jump], method=EVERY[name]
    )
    way = jump**2 / 2 + jump * (0.8 - jump) - (0.8 - jump) ** 2 / 2
    # All but methods of order 1 integrate the pieces, of degree 2 in time, exactly.
    first = name == "euler" or "radau_iia(1)" in name
    np.testing.assert_allclose(found.x[:, 1], [jump, 2 * jump - 0.8], rtol=0, atol=1e-12 if name in FIXED else 1e-7)
    np.testing.assert_allclose(
        found.x[:, 0], [jump**2 / 2, way], rtol=0, atol=1e-2 if first else 1e-12 if name in FIXED else 1e-7
    )
    np.testing.assert_array_equal(found.u, [[1.0], [-1.0]])


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("control", Control)
def test_control_of_a_solution(name, control):
    x, u, m = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
    system = System(x, u, m, ca.vertcat(x[1], u / m), {}, {"m": 2.0})
    ends = start(system.x, [0.0, 0.3]), end(system.x, [1.0, 0.0])
    solution = solve(Problem(system, Fixed(1.5), Bolza(running=u**2), ends), legendre(3, control), uniform(4))
    t = np.array([0.2, 0.75, 1.0, 1.5])
    found = simulate(system, [0.0, 0.3], solution, t, method=EVERY[name])
    order = FIXED[name][1] if name in FIXED else 9
    assert found.ok
    np.testing.assert_allclose(found.x, solution.x(t), rtol=0, atol={1: 5e-2, 2: 1e-4}.get(order, 1e-7))
    np.testing.assert_allclose(found.u[:-1:2], solution.u(t[:-1:2]), rtol=0, atol=1e-12)


def test_one_correction_is_heun_and_many_are_the_trapezoid_rule():
    system, t = oscillator(), [0.5, 1.0]
    once = simulate(system, [0.8, 0.5], push, t, method=integrators.predictor_corrector(0.1, 1))
    np.testing.assert_allclose(
        once.x, simulate(system, [0.8, 0.5], push, t, method=integrators.heun(0.1)).x, rtol=1e-14
    )
    h, x0 = 0.1, np.array([0.8, 0.5])
    x1 = simulate(system, x0, push, [h], method=integrators.predictor_corrector(h, 30)).x[0]
    f = ca.Function("f", [system.x, system.u], [system.rate])
    slopes = np.array(f(x0, push(0.0)) + f(x1, push(h))).ravel()
    np.testing.assert_allclose(x1, x0 + h / 2 * slopes, rtol=0, atol=1e-15)


def test_tableaux_satisfy_the_simplifying_assumptions():
    for tableau in (*(gauss(s) for s in range(1, 7)), *(radau_iia(s) for s in range(1, 7))):
        s, c = len(tableau.b), tableau.c
        for k in range(1, s + 1):
            np.testing.assert_allclose(tableau.a @ c ** (k - 1), c**k / k, atol=1e-14)
        for k in range(1, tableau.order + 1):
            assert tableau.b @ c ** (k - 1) == pytest.approx(1 / k, abs=1e-14)
    for tableau in (gauss(s) for s in range(1, 7)):  # b_i a_ij + b_j a_ji = b_i b_j: symplectic
        product = tableau.b[:, None] * tableau.a
        np.testing.assert_allclose(product + product.T, np.outer(tableau.b, tableau.b), atol=1e-15)


STATES = {
    cylindrical: [0.3, 0.2, 0.8, 3.0, 40.0, 5.0],
    spherical: [0.9, 0.1, 0.2, 0.85, 5.0, 3.0, 0.5, 2.0],
    torus: [0.3, 0.4, -0.8, 3.0, 2.0, 1.0],
}


def broken(machine, frame, method, h=1e-2):
    """Return |J' W(x1) J - W(x0)| of one step, W the exact two-form of (q, p) in the frame: dq with d(F'p)."""
    arm = machine()
    system, n = canonical(arm, [Gravity()], frame=frame), len(arm.coordinates)
    x0, u = np.array(STATES[machine]), np.linspace(-1.0, 1.0, n)
    momenta = ca.SX.sym("p", n)
    one_form = ca.vertcat(arm.frame(frame).matrix.T @ momenta, ca.SX.zeros(n))
    slope = ca.jacobian(one_form, ca.vertcat(arm.q, momenta))
    form = ca.Function("W", [ca.vertcat(arm.q, momenta)], [ca.densify(slope.T - slope)])
    if frame == "coordinate":
        np.testing.assert_array_equal(np.abs(np.array(form(x0))), np.abs(canonical_matrix(n)))
    step = method(h).rule.step(system)
    given = step.mx_in()
    jacobian = ca.Function("J", given, [ca.jacobian(step.call(given)[0], given[0])])
    at = x0, h, np.tile(u[:, None], step.size2_in(2)), []
    tangent = np.array(jacobian(*at))
    return np.max(np.abs(tangent.T @ np.array(form(step(*at)[0])) @ tangent - np.array(form(x0))))


SYMPLECTIC = ["stoermer_verlet", "gauss(1), implicit midpoint", "gauss(2)", "gauss(3)"]


@pytest.mark.parametrize("name", SYMPLECTIC)
@pytest.mark.parametrize("machine", STATES)
def test_symplectic_in_coordinates_with_gravity_and_drives(machine, name):
    assert broken(machine, "coordinate", FIXED[name][0]) < 2e-14


@pytest.mark.parametrize("machine", [cylindrical, torus])
@pytest.mark.parametrize("name", SYMPLECTIC[1:])
def test_gauss_is_symplectic_in_constant_frames(machine, name):
    assert broken(machine, "regular", FIXED[name][0]) < 2e-14


def test_what_is_not_symplectic():
    for name in ("runge_kutta_4", "predictor_corrector, 2 corrections", "radau_iia(3)"):
        assert broken(torus, "coordinate", FIXED[name][0]) > 1e-12
    # In a frame that varies the structure matrix depends on the state.
    assert broken(spherical, "regular", FIXED["gauss(1), implicit midpoint"][0]) > 1e-9
    assert broken(spherical, "regular", FIXED["gauss(2)"][0]) > 1e-12


def test_canonical_equations_are_told_from_others():
    x = STATES[spherical]
    assert asymmetry(canonical(spherical(), [Gravity()], frame="coordinate"), x, np.ones(4), []) < 1e-14
    assert asymmetry(canonical(spherical(), [Gravity()]), x, np.ones(4), []) > 1e-4
    for system in (canonical(spherical(), [Gravity()]), lagrange(spherical(), [Gravity()])):
        with pytest.raises(ValueError, match=r"not .* of a Hamiltonian; use the canonical form in a coordinate frame"):
            simulate(system, x, np.zeros(4), 0.1, method=integrators.stoermer_verlet(0.01))


def energy_errors(method, step, steps=100_000):
    """Return the largest energy error [J] in each tenth of a free motion of the torus-like arm with gravity."""
    arm = torus()
    system = canonical(arm, [Gravity()], frame="coordinate")
    q, v = np.array([0.0, -1.2, 0.4]), np.array([1.0, 0.5, -0.5])
    x0 = np.concatenate([q, np.array(ca.Function("g", [arm.q], [arm.metric])(q)) @ v])
    motion = simulate(system, x0, np.zeros(3), step * np.arange(0, steps + 1, 50), method=method(step))
    assert motion.ok
    energy = motion.signal("energy")[:, 0]
    return np.array([np.max(np.abs(part - energy[0])) for part in np.array_split(energy[1:], 10)])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gauss(2)", "stoermer_verlet"])
def test_energy_is_bounded_over_1e5_steps(name):
    errors = energy_errors(FIXED[name][0], 0.02)
    assert errors[-1] < 1.3 * errors[0]
    # The bound is that of the order: half the step, 2^-order the error.
    shorter = energy_errors(FIXED[name][0], 0.01, 10_000)
    assert np.log2(errors.max() / shorter.max()) == pytest.approx(FIXED[name][1], abs=0.5)


@pytest.mark.parametrize("name", ["runge_kutta_4", "predictor_corrector, 2 corrections"])
def test_energy_drifts_over_1e5_steps(name):
    errors = energy_errors(FIXED[name][0], 0.01)
    assert errors[-1] > 4.0 * errors[0]


def relaxation(rate):
    """Return x' = -rate (x - u_1) + u_2, the solution cos t for u = (cos t, -sin t)."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u", 2)
    return System(x, u, none, -rate * (x - u[0]) + u[1])


def test_stiff_relaxation():
    def u(t):
        return [np.cos(t), -np.sin(t)]

    t = np.array([1.0, 2.0])
    for method in (integrators.radau_5(1e-7, 1e-7), integrators.bdf(1e-7, 1e-7), integrators.radau_iia(3, 0.1)):
        found = simulate(relaxation(1e6), [1.0], u, t, method=method)
        assert found.ok
        np.testing.assert_allclose(found.x[:, 0], np.cos(t), rtol=0, atol=1e-5)
        assert found.evaluations < 1500
    explicit = simulate(relaxation(1e6), [1.0], u, t, method=integrators.runge_kutta_4(0.01))
    assert "f is not finite" in explicit.message
    assert np.all(np.isnan(explicit.x))
    many = simulate(relaxation(1e4), [1.0], u, t, method=integrators.dormand_prince_5(1e-6, 1e-6))
    few = simulate(relaxation(1e4), [1.0], u, t, method=integrators.radau_5(1e-6, 1e-6))
    assert many.ok
    assert many.evaluations > 50 * few.evaluations


def test_stiff_oscillation():
    # A slow pendulum with a stiff spring of frequency 1e4, lightly damped and out of its rest position.
    x = ca.SX.sym("x", 4)
    system = System(x, none, none, ca.vertcat(x[1], -ca.sin(x[0]), x[3], -1e8 * (x[2] - x[0]) - 20.0 * x[3]))
    x0 = [0.5, 0.0, 0.5, 0.0]
    slow = simulate(System(x[:2], none, none, system.rate[:2]), x0[:2], [], [2.0]).x[0]
    found = simulate(system, x0, [], [2.0], method=integrators.radau_5(1e-6, 1e-6))
    np.testing.assert_allclose(found.x[0, :2], slow, rtol=0, atol=1e-4)
    np.testing.assert_allclose(found.x[0, 2], slow[0], rtol=0, atol=1e-4)
    assert found.evaluations < 20_000


@pytest.mark.parametrize("name", ADAPTIVE)
def test_blow_up_is_a_message(name):
    x = ca.SX.sym("x")
    found = simulate(System(x, none, none, x**2), [1.0], [], [0.5, 0.9, 1.5, 2.0], method=ADAPTIVE[name](1e-8, 1e-8))
    assert "stopped at t = " in found.message
    np.testing.assert_allclose(found.x[:2, 0], [2.0, 10.0], rtol=1e-4)
    assert np.all(np.isnan(found.x[2:]))


def test_implicit_step_that_is_too_long_is_a_message():
    x = ca.SX.sym("x")
    found = simulate(System(x, none, none, x**2), [1.0], [], [0.5, 2.0], method=integrators.gauss(2, 1e-3))
    assert "did not converge; take a smaller step" in found.message
    assert found.x[0, 0] == pytest.approx(2.0, rel=1e-9)
    assert np.isnan(found.x[1, 0])


@pytest.mark.parametrize("count", [1, 16, 17, 5000])
def test_any_number_of_steps_is_the_same_method(count):
    h, n = 1e-3, count
    found = simulate(oscillator(), [0.8, 0.5], [0.1], h * np.arange(n + 1), method=integrators.heun(h))
    f = ca.Function("f", [oscillator().x, oscillator().u], [oscillator().rate])
    x = np.array([0.8, 0.5])
    for _ in range(min(n, 40)):
        k = np.array(f(x, 0.1)).ravel()
        x = x + h / 2 * (k + np.array(f(x + h * k, 0.1)).ravel())
    np.testing.assert_allclose(found.x[min(n, 40)], x, rtol=0, atol=1e-14)
    assert found.evaluations == 2 * n
    assert np.all(np.isfinite(found.x))


def test_independent_engine():
    integrate = pytest.importorskip("scipy.integrate")
    system = canonical(spherical(), [Gravity()])
    u = np.array([1.0, 2.0, 0.1, 3.0])
    f = ca.Function("f", [system.x, system.u], [ca.densify(system.rate)])
    for theirs, ours in (("DOP853", integrators.dormand_prince_8), ("Radau", integrators.radau_5)):
        tol = 1e-10 if theirs == "DOP853" else 1e-7
        other = integrate.solve_ivp(
            lambda t, x: np.array(f(x, u)).ravel(), (0.0, 0.8), STATES[spherical], theirs, rtol=tol, atol=tol
        )
        own = simulate(system, STATES[spherical], u, [0.8], method=ours(tol, tol))
        np.testing.assert_allclose(own.x[0], other.y[:, -1], rtol=0, atol=3e3 * tol)
        assert own.evaluations < 3 * (other.nfev + 10)


def test_wrong_input():
    system, f = oscillator(), [0.8, 0.5]
    for step in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=r"step: got .*expected a finite number of seconds > 0"):
            integrators.euler(step)
    with pytest.raises(ValueError, match="corrections: got 0"):
        integrators.predictor_corrector(0.1, 0)
    with pytest.raises(ValueError, match="stages: got 0"):
        integrators.gauss(0, 0.1)
    with pytest.raises(ValueError, match="rtol, atol: got -1"):
        integrators.dormand_prince_8(-1.0)
    with pytest.raises(ValueError, match="has no error estimate; use FixedStep"):
        AdaptiveStep(RungeKutta(KUTTA))
    with pytest.raises(ValueError, match="has no error estimate"):
        AdaptiveStep(PredictorCorrector())
    with pytest.raises(TypeError, match="family: got 'bdf'"):
        Cvodes("bdf")
    with pytest.raises(TypeError, match=r"method: got 'rk4', expected an integrator such as"):
        simulate(system, f, [0.0], 1.0, method="rk4")
    with pytest.raises(ValueError, match=r"rtol: .*has no error control; its accuracy is that of its step"):
        simulate(system, f, [0.0], 1.0, method=integrators.euler(0.1), rtol=1e-6)
    with pytest.raises(ValueError, match="atol: has 3 components"):
        simulate(system, f, [0.0], 1.0, method=integrators.dormand_prince_5(1e-6, np.ones(3)))
    with pytest.raises(ValueError, match="add up to"):
        Tableau("wrong", np.zeros((1, 1)), np.array([0.5]), 1)
    with pytest.raises(ValueError, match="expected 1 columns"):
        Tableau("wrong", np.zeros((2, 2)), np.array([1.0]), 1)
