"""Motions: their derivatives, limits, smoothness, and what noise leaves of them."""

import numpy as np
import pytest

from models import Motion, torus
from models.effects import Gravity
from models.motions.hermite_splines import hermite
from models.motions.splines import Ends, natural
from models.motions.timing_laws import on_path

Q0, Q1 = [0.0, 0.4, -0.9], [2.0, 0.8, -1.3]
RNG = np.random.default_rng(7)
TIMES = np.array([0.0, 0.3, 0.45, 1.0, 1.4])
POINTS = RNG.normal(size=(5, 3))
MOTIONS = {
    "quintic": Motion.quintic(Q0, Q1, 1.4),
    "septic": Motion.septic(Q0, Q1, 1.4),
    "trapezoidal": Motion.trapezoidal(Q0, Q1, 1.5, 4.0),
    "s_curve": Motion.s_curve(Q0, Q1, 1.5, 4.0, 30.0),
    "spline of degree 3": Motion.through(TIMES, POINTS, degree=3),
    "spline of degree 5": Motion.through(TIMES, POINTS),
    "spline of degree 7": Motion.through(TIMES, POINTS, degree=7),
    "natural spline": Motion.through(TIMES, POINTS, ends=natural(5)),
    "periodic spline": Motion.through(TIMES, np.vstack([POINTS[:4], POINTS[:1]]), ends=Ends(periodic=True)),
    "expression": Motion.of_time(lambda t: [np.sin(t), t**3, 1.0], 2.0),
    "on a path": on_path(Motion.through([0, 0.4, 1], POINTS[:3], ends=natural(5)), Motion.septic(0.0, 1.0, 2.0)),
    "given q, v": Motion.from_samples(TIMES, np.sin(TIMES), np.cos(TIMES)),
    "given q, v, a": Motion.from_samples(TIMES, np.sin(TIMES), np.cos(TIMES), -np.sin(TIMES)),
    "interpolated": Motion.from_samples(np.linspace(0, 1, 20), np.linspace(0, 1, 20) ** 2, noise=0.0),
    "smoothed": Motion.from_samples(np.linspace(0, 1, 50), np.linspace(0, 1, 50) ** 2 + 1e-3 * RNG.normal(size=50)),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_derivatives_belong_together(name):
    motion, h = MOTIONS[name], 1e-5
    edges = np.concatenate([motion.breaks, [motion.start, motion.end], TIMES])
    t = RNG.uniform(motion.start, motion.end, 60)
    t = t[np.min(np.abs(t[:, None] - edges), axis=1) > 2 * h]
    for order in (0, 1, 2):
        slope = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2 * h)
        expected = motion.derivative(t, order + 1)
        scale = np.max(np.abs(expected)) + 1.0
        assert np.max(np.abs(slope - expected)) < 2e-4 * scale, order
    # What is said to be continuous is.
    inner = motion.breaks[(motion.breaks > motion.start) & (motion.breaks < motion.end)]
    for order in range(int(min(motion.smoothness, 3)) + 1 if len(inner) else 0):
        jump = motion.derivative(inner, order) - motion.derivative(np.nextafter(inner, -1.0), order)
        assert np.max(np.abs(jump)) < 1e-9 * (1.0 + np.max(np.abs(motion.derivative(inner, order))))


@pytest.mark.parametrize(
    ("name", "orders"), [("quintic", 3), ("septic", 4), ("trapezoidal", 2), ("s_curve", 3), ("spline of degree 5", 3)]
)
def test_rest_to_rest(name, orders):
    motion = MOTIONS[name]
    first, last = (POINTS[0], POINTS[-1]) if name.startswith("spline") else (Q0, Q1)
    np.testing.assert_allclose(motion.q(motion.start), first, atol=1e-13)
    np.testing.assert_allclose(motion.q(motion.end), last, atol=1e-13)
    for order in range(1, orders):
        for t in (motion.start, motion.end):
            value = np.abs(motion.derivative(t, order))
            # A trapezoid and an S-curve start with a jump of the next derivative; the ends count from inside.
            assert np.max(value) < 1e-9 or (order == orders - 1 and name == "trapezoidal" and t == 0.0)


