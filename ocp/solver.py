"""Solving with IPOPT: settings, preparation, solve. The only file that calls nlpsol."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from ocp.collocation import Scheme, radau
from ocp.grid import Grid, uniform
from ocp.guess import Guess, straight_line
from ocp.problem import Fixed, Free, Problem, Where
from ocp.scaling import from_limits, unscaled
from ocp.solution import Solution, Status, Timings
from ocp.transcription import Programme, free_parameters, transcribe

Array = np.ndarray

STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.ACCEPTABLE,
    "Feasible_Point_Found": Status.ACCEPTABLE,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.LIMIT,
    "Maximum_CpuTime_Exceeded": Status.LIMIT,
    "Maximum_WallTime_Exceeded": Status.LIMIT,
    "User_Requested_Stop": Status.STOPPED,
}


@dataclass(frozen=True)
class Ipopt:
    """Settings of IPOPT.

    Args:
        tol: on the scaled programme.
        max_iter: limit of iterations.
        max_seconds: limit of wall-clock time [s].
        scaled: scale unknowns by limits, ranges and the guess of the duration.
        print_level: 0 (silent) to 12.
        extra: further IPOPT options by their own names, taken verbatim.
    """

    tol: float = 1e-9
    max_iter: int = 3000
    max_seconds: float = 1e6
    scaled: bool = True
    print_level: int = 0
    extra: Mapping[str, Any] = field(default_factory=dict)

    def options(self, warm: bool) -> dict[str, Any]:
        """Return the options for nlpsol; CasADi's own and IPOPT's are kept apart."""
        ipopt: dict[str, Any] = {
            "tol": self.tol,
            "max_iter": self.max_iter,
            "max_wall_time": self.max_seconds,
            "print_level": self.print_level,
            "sb": "yes",
            "mu_strategy": "monotone",
            # Limits are what the user said, not 1e-8 more.
            "bound_relax_factor": 0.0,
            "honor_original_bounds": "yes",
        }
        if warm:
            # A good guess must not be pushed away from the limits it lies on.
            ipopt |= {"mu_init": 1e-3, "bound_push": 1e-4, "bound_frac": 1e-4}
        ipopt |= self.extra
        return {
            "ipopt": ipopt, "print_time": False, "error_on_fail": False, "record_time": True,
            "no_nlp_grad": True, "calc_lam_p": False, "calc_lam_x": False, "calc_f": False, "calc_g": False,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Prepared:
    """A programme with its solver, to be solved for many parameter values, limits, ends and guesses."""

    programme: Programme
    solver: Ipopt
    setup: float  # seconds spent so far
    cold: ca.Function

    def __call__(
        self,
        guess: Guess | Solution | None = None,
        values: Mapping[str, float] | None = None,
        problem: Problem | None = None,
        grid: Grid | None = None,
    ) -> Solution:
        """Solve.

        Args:
            guess: a Guess or a Solution; None for the straight line between the ends.
            values: of parameters, by name; nominal where silent.
            problem: one that differs in limits, start and end values or the guess of the duration only.
            grid: of as many elements.

        Raises:
            ValueError: a problem or grid of another structure, or a wrong parameter name.
        """
        return _solve(self, guess, values, problem, grid)


def prepare(
    problem: Problem,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: Ipopt | None = None,
    guess: Guess | Solution | None = None,
    values: Mapping[str, float] | None = None,
) -> Prepared:
    """Transcribe a problem and build its solver once, for many solves.

    Args:
        problem: what to solve.
        scheme: default radau(3), constant controls.
        grid: default uniform(50).
        solver: settings.
        guess: sets the magnitudes of the scaling; None for the straight line.
        values: of parameters, for the scaling.

    Raises:
        TypeError: an argument of the wrong kind.
    """
    begun = time.perf_counter()
    scheme, grid, solver = scheme or radau(3), grid or uniform(50), solver or Ipopt()
    for name, value, kind in (("problem", problem, Problem), ("scheme", scheme, Scheme), ("grid", grid, Grid)):
        if not isinstance(value, kind):
            raise TypeError(f"{name}: got {value!r}, expected a {kind.__name__}")
    if not isinstance(solver, Ipopt):
        raise TypeError(f"solver: got {solver!r}, expected Ipopt(...)")
    numbers = problem.system.values(values)
    free = free_parameters(problem)
    first = _as_guess(problem, guess, numbers)
    scaling = from_limits(problem, first, numbers, free) if solver.scaled else unscaled(problem, len(free))
    programme = transcribe(problem, scheme, grid, scaling)
    return Prepared(programme, solver, time.perf_counter() - begun, _nlpsol(programme, solver, warm=False))


def solve(
    problem: Problem,
    scheme: Scheme | None = None,
    grid: Grid | None = None,
    solver: Ipopt | None = None,
    guess: Guess | Solution | None = None,
    values: Mapping[str, float] | None = None,
) -> Solution:
    """Solve a problem by direct collocation; a Solution comes back whatever happens.

    Args:
        problem: what to solve.
        scheme: default radau(3), constant controls.
        grid: default uniform(50).
        solver: settings, default Ipopt().
        guess: a Guess, or a Solution of the same system (on any grid); None for the straight line between the ends.
        values: of parameters, by name; nominal where silent.

    Raises:
        TypeError, ValueError: wrong input, named. A solve that fails raises nothing: see Solution.status.
    """
    begun = time.perf_counter()
    prepared = prepare(problem, scheme, grid, solver, guess, values)
    prepared = replace(prepared, setup=time.perf_counter() - begun)
    return prepared(guess, values)


def _nlpsol(programme: Programme, solver: Ipopt, warm: bool) -> ca.Function:
    options = solver.options(warm) | dict(programme.derivatives)
    return ca.nlpsol("solver", "ipopt", dict(programme.nlp), options)


def _as_guess(problem: Problem, guess: Guess | Solution | None, values: list[float]) -> Guess:
    if guess is None:
        return straight_line(problem, values)
    if isinstance(guess, Guess):
        made = guess
    elif isinstance(guess, Solution):
        made = _from_solution(guess)
    else:
        raise TypeError(f"guess: got {guess!r}, expected a Guess, a Solution or None")
    sizes = made.x.shape[1], made.u.shape[1]
    wanted = problem.system.x.numel(), problem.system.u.numel()
    if sizes != wanted:
        raise ValueError(f"guess: has (nx, nu) = {sizes}, the system has {wanted}")
    return made


def _from_solution(solution: Solution) -> Guess:
    """Return a solution as a guess, sampled where it is smooth: at its points, and on both sides of each end."""
    inside = np.concatenate([[1e-6], solution.scheme.points[solution.scheme.points < 1.0], [1.0 - 1e-6]])
    ends, widths = solution.grid.ends, solution.grid.widths
    share = np.concatenate([[0.0], (ends[:-1, None] + widths[:, None] * inside).ravel(), [1.0]])
    t = share * solution.duration
    free = np.array(list(solution.free.values()))
    return Guess(share, solution.x(t), solution.u(t), solution.duration, free)


def _solve(
    prepared: Prepared,
    guess: Guess | Solution | None,
    values: Mapping[str, float] | None,
    problem: Problem | None,
    grid: Grid | None,
) -> Solution:
    begun = time.perf_counter()
    programme = prepared.programme
    if problem is not None:
        programme = replace(programme, problem=_same_structure(programme.problem, problem))
    if grid is not None:
        if len(grid) != len(programme.grid):
            raise ValueError(f"grid: has {len(grid)} elements, the programme was prepared for {len(programme.grid)}")
        programme = replace(programme, grid=grid)
    numbers = programme.problem.system.values(values)
    first = _as_guess(programme.problem, guess, numbers)
    low, high, rows_low, rows_high = bounds(programme)
    crossed = np.flatnonzero(low > high)
    z0 = pack(programme, first, numbers)
    if len(crossed):
        which = _name_unknown(programme, int(crossed[0]))
        timings = Timings(prepared.setup, 0.0, 0.0, prepared.setup + time.perf_counter() - begun)
        message = f"{Status.INFEASIBLE.value}: the constraints leave nothing for {which}"
        return unpack(programme, z0, np.zeros(programme.rows), numbers, np.nan, Status.INFEASIBLE,
                      message, "not started: contradictory limits", timings, 0, {})  # fmt: skip
    warm = isinstance(guess, Solution)
    function = _nlpsol(programme, prepared.solver, warm=True) if warm else prepared.cold
    fixed = [programme.problem.horizon.duration] if isinstance(programme.problem.horizon, Fixed) else []
    parameters = np.concatenate([numbers, fixed, programme.grid.widths])
    setup = prepared.setup + time.perf_counter() - begun
    started = time.perf_counter()
    result = function(x0=z0, p=parameters, lbx=low, ubx=high, lbg=rows_low, ubg=rows_high)
    spent = time.perf_counter() - started
    stats = function.stats()
    derivatives = sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_"))
    timings = Timings(setup, derivatives, max(spent - derivatives, 0.0), setup + spent)
    verbatim = str(stats["return_status"])
    status = STATUS.get(verbatim, Status.FAILED)
    log = {key: list(column) for key, column in stats.get("iterations", {}).items()}
    return unpack(
        programme, np.array(result["x"]).ravel(), np.array(result["lam_g"]).ravel(), numbers, float(result["f"]),
        status, f"{status.value} ({verbatim})", verbatim, timings, int(stats["iter_count"]), log,
    )  # fmt: skip


def _same_structure(old: Problem, new: Problem) -> Problem:
    """Return `new` if it differs from `old` in numbers only, else raise ValueError."""
    same = (
        new.system is old.system
        and type(new.horizon) is type(old.horizon)
        and new.minimise is old.minimise
        and len(new.subject_to) == len(old.subject_to)
        and all(
            a.where is b.where
            and a.expression.shape == b.expression.shape
            and ca.is_equal(a.expression, b.expression, 10)
            for a, b in zip(old.subject_to, new.subject_to, strict=True)
        )
    )
    if not same:
        raise ValueError(
            "problem: differs from the prepared one in more than limits, start and end values; prepare it anew"
        )
    return new


def bounds(programme: Programme) -> tuple[Array, Array, Array, Array]:
    """Return lower and upper bounds of the scaled unknowns and of the rows, (nz,), (nz,), (ng,), (ng,)."""
    problem, layout, scaling = programme.problem, programme.layout, programme.scaling
    system = problem.system
    low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)

    def tighten(places: Array, lower: Array, upper: Array, scale: Array) -> None:
        low[places] = np.maximum(low[places], lower / scale)
        high[places] = np.minimum(high[places], upper / scale)

    tighten(layout.state, *problem.limits(Where.ALONG, system.x), scaling.x)
    tighten(layout.control, *problem.limits(Where.ALONG, system.u), scaling.u)
    tighten(layout.state[0, 0], *problem.limits(Where.START, system.x), scaling.x)
    tighten(layout.state[-1, -1], *problem.limits(Where.END, system.x), scaling.x)
    if isinstance(problem.horizon, Free):
        limits = np.array([problem.horizon.lower]), np.array([problem.horizon.upper])
        tighten(layout.horizon, *limits, np.array([scaling.horizon]))
    if len(programme.free):
        lower, upper = problem.limits(Where.ALONG, system.p)
        tighten(layout.free, lower[programme.free], upper[programme.free], scaling.free)
    rows_low, rows_high = np.zeros(programme.rows), np.zeros(programme.rows)
    for place, (i, c) in enumerate(programme.path_parts):
        constraint = problem.subject_to[i]
        rows_low[programme.path[:, :, place]] = constraint.lower[c]
        rows_high[programme.path[:, :, place]] = constraint.upper[c]
    for place, (i, c, _) in enumerate(programme.ends_parts):
        constraint = problem.subject_to[i]
        rows_low[programme.ends[place]] = constraint.lower[c]
        rows_high[programme.ends[place]] = constraint.upper[c]
    return low, high, rows_low, rows_high


def pack(programme: Programme, guess: Guess, values: list[float]) -> Array:
    """Return the scaled unknowns (nz,) of a guess."""
    layout, scaling, grid, scheme = programme.layout, programme.scaling, programme.grid, programme.scheme
    z = np.zeros(layout.size)
    starts, widths = grid.ends[:-1, None], grid.widths[:, None]
    z[layout.state] = guess.state(starts + widths * scheme.nodes) / scaling.x
    # A constant control stands for the middle of its element, not for its start.
    places = np.array([0.5]) if len(scheme.control_nodes) == 1 else scheme.control_nodes
    z[layout.control] = guess.control(starts + widths * places) / scaling.u
    z[layout.horizon] = guess.duration / scaling.horizon
    nominal = np.array([values[number] for number in programme.free])
    z[layout.free] = (guess.free if len(guess.free) == len(nominal) else nominal) / scaling.free
    return z


def unpack(
    programme: Programme, z: Array, multipliers: Array, values: list[float], cost: float, status: Status,
    message: str, verbatim: str, timings: Timings, iterations: int, log: Mapping[str, list[float]],
) -> Solution:  # fmt: skip
    """Return the Solution that scaled unknowns (nz,) and multipliers of the rows (ng,) stand for."""
    layout, scaling, problem, scheme = programme.layout, programme.scaling, programme.problem, programme.scheme
    if isinstance(problem.horizon, Fixed):
        duration = problem.horizon.duration
    else:
        duration = float(z[layout.horizon[0]] * scaling.horizon)
    names = list(problem.system.nominal)
    free = {
        names[number]: float(value) for number, value in zip(programme.free, z[layout.free] * scaling.free, strict=True)
    }
    # The rate F_j enters the Lagrangian with -sum_i rate_ij mu_i; a quadrature weight b_j makes it the costate.
    mu = multipliers[programme.defects] if len(multipliers) else np.zeros(programme.defects.shape)
    costates = -np.einsum("ij,kia->kja", scheme.rate, mu) / scheme.weights[:, None] / scaling.x
    return Solution(
        status, message, verbatim, duration, cost,
        z[layout.state] * scaling.x, z[layout.control] * scaling.u, costates,
        free, {**dict(zip(names, values, strict=True)), **free},
        timings, iterations, programme.grid, scheme, problem, log,
    )  # fmt: skip


def _name_unknown(programme: Programme, place: int) -> str:
    layout, system = programme.layout, programme.problem.system
    for kind, places in (("x", layout.state), ("u", layout.control)):
        found = np.argwhere(places == place)
        if len(found):
            element, _, i = found[0]
            name = system.label(kind, places.shape[2])[i]
            share = programme.grid.ends[element] if place != places[-1, -1, i] else 1.0
            return f"{name} at {share:.3g} of the duration"
    return "the duration" if place in layout.horizon else "a free parameter"
