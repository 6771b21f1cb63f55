"""Splines for steps of any ratio, their ends, and slips of recordings."""

import numpy as np
import pytest

from models import Motion, torus
from models.effects import Gravity
from models.motions import b_splines, taylor_splines
from models.motions.splines import Ends, at_rest, interpolate, natural, not_a_knot


@pytest.mark.parametrize("degree", [3, 5, 7, 9])
@pytest.mark.parametrize("last", [1e-1, 1e-3, 1e-5])
def test_a_spline_with_one_short_step_keeps_its_points_and_conditions(degree, last):
    t = np.append(np.arange(8.0), 7.0 + last)
    y = np.stack([np.sin(t), np.cos(0.5 * t)], axis=1)
    spline = interpolate(t, y, degree, natural(degree))
    assert np.max(np.abs(spline(np.nextafter(t, -1.0)) - y)) < 1e-12
    fine = np.linspace(0.0, t[-1], 2001)
    assert np.max(np.abs(spline(fine)[:, 0] - np.sin(fine))) < 0.03
    before, after = spline(t[1:-1] * (1 - 1e-15), 2), spline(t[1:-1], 2)
    assert np.max(np.abs(before - after)) < 1e-6


@pytest.mark.parametrize("ends", [at_rest(5), natural(5), Ends(periodic=True), not_a_knot()], ids=str)
@pytest.mark.parametrize("count", [6, 9, 30])
def test_two_sets_of_equations_give_one_spline(ends, count):
    t = np.linspace(0.0, 1.0, count) + 0.2 / count * np.random.default_rng(3).uniform(-1, 1, count)
    y = np.stack([np.sin(3 * t), t**2], axis=1)
    y[-1] = y[0] if ends.periodic else y[-1]
    conditions = None if ends.continued else [
        (place, order, np.zeros(2)) for place, side in ((0, ends.start), (-1, ends.end)) for order in side
    ]  # fmt: skip
    one, other = (part.interpolate(t, y, 5, conditions, ends.periodic) for part in (b_splines, taylor_splines))
    fine = np.linspace(t[0], t[-1], 301)
    assert np.max(np.abs(one(fine) - other(fine))) < 1e-9
    if ends.periodic:
        for order in range(5):
            first, last = one(t[:1], order), one(np.nextafter(t[-1:], -1), order)
            np.testing.assert_allclose(first, last, rtol=1e-6, atol=1e-6 * 10.0**order)


def test_not_a_knot_is_exact_for_polynomials():
    for count in (3, 5, 7, 20):
        t = np.sort(np.random.default_rng(count).uniform(0.0, 1.0, count))
        degree = min(5, count - 1)
        motion = Motion.from_samples(t, t**degree, noise=0.0)
        fine = np.linspace(t[0], t[-1], 50)
        exact = degree * (degree - 1) * fine ** (degree - 2)
        assert np.max(np.abs(motion.a(fine)[:, 0] - exact)) < 1e-5


def test_times_that_are_too_close_are_refused():
    with pytest.raises(ValueError, match="a doubled time stamp"):
        Motion.through([0, 1, 2, 2 + 1e-8], [[0], [1], [2], [3]])


T = np.linspace(0.0, 1.2, 121)
TRUE = Motion.of_time(lambda t: [3.0 + np.sin(3 * t), 0.4 + 0.3 * np.cos(5 * t), 0.2 * np.sin(4 * t) - 0.9], 1.2)


def peaks(motion):
    return [load.peak for load in motion.torques(torus(), [Gravity()]).loads]


def test_wrapped_doubled_and_masked_samples_are_read():
    q, expected = TRUE.q(T), peaks(TRUE)
    wrapped = (q + np.pi) % (2 * np.pi) - np.pi
    doubled = np.vstack([q, q[-1:]])
    masked = np.ma.array(q.copy(), mask=np.zeros_like(q, dtype=bool))
    masked[5, 1] = -9999.0
    masked[5, 1] = np.ma.masked
    for motion, words in (
        (Motion.from_samples(T, wrapped, noise=0.0), "unwrapped"),
        (Motion.from_samples(T, wrapped, TRUE.v(T)), "unwrapped"),
        (Motion.from_samples(np.append(T, T[-1] + 1e-9), doubled, noise=0.0), "stand twice"),
        (Motion.from_samples(np.append(T, T[-1] + 5e-6), doubled, noise=0.0), "stand twice"),
        (Motion.from_samples(T, masked, noise=0.0), "1 of 121 samples are masked"),
    ):
        assert any(words in note for note in motion.notes)
        np.testing.assert_allclose(peaks(motion), expected, rtol=1e-3)
    with pytest.raises(ValueError, match="waypoints"):
        Motion.through(T, masked)


def test_degrees_are_refused_from_every_source():
    with pytest.raises(ValueError, match="turns: degrees"):
        peaks(Motion.from_samples(T, np.rad2deg(TRUE.q(T)), noise=0.0))
    with pytest.raises(ValueError, match="turns: degrees"):
        peaks(Motion.through([0, 1, 2], [[0, 10, 20], [30, 40, 50], [90, 10, 5]]))


def test_rest_to_rest_points_are_a_motion():
    motion = Motion.from_samples([0.0, 1.0], [[0.0, 0.4], [2.0, 0.8]], np.zeros((2, 2)))
    np.testing.assert_allclose(motion.q(0.5), [1.0, 0.6])
    with pytest.raises(ValueError, match="deg/s"):
        Motion.from_samples([0, 1, 2], [0, 1, 2], [57.3, 57.3, 57.3])