@pytest.mark.parametrize("distance", [0.01, 0.3, 5.0])
@pytest.mark.parametrize("limits", [(1.0, 2.0, 30.0), (1.0, 20.0, 3.0), (9.0, 1.0, 1.0), (0.5, 0.7, 100.0)])
def test_profiles_are_as_fast_as_their_limits(distance, limits):
    v, a, j = limits
    for motion, highest in (
        (Motion.trapezoidal([0.0, 1.0], [distance, 1.0 + distance / 3], v, a), 2),
        (Motion.s_curve([0.0, 1.0], [distance, 1.0 + distance / 3], v, a, j), 3),
    ):
        t = np.unique(np.concatenate([motion.times, np.linspace(0.0, motion.end, 2001)]))
        peaks = [np.max(np.abs(motion.derivative(t, order)), axis=0) for order in (1, 2, 3)]
        for order in range(1, highest + 1):
            assert peaks[order - 1][0] <= limits[order - 1] * (1 + 1e-9)
            np.testing.assert_allclose(peaks[order - 1][1], peaks[order - 1][0] / 3, rtol=1e-9)  # synchronised
        assert peaks[highest - 1][0] == pytest.approx(limits[highest - 1], rel=1e-9)  # the highest one is used up
        slower = motion.end * 1.7
        again = (
            Motion.trapezoidal(0.0, distance, v, a, slower)
            if highest == 2
            else Motion.s_curve(0.0, distance, v, a, j, slower)
        )
        assert again.end == pytest.approx(slower, rel=1e-12)
        assert again.q(slower)[0] == pytest.approx(distance, rel=1e-12)
    # The trapezoid is the minimum time under two limits, in closed form.
    expected = 2 * np.sqrt(distance / a) if v * v / a >= distance else distance / v + v / a
    assert Motion.trapezoidal(0.0, distance, v, a).end == pytest.approx(expected, rel=1e-12)


def test_splines_of_polynomials_are_exact_and_converge():
    t = np.sort(RNG.uniform(0.0, 1.0, 12))
    q = np.stack([t**5 - t**2, 3 * t**3], axis=1)
    dense = np.linspace(t[0], t[-1], 200)
    ends = [{1: [5 * s**4 - 2 * s, 9 * s**2], 2: [20 * s**3 - 2, 18 * s]} for s in (t[0], t[-1])]
    motion = Motion.through(t, q, ends=Ends(*ends))
    assert np.max(np.abs(motion.a(dense) - np.stack([20 * dense**3 - 2, 18 * dense], axis=1))) < 1e-8
    assert motion.smoothness == 4
    errors = []
    for count in (20, 40):
        s = np.linspace(0, 3, count)
        motion = Motion.through(s, np.sin(s), ends=Ends({1: 1.0, 2: 0.0}, {1: np.cos(3.0), 2: -np.sin(3.0)}))
        errors.append(np.max(np.abs(motion.q(s[:-1] + 0.05)[:, 0] - np.sin(s[:-1] + 0.05))))
    assert np.log2(errors[0] / errors[1]) > 5.3  # order 6


def test_hermite_reproduces_a_septic():
    t = np.array([0.0, 0.7, 1.1])
    values = np.stack([[np.prod(range(8 - k, 8)) * s ** (7 - k) for k in range(4)] for s in t])[:, :, None]
    dense = np.linspace(0, 1.1, 50)
    assert np.max(np.abs(hermite(t, values)(dense)[:, 0] - dense**7)) < 1e-13


@pytest.mark.parametrize("given", [None, 1e-4])
@pytest.mark.parametrize("rate", [100, 1000])
def test_noise_gives_the_torque_error_that_is_reported(rate, given):
    exact = Motion.of_time(lambda t: [np.sin(2 * t), 0.4 + 0.3 * np.cos(3 * t), 0.5 * np.sin(t) - 1], 4.0)
    t = np.arange(4 * rate + 1) / rate
    samples = exact.q(t) + 1e-4 * np.random.default_rng(11).normal(size=(len(t), 3))
    motion = Motion.from_samples(t, samples, noise=given)
    arm, effects = torus(), [Gravity()]
    truth = exact.torques(arm, effects, times=t).tau
    table = motion.torques(arm, effects)
    error = np.sqrt(np.mean((table.tau - truth) ** 2, axis=0))
    reported = np.sqrt(np.mean(table.uncertainty**2, axis=0))
    assert np.all(error < 3 * reported)
    assert np.all(reported < 3 * error)
    raw_error = np.sqrt(np.mean((motion.differenced().torques(arm, effects).tau - truth) ** 2, axis=0))
    assert np.all(raw_error > (5 if rate == 100 else 300) * error)
    smoothed = motion.smoothed
    np.testing.assert_allclose(smoothed.noise, 1e-4, rtol=0.12)
    assert np.all(smoothed.residual < 1.1e-4)
    assert np.all(smoothed.freedom < 0.5 * len(t))


