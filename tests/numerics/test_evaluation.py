"""Functions at many points: any number of points, inputs that are the same everywhere, outputs without entries."""

import casadi as ca
import numpy as np
import pytest

from ocp.numerics.evaluation import evaluate

X, U, P = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("p", 0)
OUTPUTS = [ca.vertcat(X[0] * U[0], X[1] / X[2]), ca.densify(ca.jacobian(X[0] * X[1], X)), ca.SX(0, 1)]
FUNCTION = ca.Function("f", [X, U, P], OUTPUTS)


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 512, 513, 8192, 8193, 20_000])
def test_every_number_of_points(count):
    x = np.random.default_rng(count).uniform(1.0, 2.0, (count, 3))
    seen: list[tuple[int, int]] = []
    value, slope, nothing = evaluate(
        FUNCTION, x, np.array([2.0, 3.0]), np.zeros(0), progress=lambda *done: seen.append(done)
    )
    np.testing.assert_array_equal(value, np.stack([2.0 * x[:, 0], x[:, 1] / x[:, 2]], axis=1))
    np.testing.assert_array_equal(slope, np.stack([x[:, 1], x[:, 0], np.zeros(count)], axis=1))
    assert nothing.shape == (count, 0)
    assert seen[-1] == (count, count)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})


def test_points_in_any_order_of_memory():
    x = np.asfortranarray(np.arange(1.0, 13.0).reshape(4, 3))
    u = np.arange(16.0).reshape(4, 4)[:, ::2]
    value = evaluate(FUNCTION, x, u, np.zeros((4, 0)))[0]
    np.testing.assert_array_equal(value, np.stack([x[:, 0] * u[:, 0], x[:, 1] / x[:, 2]], axis=1))


def test_no_points_give_no_values():
    shapes = [part.shape for part in evaluate(FUNCTION, np.zeros((0, 3)), np.zeros(2), np.zeros(0))]
    assert shapes == [(0, 2), (0, 3), (0, 0)]
