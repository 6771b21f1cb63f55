"""Derivatives by the implicit function theorem: the same numbers as differentiation of the whole graph, shorter."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import Parameter, robots, spherical
from models.effects import ElasticDrive, Gravity, Payload, Viscous
from models.forms import canonical, lagrange
from ocp import Problem, Sequence, absolute, extend, integral, point_to_point, prepare, solve, uniform
from ocp.problem.integral_constraints import without_integrals
from ocp.problem.parallel_phases import in_parallel
from ocp.transcription.implicit import Inner

FORMS = pytest.mark.parametrize("form", [canonical, lagrange], ids=lambda form: form.__name__)
EFFECTS = {
    "gravity": lambda: [Gravity()],
    "friction and load": lambda: [Gravity(), Payload(Parameter(2.0), offset=(0.1, 0.0, 0.05)), Viscous(0.5)],
    "elastic": lambda: [Gravity(), ElasticDrive(stiffness=1e4, inertia=0.5)],
}


def short(system, z, mu):
    """Return rate, Jacobian and Hessian by the implicit function theorem."""
    own, weights, rest = system.implicit, None, None
    if own.mirror is not None:
        weights, rest = own.mirror
        weights = ca.SX(ca.horzcat(weights, ca.DM(system.x.numel(), system.u.numel())))

    def solve(right):
        return own.solve(system.x, system.u, system.p, right)

    return Inner(own.y, own.rate, own.residual, own.value, solve, weights, rest).derivatives(z, mu)


def derivatives(system):
    """Return the function (z, p, mu) -> Jacobian and Hessian by both ways."""
    z, mu = ca.vertcat(system.x, system.u), ca.SX.sym("mu", system.x.numel())
    first = short(system, z, mu)[1:]
    second = ca.jacobian(system.rate, z), ca.hessian(ca.dot(mu, system.rate), z)[0]
    return ca.Function("d", [z, system.p, mu], [ca.densify(part) for part in (*first, *second)])


@FORMS
@pytest.mark.parametrize("effects", EFFECTS)
def test_both_ways_give_the_same_derivatives(form, effects):
    system = form(robots.arm_3r(), EFFECTS[effects]())
    function = derivatives(system)
    rng = np.random.default_rng(3)
    for _ in range(3):
        sizes = (function.numel_in(0), function.numel_in(2))
        z, mu = (rng.uniform(-1, 1, size) for size in sizes)
        jacobian, hessian, other_jacobian, other_hessian = (
            part.full() for part in function(z, list(system.nominal.values()), mu)
        )
        assert np.allclose(jacobian, other_jacobian, rtol=0, atol=1e-12 * np.max(np.abs(other_jacobian)))
        assert np.allclose(hessian, other_hessian, rtol=0, atol=1e-11 * np.max(np.abs(other_hessian)))


def heated(system):
    return Problem(system, subject_to=(integral(ca.sumsqr(system["tau"]) * system.p, upper=1.0, name="heat"),)).system


def clocked(system):
    return replace(system, t=ca.SX.sym("t"))


EXTENDED = {
    "integral": heated,
    "clock": clocked,
    "rate of the control": extend,
    "absolute value": lambda system: absolute(system, system["tau"], "size")[0],
    "all": lambda system: heated(extend(clocked(absolute(system, system["tau"], "size")[0]))),
    "integral taken off": lambda system: without_integrals(heated(system)),
}


@FORMS
@pytest.mark.parametrize("kind", EXTENDED)
def test_systems_with_further_states_keep_the_inner_unknowns(form, kind):
    system = EXTENDED[kind](form(robots.arm_3r(), [Gravity(), Payload(Parameter(2.0), offset=(0.1, 0.0, 0.05))]))
    assert system.implicit is not None
    assert system.implicit.rate.numel() == system.x.numel()
    function, rng = derivatives(system), np.random.default_rng(3)
    z, mu = (rng.uniform(-1, 1, size) for size in (function.numel_in(0), function.numel_in(2)))
    jacobian, hessian, other_jacobian, other_hessian = (part.full() for part in function(z, [2.0], mu))
    assert np.allclose(jacobian, other_jacobian, rtol=0, atol=1e-12 * np.max(np.abs(other_jacobian)))
    assert np.allclose(hessian, other_hessian, rtol=0, atol=1e-11 * np.max(np.abs(other_hessian)))


def test_a_motion_takes_the_same_iterates():
    machine = robots.arm_3r()
    system = canonical(machine, [Gravity()])
    results = []
    for one in (system, replace(system, implicit=None)):
        problem = point_to_point(one, [0.0, 0.0, 0.0], [1.0, 0.6, -0.5], limits=machine.limits)
        results.append(solve(problem, grid=uniform(15)))
    short, long = results
    assert short.ok
    assert short.iterations == long.iterations
    assert short.duration == pytest.approx(long.duration, rel=1e-9)  # the tolerance of IPOPT is 1e-8


@FORMS
@pytest.mark.parametrize("mixed", [False, True], ids=["all short", "one of two"])
def test_phases_in_parallel_keep_the_inner_unknowns(form, mixed):
    machine = robots.arm_3r()
    load = Payload(Parameter(2.0), offset=(0.1, 0.0, 0.05))
    free, loaded = form(machine, [Gravity()]), form(machine, [Gravity(), load])
    free = replace(free, implicit=None) if mixed else free
    first = point_to_point(free, [0.0, 0.0, 0.0], [1.0, 0.6, -0.5], limits=machine.limits)
    second = point_to_point(loaded, [1.0, 0.6, -0.5], [0.0, 0.2, 0.1], limits=machine.limits)
    problem = in_parallel(Sequence([first, second], ["q"])).problem
    assert problem.system.implicit.y.numel() == (3 if mixed else 6)
    long = replace(problem, system=replace(problem.system, implicit=None))
    short, explicit = (prepare(one, grid=uniform(3)).joined.scaled.derivatives for one in (problem, long))
    rng = np.random.default_rng(5)
    for name, scale in (("jac_g", 1e-12), ("hess_lag", 1e-11)):
        one, other = short[name], explicit[name]
        given = [rng.uniform(0.5, 1.0, one.numel_in(i)) for i in range(one.n_in())]
        values = [function.call(given)[-1].full() for function in (one, other)]
        assert np.max(np.abs(values[0] - values[1])) < scale * np.max(np.abs(values[1]))
        assert np.count_nonzero(values[0])


def test_limits_of_velocities_use_the_inner_unknowns():
    machine = robots.arm_3r()
    system = canonical(machine, [Gravity()])
    assert all(ca.is_equal(system.short(system["v"][i]), system.implicit.y[i]) for i in range(3))
    assert ca.is_equal(system.short(system["q"][0]), system["q"][0])
    problem = point_to_point(system, [0.0, 0.0, 0.0], [1.0, 0.6, -0.5], v=1.5)
    solution = solve(problem, grid=uniform(15))
    assert solution.ok
    assert np.max(np.abs(solution.signal("v", solution.t))) < 1.5 + 1e-2


def test_a_pickled_system_is_explicit_and_the_same():
    system = canonical(robots.arm_3r(), [Gravity()])
    again = pickle.loads(pickle.dumps(system))
    assert again.implicit is None
    function = [ca.Function("f", [one.x, one.u], [one.rate]) for one in (system, again)]
    x, u = np.linspace(-1, 1, 6), np.ones(3)
    assert np.array_equal(*(part(x, u).full() for part in function))


def test_the_three_machines_keep_their_derivatives():

    assert canonical(spherical(), [Gravity()]).implicit is None


# Instructions of x' with its Jacobian, and of the Hessian, 1.05 times the shortest graphs known.
MOST = {
    (robots.ur5, canonical): (1661, 4061), (robots.ur5, lagrange): (2242, 4915),
    (robots.puma560, canonical): (1854, 4723), (robots.puma560, lagrange): (2989, 6374),
    (robots.panda, canonical): (4840, 14048), (robots.panda, lagrange): (8403, 16807),
}  # fmt: skip


@pytest.mark.parametrize(("make", "form"), MOST, ids=[f"{make.__name__}-{form.__name__}" for make, form in MOST])
def test_derivatives_are_short(make, form):
    system = form(make(), [Gravity()])
    z, mu = ca.vertcat(system.x, system.u), ca.SX.sym("mu", system.x.numel())
    value, jacobian, hessian = short(system, z, mu)
    counts = (
        ca.Function("j", [z], ca.cse([value, jacobian])).n_instructions(),
        ca.Function("h", [z, mu], [ca.cse(ca.triu(hessian))]).n_instructions(),
    )
    assert all(count <= 1.05 * known for count, known in zip(counts, MOST[make, form], strict=True)), counts


def test_inner_unknowns_serve_an_optimal_control_problem():
    system = canonical(robots.ur5(), [Gravity()])
    assert prepare(point_to_point(system, np.zeros(6), np.full(6, 0.3), tau=100.0), grid=uniform(4))