def test_the_covariance_covers_the_error():
    # 40 records of one motion: the scatter of q, v, a in the middle is the one that each record reports.
    t = np.linspace(0.0, 2.0, 201)
    found, reported = [], []
    for seed in range(40):
        noisy = np.sin(3 * t) + 1e-3 * np.random.default_rng(seed).normal(size=len(t))
        motion = Motion.from_samples(t, noisy, noise=1e-3)
        exact = [np.sin(3.0), 3 * np.cos(3.0), -9 * np.sin(3.0)]
        found.append([motion.derivative(1.0, order)[0] - exact[order] for order in range(3)])
        reported.append(np.sqrt(np.diag(motion.smoothed.covariance(np.array([1.0]))[0, 0])))
    ratio = np.sqrt(np.mean(np.square(found), axis=0)) / np.mean(reported, axis=0)
    assert np.all((ratio > 1 / 3) & (ratio < 3))


def test_samples_without_noise_are_followed():
    t = np.linspace(0.0, 2.0, 400)
    for motion in (Motion.from_samples(t, np.sin(3 * t)), Motion.from_samples(t, np.sin(3 * t), noise=0.0)):
        inner = t[20:-20]
        assert np.max(np.abs(motion.a(inner)[:, 0] + 9 * np.sin(3 * inner))) < 1e-4
    assert any("no noise can be detected" in note for note in Motion.from_samples(t, np.sin(3 * t)).notes)
    still = Motion.from_samples(t, np.zeros((400, 2)))
    assert np.max(np.abs(still.a(t))) < 1e-12


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Motion.quintic([0, 1], [1], 1.0), "q0 has 2 components, q1 has 1"),
        (lambda: Motion.quintic([0, np.nan], [1, 1], 1.0), "q0"),
        (lambda: Motion.quintic([0], [1], -1.0), "duration"),
        (lambda: Motion.quintic("abc", [1], 1.0), "q0"),
        (lambda: Motion.trapezoidal([0, 0], [1, 1], 0.0, 1.0), "velocity"),
        (lambda: Motion.trapezoidal([0, 0], [0, 0], 1.0, 1.0), "nothing moves"),
        (lambda: Motion.trapezoidal([0], [1], 1.0, 1.0, 0.5), "the limits need 2 s"),
        (lambda: Motion.s_curve([0, 0], [1, 1], 1.0, 1.0, [1.0, 1.0, 1.0]), "jerk"),
        (lambda: Motion.through([0, 1, 1], [[0], [1], [2]]), "repeated"),
        (lambda: Motion.through([0, 1, 2], [[0], [1]]), "expected one row for each time"),
        (lambda: Motion.through([0, 1, 2], [[0], [1], [2]], degree=4), "odd"),
        (lambda: Motion.through([0, 1, 2], [[0], [1], [2]], ends=Ends({1: 0.0})), "needs 4"),
        (lambda: Motion.through([0, 1], [[0], [1]], ends=natural(5)), "do not fix"),
        (lambda: Motion.from_samples([0, 1, 2], [0, 1, 2]), "at least 8"),
        (lambda: Motion.from_samples(range(9), range(9), noise=-1.0), "noise"),
        (lambda: Motion.from_samples(range(9), np.zeros((9, 2)), noise=[1.0, 0.0]), "noise"),
        (lambda: Motion.from_samples([0, 1, 2], [0, 1, 2], [57.3, 57.3, 57.3]), "deg/s"),
        (lambda: Motion.of_time(lambda t: [t], 0.0), "start < end"),
        (lambda: MOTIONS["quintic"].q(1.5), "the motion runs from 0 to 1.4"),
        (lambda: MOTIONS["quintic"].torques(torus(), times=[1.0, 0.5]), "increasing"),
        (lambda: Motion.quintic([0, 0], [1, 1], 1.0).torques(torus()), "torus has 3"),
    ],
)  # fmt: skip
def test_wrong_motions_are_refused_in_words(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_functions_that_no_symbol_fits():
    with pytest.raises(TypeError, match="a CasADi symbol"):
        Motion.of_time(lambda t: [float(t)], 1.0)
    with pytest.raises(TypeError, match="expected a function"):
        Motion.of_time(3.0, 1.0)
