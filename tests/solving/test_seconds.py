"""Seconds of a solve: those of all its attempts, on every grid and from every initial guess."""

import time
from dataclasses import dataclass, field, replace

import casadi as ca
import pytest

from ocp import (
    Ball,
    Bolza,
    Free,
    Ipopt,
    Problem,
    Sequence,
    Status,
    System,
    along,
    end,
    outside,
    prepare,
    solve,
    start,
    uniform,
)  # fmt: skip
from ocp.solution.violations import excess, passed_between_nodes
from ocp.solving.guess_rungs import CoarseGrid, Smooth, StraightLine


@dataclass(frozen=True)
class Recorded(Ipopt):
    """IPOPT that keeps the result of every solve, and calls the first ones failed."""

    results: list = field(default_factory=list)
    failing: int = 0

    def make(self, nlp, start):
        solver = super().make(nlp, start)

        def recorded(*arguments):
            result = solver(*arguments)
            failed = len(self.results) < self.failing
            self.results.append(replace(result, status=Status.FAILED) if failed else result)
            return self.results[-1]

        return recorded


def past_discs(*centres, begin=0.0, finish=1.0):
    """Return the fastest motion of a point along a line, little effort across it, past small discs."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    system = System(x, u, rate=ca.vertcat(x[2:], u))
    ends = start(x, [begin, 0, 0, 0]), end(x, [finish, 0, 0, 0]), along(u, -1.0, 1.0)
    discs = [outside(Ball(centre, 0.01), x[:2]) for centre in centres]
    return Problem(system, Free(2.0), Bolza(time=1.0, running=u[1] ** 2), (*ends, *discs)), x


def check(solution, solver, begun, solves):
    """Check that the timings are those of `solves` solves and add up to nearly all that the caller waited for."""
    spent, waited = solution.timings, time.perf_counter() - begun
    assert solution.ok, solution.message
    assert len(solver.results) >= solves
    assert spent.derivatives == pytest.approx(sum(one.derivatives for one in solver.results))
    assert spent.solver == pytest.approx(sum(one.seconds - one.derivatives for one in solver.results))
    assert spent.setup + spent.derivatives + spent.solver == pytest.approx(spent.total)
    assert 0.8 * waited <= spent.total <= waited


def test_seconds_of_finer_grids_count():
    problem, _ = past_discs((0.55, 0.001))
    solver, begun = Recorded(progress=False), time.perf_counter()
    solution = solve(problem, grid=uniform(20), solver=solver)
    assert len(solution.grid) > 20
    check(solution, solver, begun, 2)


def test_seconds_of_failed_attempts_count():
    problem, _ = past_discs()
    solver, begun = Recorded(progress=False, failing=1), time.perf_counter()
    solution = solve(problem, grid=uniform(20), solver=solver, guess=(Smooth(), StraightLine()))
    assert solution.rung == "StraightLine"
    check(solution, solver, begun, 2)


def test_seconds_of_phases_count():
    (first, x), (second, y) = past_discs((0.55, 0.001)), past_discs(begin=1.0, finish=2.0)
    solver, begun = Recorded(progress=False), time.perf_counter()
    solution = solve(Sequence([first, second], [(x, y)]), grid=uniform(20), solver=solver)
    assert solution.phases[0].timings == solution.timings
    check(solution, solver, begun, 2)


def test_seconds_of_making_a_guess_are_set_up():
    problem, _ = past_discs()
    solver, begun = Recorded(progress=False), time.perf_counter()
    solution = solve(problem, grid=uniform(20), solver=solver, guess=(CoarseGrid(),))
    coarse, fine = solver.results
    assert solution.timings.derivatives == fine.derivatives
    assert solution.timings.setup > coarse.seconds
    assert solution.timings.total > 0.8 * (time.perf_counter() - begun)


def test_a_message_that_nobody_read_is_not_worked_out():
    solution = solve(past_discs()[0], grid=uniform(20), solver=Ipopt(progress=False))
    assert callable(vars(solution)["message"])
    assert solution.message.startswith("solved")


def test_small_excesses_call_for_no_other_solve_but_are_mended_with_large_ones():
    problem, _ = past_discs((0.55, 0.001), (0.71, 0.006))
    solution = prepare(problem, grid=uniform(20), solver=Ipopt(progress=False))()
    every = [one for one, _ in excess(solution, problem) if one > 0.0]
    large, small = sorted(every)[::-1][:2]
    assert 0.0 < small < large
    both, one, none = (
        passed_between_nodes(solution, problem, allowed * large, 0.99 * noted)
        for allowed, noted in ((0.99, small), (0.99, large), (1.01, small))
    )
    assert [len(points) for points in both.values()] == [2]  # both discs have the same name
    assert [len(points) for points in one.values()] == [1]
    assert not none
