"""Many starts: distinct optima, how often each is hit, the same on every executor."""

from __future__ import annotations

import io
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import ocp.solving.local_optima as local_optima
from models import torus
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Bolza,
    CoarseGrid,
    Fixed,
    Free,
    ParameterPath,
    Problem,
    Smooth,
    StraightLine,
    System,
    WiderLimits,
    along,
    end,
    multistart,
    point_to_point,
    radau,
    solve,
    start,
    uniform,
    verify,
)


def reaching_over() -> Problem:
    """A torus-like arm turns round and folds the other way: there are many ways to do that."""
    arm = canonical(torus(), [Gravity()])
    return point_to_point(
        arm, [0.0, 0.3, 1.2], [2.5, 1.2, -1.2], q=([-6.3, -1.5, -3.1], [6.3, 4.6, 3.1]), tau=[120.0, 420.0, 150.0]
    )


@pytest.mark.slow
def test_three_distinct_optima_and_the_best_first() -> None:
    task = reaching_over()
    optima = multistart(task, starts=16, grid=uniform(20))
    assert len(optima) >= 3
    costs = [optimum.solution.cost for optimum in optima]
    assert costs == sorted(costs)
    assert sum(optimum.hits for optimum in optima) <= 16
    assert all(optimum.hits == len(optimum.starts) for optimum in optima)
    assert f"{len(optima)} local optima from 16 starts" in optima[0].solution.message
    # One start alone reports success and is 8 % slower: the user must see that.
    assert solve(task, grid=uniform(20)).duration > 1.05 * costs[0]
    # They are no artefacts of a coarse grid: each stays itself on a finer one, and verifies there.
    finer = [solve(task, radau(5), uniform(60), guess=optimum.solution) for optimum in optima[:3]]
    for fine, optimum in zip(finer, optima, strict=False):
        assert fine.ok
        assert fine.duration == pytest.approx(optimum.solution.duration, rel=1e-2)
        assert not verify(fine).failures
        assert optimum.seconds > 0.0
    assert np.all(np.diff([fine.duration for fine in finer]) > 0.0)


def test_the_same_on_every_executor() -> None:
    task = reaching_over()
    here = multistart(task, starts=5, seed=3, grid=uniform(12))
    with ThreadPoolExecutor(1) as threads:
        there = multistart(task, starts=5, seed=3, executor=threads, grid=uniform(12))
    with ProcessPoolExecutor(2) as processes:
        elsewhere = multistart(task, starts=5, seed=3, executor=processes, grid=uniform(12))
    for other in (there, elsewhere):
        assert [optimum.starts for optimum in other] == [optimum.starts for optimum in here]
        for one, two in zip(here, other, strict=True):
            np.testing.assert_allclose(two.solution.states, one.solution.states, rtol=1e-9, atol=1e-9)
    assert elsewhere[0].solution.signal("tool", 0.1).shape == (3,)
    assert multistart(task, starts=5, seed=4, grid=uniform(12))[0].solution.cost >= here[0].solution.cost * 0.5


def test_a_convex_problem_has_one_optimum() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u), {"q": x[0], "v": x[1], "tau": u}, {})
    task = point_to_point(system, 0.0, 1.0, minimise=Bolza(running=u**2), horizon=Fixed(1.0), tau=50.0)
    (only,) = multistart(task, starts=6, grid=uniform(10))
    assert only.hits == 6


def test_a_hopeless_task_has_none() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u, {"x": x, "u": u}, {})
    task = Problem(system, Fixed(1.0), subject_to=(start(x, 0.0), end(x, 2.0), along(u, -1.0, 1.0)))
    assert multistart(task, starts=2, grid=uniform(5)) == ()


def test_problems_travel_as_functions() -> None:
    task = reaching_over()
    copy = pickle.loads(pickle.dumps(task))
    one, two = solve(task, grid=uniform(12)), solve(copy, grid=uniform(12))
    np.testing.assert_allclose(two.states, one.states, rtol=1e-12, atol=1e-12)
    assert copy.system.labels["q"] == task.system.labels["q"]


