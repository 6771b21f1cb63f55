"""Moving grid: the widths of the elements are unknowns, so that switches of the controls lie between elements."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ocp.checks import Array
from ocp.problem.problem import Free, Problem
from ocp.solution.solution import Solution, Timings
from ocp.solving.guess_conversion import from_solution
from ocp.solving.ipopt import Ipopt
from ocp.solving.nlp_solver import NlpResult, physical_solver
from ocp.transcription.arc_layout import ArcLayout
from ocp.transcription.direct_collocation import free_parameters, transcribe
from ocp.transcription.grid import Grid
from ocp.transcription.nlp import Nlp, bounds
from ocp.transcription.packing import Multipliers, pack
from ocp.transcription.scaling import from_limits
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Scheme

NARROWEST, WIDEST = 0.4, 1.8  # widths of the elements, shares of their mean or of the given ones
EVENNESS = 1e-3  # penalty on the differences of widths, share of the cost if each is as large as the mean width
SETTINGS = Ipopt(
    tol=1e-9, max_iter=150, progress=False,
    extra={"mu_init": 1e-4, "bound_push": 1e-5, "bound_frac": 1e-5, "slack_bound_push": 1e-5, "slack_bound_frac": 1e-5,
           "mumps_permuting_scaling": 0, "mumps_scaling": 0},
)  # fmt: skip


def move_grid(
    solution: Solution, problem: Problem, scheme: Scheme | None = None, grid: Grid | None = None,
    solver: Ipopt | None = None,
) -> Solution:  # fmt: skip
    """Solve again with the widths of the elements as unknowns.

    A switch of a control inside an element costs a motion time; with widths between 0.4 and 1.8 of their mean (or of
    the given ones, where these are narrower or wider), the optimum has its switches at ends of elements. A penalty of
    1e-3 on the differences of the widths determines those that the switches do not.

    Args:
        solution: solved, on any grid.
        problem: what to solve: that of the solution, or one with another cost.
        scheme: default radau(4), constant controls.
        grid: to begin with; default that of the solution.
        solver: settings of IPOPT.

    Returns:
        The solution on the moved grid, of any status.
    """
    begun = time.perf_counter()
    scheme, settings = radau(4) if scheme is None else scheme, SETTINGS if solver is None else solver
    horizon = problem.horizon
    fixed = not isinstance(horizon, Free)
    freed = problem if isinstance(horizon, Free) else replace(problem, horizon=Free(guess=horizon.duration))
    grid = solution.grid if grid is None else grid
    count, guess, numbers = len(grid), from_solution(solution), solution.parameters.tolist()
    scaling = from_limits(freed, guess, numbers, free_parameters(freed))
    mean = solution.duration / count
    limited = fixed or (isinstance(horizon, Free) and (horizon.lower > 0.0 or horizon.upper < np.inf))
    cost = max(abs(solution.cost), abs(problem.minimise.time) * solution.duration)
    weight = EVENNESS * cost * (scaling.horizon / mean) ** 2 / count
    nlp = transcribe(freed, scheme, grid, scaling, ArcLayout(np.arange(count), (), limited, (), weight))
    z0 = pack(nlp, guess, numbers)
    z0[nlp.layout.horizon] = solution.duration * grid.widths / scaling.horizon
    low, high, rows_low, rows_high = bounds(nlp)
    # Where the given grid is finer than the mean, it stays so; where it is coarser, it may.
    widths = solution.duration * grid.widths
    low[nlp.layout.horizon] = NARROWEST * np.minimum(widths, mean) / scaling.horizon
    high[nlp.layout.horizon] = WIDEST * np.maximum(widths, mean) / scaling.horizon
    rows_low[nlp.total] = horizon.lower if isinstance(horizon, Free) else horizon.duration
    rows_high[nlp.total] = horizon.upper if isinstance(horizon, Free) else horizon.duration
    solve_nlp = physical_solver(nlp.scaled, settings)
    setup = time.perf_counter() - begun
    result = solve_nlp(np.clip(z0, low, high), np.append(numbers, np.ones(count)), (low, high, rows_low, rows_high))
    return _solution(nlp, result, solution, problem, setup, weight)


def _solution(nlp: Nlp, result: NlpResult, like: Solution, problem: Problem, setup: float, weight: float) -> Solution:
    layout, scaling, scheme = nlp.layout, nlp.scaling, nlp.scheme
    widths = result.z[layout.horizon]
    duration = float(widths.sum() * scaling.horizon)
    ends = np.append(0.0, np.cumsum(widths)) / widths.sum()
    ends[-1] = 1.0
    multipliers = result.multipliers[nlp.defects]
    costates = -np.einsum("ij,kia->kja", scheme.rate, multipliers) / scheme.weights[:, None] / scaling.x
    parameters = np.array(like.parameters)
    parameters[nlp.free] = result.z[layout.free] * scaling.free
    names = list(problem.system.nominal)
    values = dict(zip(names, parameters.tolist(), strict=True))
    path = np.hstack([result.multipliers[rows] for rows in (np.zeros((len(widths), 0), dtype=int), *nlp.path)])
    held = Multipliers(
        result.limits[layout.state] / scaling.x, result.limits[layout.control] / scaling.u, path,
        result.multipliers[nlp.ends],
    )  # fmt: skip
    states: Array = result.z[layout.state] * scaling.x
    inside = result.derivatives
    return replace(
        like, status=result.status, message=result.status.value, solver_status=result.verbatim, duration=duration,
        cost=result.cost - weight * float(np.sum(np.diff(widths) ** 2)), states=states,
        controls=result.z[layout.control] * scaling.u, slopes=np.zeros((len(widths), 0, states.shape[2])),
        costates=costates, free={names[n]: values[names[n]] for n in nlp.free}, values=values, grid=Grid(ends),
        scheme=scheme, problem=problem, log=result.log, multipliers=held, accuracy=None, structure=None,
        iterations=result.iterations, rung="moving grid",
        timings=Timings(setup, inside, result.seconds - inside, setup + result.seconds),
    )  # fmt: skip
