"""Tables of Denavit and Hartenberg against products of their matrices: tool, metric and weight."""

import casadi as ca
import numpy as np
import pytest

from models import DhRow, Kind, Link, Parameter, dh
from models.effects import Gravity
from models.forms import lagrange

QUARTERS = (0.0, np.pi / 2, np.pi, -np.pi / 2)


def turned(axis, angle):
    c, s, i = ca.cos(angle), ca.sin(angle), 0 if axis == "x" else 2
    j, k = (1, 2) if axis == "x" else (0, 1)
    matrix = ca.SX.eye(4)
    matrix[j, j], matrix[k, k], matrix[j, k], matrix[k, j] = c, c, -s, s
    matrix[i, i] = 1
    return matrix


def moved(x, z):
    matrix = ca.SX.eye(4)
    matrix[0, 3], matrix[2, 3] = x, z
    return matrix


def written_out(rows, modified, q, tool):
    """Return tool, its axes, metric and weight dU/dq of a table as expressions in q, by the matrices of the method."""
    frame, n = ca.SX.eye(4), len(rows)
    turning, metric, potential = ca.SX(3, n), ca.SX(n, n), 0
    for k, row in enumerate(rows):
        revolute = row.kind is Kind.REVOLUTE
        own = turned("z", row.theta + (q[k] if revolute else 0)) @ moved(0, row.d + (0 if revolute else q[k]))
        step = turned("x", row.alpha) @ moved(row.a, 0)
        axis = frame[:3, 2] if not modified else (frame @ step)[:3, 2]
        frame = frame @ (step @ own if modified else own @ moved(row.a, 0) @ turned("x", row.alpha))
        turning = ca.SX(turning)
        if revolute:
            turning[:, k] = axis
        centre = (frame @ ca.vertcat(*row.link.centre, 1))[:3]
        slope, spin = ca.jacobian(centre, q), frame[:3, :3].T @ turning
        metric += row.link.mass * slope.T @ slope + spin.T @ ca.diag(ca.vertcat(*row.link.inertia)) @ spin
        potential += 9.81 * row.link.mass * centre[2]
    return (frame @ ca.vertcat(*tool, 1))[:3], frame[:3, :3], metric, ca.gradient(potential, q)


def random_rows(rng):
    rows = []
    for _ in range(rng.integers(1, 6)):
        theta, d, a, alpha = rng.uniform(-1, 1, 4) * (rng.random(4) < 0.7)
        theta, alpha = (rng.choice(QUARTERS) if rng.random() < 0.4 else angle for angle in (theta, alpha))
        link = Link(rng.uniform(0.5, 2.0), rng.uniform(-0.3, 0.3, 3), rng.uniform(0.02, 0.03, 3))
        kind = Kind.REVOLUTE if rng.random() < 0.6 else Kind.PRISMATIC
        rows.append(DhRow(float(theta), float(d), float(a), float(alpha), kind, link))
    return rows


@pytest.mark.parametrize("modified", [False, True], ids=["standard", "modified"])
def test_tables_move_as_the_products_of_their_matrices(modified):
    rng = np.random.default_rng(8)
    for number in range(6):
        rows, tool = random_rows(rng), rng.uniform(-0.3, 0.3, 3)
        arm, n = dh(rows, modified, tool=tool), len(rows)
        q = rng.uniform(-2, 2, n)
        wanted = ca.Function("w", [arm.q], [ca.densify(x) for x in written_out(rows, modified, arm.q, tool)])(q)
        got = ca.Function("g", [arm.q], [ca.densify(x) for x in (arm.tool, arm.tool_axes, arm.metric)])(q)
        for one, other in zip(got, wanted, strict=False):
            assert np.max(np.abs((one - other).full())) < 1e-12
        if number:
            continue
        # From rest the weight alone accelerates.
        system = lagrange(arm, [Gravity()])
        rate = ca.Function("r", [system.x, system.u], [system.rate])(np.concatenate([q, np.zeros(n)]), np.zeros(n))
        assert np.linalg.solve(wanted[2].full(), -wanted[3].full()) == pytest.approx(
            rate.full()[n:], rel=1e-9, abs=1e-9
        )


@pytest.mark.parametrize("modified", [False, True], ids=["standard", "modified"])
def test_lengths_of_a_table_may_be_parameters(modified):
    made = lambda d, a: [  # noqa: E731
        DhRow(0.2, d, 0.1, np.pi / 2, link=Link(2.0, (0.1, 0.0, 0.05), (0.02, 0.03, 0.02))),
        DhRow(-0.4, 0.1, a, 0.3, link=Link(1.0, (0.1, 0.1, 0.0), (0.02, 0.02, 0.02))),
    ]
    symbolic, numbers = dh(made(Parameter(0.3), Parameter(0.4)), modified), dh(made(0.5, 0.25), modified)
    assert list(symbolic.nominal.values()) == [0.3, 0.4]
    values = [0.5, 0.25]
    one = ca.Function("f", [symbolic.q, ca.vertcat(*symbolic.symbols.values())], [symbolic.metric, symbolic.tool])
    other = ca.Function("f", [numbers.q], [numbers.metric, numbers.tool])
    for got, wanted in zip(one([0.3, -0.8], values), other([0.3, -0.8]), strict=True):
        assert np.max(np.abs((got - wanted).full())) < 1e-14


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ([(0, 0, 0)], "table, row 1: got"),
        ([(0, 0, 0, 0), 3], "table, row 2: got 3"),
        ([], "expected at least one DhRow"),
        ([(0, 0, 0, float("nan"))], "table, row 1"),
    ],
)
def test_tables_that_are_none(table, words):
    with pytest.raises(ValueError, match=words):
        dh(table)