@pytest.mark.parametrize(
    "rung", [Smooth(), StraightLine(), CoarseGrid(), WiderLimits()], ids=lambda r: type(r).__name__
)
def test_every_rung_leads_to_a_solution_and_is_recorded(rung: Smooth) -> None:
    arm = canonical(torus(), [Gravity()])
    task = point_to_point(arm, [0.0, 0.4, -0.9], [2.0, 0.8, -1.3], tau=[250.0, 600.0, 220.0])
    solution = solve(task, grid=uniform(20), guess=(rung,))
    assert solution.ok
    assert solution.rung == type(rung).__name__
    assert solution.duration == pytest.approx(solve(task, grid=uniform(20)).duration, rel=1e-6)


def test_a_path_of_parameter_values() -> None:
    from models import Parameter

    arm = canonical(torus(), [Gravity(g=Parameter(9.81))])
    task = point_to_point(arm, [0.0, 0.4, -0.9], [2.0, 0.8, -1.3], tau=[250.0, 600.0, 220.0])
    solution = solve(task, grid=uniform(15), guess=(ParameterPath("gravity.g", 0.0, 2),))
    assert solution.ok
    assert solution.rung == "ParameterPath"
    assert solution.values["gravity.g"] == 9.81
    with pytest.raises(ValueError, match="no parameter 'gravity'"):
        solve(task, grid=uniform(15), guess=(ParameterPath("gravity"),))


def test_bad_input_is_named() -> None:
    with pytest.raises(ValueError, match="starts is 0"):
        multistart(reaching_over(), starts=0)
    with pytest.raises(TypeError, match="expected a Problem"):
        multistart("task")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no parameter 'mass'"):
        multistart(reaching_over(), starts=1, values={"mass": 1.0})


def carriage() -> System:
    """Return a mass on a rail."""
    q, v, force = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("force")
    return System(ca.vertcat(q, v), force, rate=ca.vertcat(v, force), signals={"q": q, "v": v, "tau": force})


def test_no_optimum_says_why() -> None:
    """An empty tuple came back after two minutes, without a word."""
    problem = point_to_point(carriage(), 0.0, 1.0, tau=1.0, v=0.0)
    nothing = multistart(problem, 50, grid=uniform(10))
    assert nothing == ()
    assert nothing.message.startswith("none of 1 starts was solved (1 infeasible)")
    assert "its rate is limited to 0" in nothing.message
    short = replace(point_to_point(carriage(), 0.0, 1.0, tau=1.0), horizon=Free(1.0, upper=1.5))
    nothing = multistart(short, 2, grid=uniform(10))
    assert len(nothing) == 0
    assert nothing.message.startswith("none of 3 starts was solved (3 infeasible)")
    assert "guesses tried" in nothing.message


def test_the_optima_say_how_many_they_are() -> None:
    optima = multistart(point_to_point(carriage(), 0.0, 1.0, tau=1.0), 3, grid=uniform(10))
    assert "1 local optima from 3 starts" in optima.message
    assert optima.message == optima[0].solution.message


def test_long_searches_show_how_far_they_are_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    task = Problem(
        System(x, u, ca.SX(0, 1), u), Fixed(1.0), Bolza(running=u**2), (start(x, 0.0), end(x, 1.0), along(u, -2.0, 2.0))
    )

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setattr(local_optima, "QUIET_SECONDS", 0.0)
    multistart(task, starts=3, grid=uniform(4))
    lines = [line.rstrip() for line in shown.getvalue().split("\r")]
    assert [line.partition(",")[2] for line in lines if line] == [" 2 of 3 starts, 0 s"]
    monkeypatch.setattr(local_optima, "QUIET_SECONDS", 60.0)
    quiet = Terminal()
    monkeypatch.setattr(sys, "stderr", quiet)
    multistart(task, starts=3, grid=uniform(4))
    assert quiet.getvalue() == ""


def test_a_solution_takes_the_place_of_the_first_start() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, rate=ca.vertcat(x[1], u))
    task = Problem(system, Free(1.0), Bolza(time=1.0), (start(x, 0.0), end(x, [1.0, 0.0]), along(u, -1.0, 1.0)))
    known = solve(task, grid=uniform(10))
    alone = multistart(task, 1, grid=uniform(10), first=known)
    assert alone[0].solution.cost == known.cost
    assert alone[0].seconds == known.timings.derivatives + known.timings.solver
    both = multistart(task, 3, grid=uniform(10), first=known)
    assert both[0].hits == 3
    assert "1 local optima from 3 starts" in both.message
    with pytest.raises(TypeError, match="first"):
        multistart(task, 1, first="known")  # type: ignore[arg-type]
