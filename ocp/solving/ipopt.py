"""IPOPT: its settings, its progress and its words. The only file that calls nlpsol."""

from __future__ import annotations

import re
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.solution.solution import Status

STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.ACCEPTABLE,
    "Feasible_Point_Found": Status.ACCEPTABLE,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Diverging_Iterates": Status.UNBOUNDED,
    "Maximum_Iterations_Exceeded": Status.LIMIT,
    "Maximum_CpuTime_Exceeded": Status.LIMIT,
    "Maximum_WallTime_Exceeded": Status.LIMIT,
    "User_Requested_Stop": Status.STOPPED,
}
# A start from the multipliers of a neighbouring solution keeps near the limits that it lies on; measured on refined
# grids: a third to two thirds of the iterations of a cold start.
NEAR = 1e-6
CONTINUED = {"mu_init": NEAR, "warm_start_init_point": "yes"} | {
    f"warm_start_{name}": NEAR
    for name in ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
}
SOURCE = re.compile(r"\S+\.[ch]pp:\d+: ")  # place in a compiled source
QUIET_SECONDS = 2.0  # a shorter solve shows no progress


@dataclass(frozen=True)
class Ipopt:
    """Settings of IPOPT.

    Args:
        tol: on the scaled NLP.
        max_iter: limit of iterations of one attempt.
        max_seconds: limit of wall-clock time of one attempt [s].
        scaled: scale unknowns by limits, ranges and the guess of the duration.
        progress: show iterations on the terminal during long solves; None: if standard error is one.
        print_level: of IPOPT's own log, 0 (silent) to 12.
        extra: further IPOPT options by their own names, taken verbatim.
    """

    tol: float = 1e-9
    max_iter: int = 500
    max_seconds: float = 1e6
    scaled: bool = True
    progress: bool | None = None
    print_level: int = 0
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        checks.number("Ipopt: tol", self.tol, "a number > 0", above=0.0)
        checks.whole("Ipopt: max_iter", self.max_iter, 1, of="iterations")
        checks.number("Ipopt: max_seconds", self.max_seconds, "a number > 0", above=0.0, finite=False)
        checks.truth("Ipopt: scaled", self.scaled)
        if self.progress is not None:
            checks.truth("Ipopt: progress", self.progress)
        checks.whole("Ipopt: print_level", self.print_level, 0, 12)
        checks.mapping("Ipopt: extra", self.extra, "a dict option -> value")
        for name, value in self.extra.items():
            if not isinstance(name, str) or not isinstance(value, str | int | float | np.number):
                told = f"{checks.shown(name)}: {checks.shown(value)}"
                raise ValueError(f"Ipopt: extra has {told}, expected the name of an option and a number or a text")

    def options(self, warm: bool) -> dict[str, Any]:
        """Return the options for nlpsol; CasADi's own and IPOPT's are kept apart."""
        checks.truth("warm", warm)
        ipopt: dict[str, Any] = {
            "tol": self.tol,
            "max_iter": int(self.max_iter),
            "max_wall_time": min(float(self.max_seconds), 1e20),
            "print_level": self.print_level,
            "sb": "yes",
            "mu_strategy": "monotone",
            # Limits are what the user said, not 1e-8 more.
            "bound_relax_factor": 0.0,
            "honor_original_bounds": "yes",
            # Unknowns are scaled to about one; such values mean that something has no bound.
            "diverging_iterates_tol": 1e10,
        }
        if warm:
            # A good guess must not be pushed away from the limits it lies on.
            ipopt |= {"mu_init": 1e-3, "bound_push": 1e-4, "bound_frac": 1e-4}
        ipopt |= self.extra
        quiet = dict.fromkeys(("print_time", "error_on_fail", "calc_lam_p", "calc_lam_x", "calc_f", "calc_g"), False)
        return {"ipopt": ipopt, **quiet, "record_time": True, "no_nlp_grad": True}


@dataclass(frozen=True, eq=False)
class Answer:
    """What IPOPT returned."""

    z: Array  # (nz,)
    multipliers: Array  # (ng,) of the rows
    limits: Array  # (nz,) multipliers of the bounds of the unknowns, > 0 at upper ones
    cost: float
    status: Status
    verbatim: str
    iterations: int
    derivatives: float  # seconds in CasADi functions
    seconds: float  # wall clock of the whole call
    log: Mapping[str, Sequence[float]]


@dataclass(frozen=True, eq=False)
class Solver:
    """The solver function of an NLP, and what watches it (CasADi keeps no reference of its own)."""

    function: ca.Function
    watch: Watch
    cost: float = 1.0  # what the cost is divided by
    rows: Array = field(default_factory=lambda: np.ones(1))  # (ng,) what the rows are divided by


def build(
    nlp: Mapping[str, ca.MX], derivatives: Mapping[str, ca.Function], settings: Ipopt, warm: bool,
    sizes: tuple[float, Array],
) -> Solver:  # fmt: skip
    """Return the solver of an NLP, which sees cost and rows divided by their sizes.

    Raises:
        ValueError: IPOPT does not know an option in `extra`.
    """
    cost, rows = sizes
    nlp, derivatives = _divided(nlp, derivatives, cost, rows)
    options = settings.options(warm) | dict(derivatives)
    shown = settings.progress if settings.progress is not None else sys.stderr.isatty()
    watch = Watch(nlp["x"].numel(), nlp["g"].numel(), nlp["p"].numel(), shown)
    options["iteration_callback"] = watch
    try:
        return Solver(ca.nlpsol("solver", "ipopt", dict(nlp), options), watch, cost, rows)
    except RuntimeError as error:
        told = checks.shown(dict(settings.extra))
        why = SOURCE.sub("", str(error).strip().splitlines()[-1])
        raise ValueError(f"Ipopt: extra is {told}, expected options of IPOPT ({checks.shown(why)})") from None


def _divided(
    nlp: Mapping[str, ca.MX], derivatives: Mapping[str, ca.Function], cost: float, rows: Array
) -> tuple[Mapping[str, ca.MX], Mapping[str, ca.Function]]:
    """Return an NLP and its derivatives with the cost and the rows divided by their sizes."""
    if cost == 1.0 and np.all(rows == 1.0):
        return nlp, derivatives
    z, s, by = nlp["x"], nlp["p"], ca.DM(1.0 / rows)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(rows))
    f, slope = derivatives["grad_f"](z, s)
    g, jacobian = derivatives["jac_g"](z, s)
    own = np.array(jacobian.sparsity().row(), dtype=int)
    jacobian = ca.sparsity_cast(ca.vec(jacobian.nz[:]) * ca.DM(1.0 / rows[own]), jacobian.sparsity())
    hessian = derivatives["hess_lag"](z, s, lam_f / cost, lam_g * by)
    divided = {
        "grad_f": ca.Function("nlp_grad_f", [z, s], [f / cost, slope / cost], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [z, s], [g * by, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [z, s, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }
    return {**nlp, "f": nlp["f"] / cost, "g": nlp["g"] * by}, divided


def run(
    solver: Solver, z0: Array, p: Array, bounds: tuple[Array, Array, Array, Array],
    duals: tuple[Array, Array] | None = None,
) -> Answer:  # fmt: skip
    """Solve, from multipliers of the bounds and the rows as well if given; nothing that happens inside raises.

    The NLP sees cost and rows divided by their sizes; limits of rows, multipliers and cost are physical ones.
    """
    begun = time.perf_counter()
    size, rows = solver.cost, solver.rows
    low, high, rows_low, rows_high = bounds[0], bounds[1], bounds[2] / rows, bounds[3] / rows
    first = {} if duals is None else {"lam_x0": duals[0] / size, "lam_g0": duals[1] * rows / size}
    try:
        solver.watch.reset(rows_low, rows_high, size)
        with interruptible(solver.watch):
            result = solver.function(x0=z0, p=p, lbx=low, ubx=high, lbg=rows_low, ubg=rows_high, **first)
        solver.watch.clear()
        stats = solver.function.stats()
        z, multipliers, limits = (np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x"))
        multipliers, limits = size * multipliers / rows, size * limits
        cost, verbatim = size * float(result["f"]), str(stats["return_status"])
        iterations = max(int(stats.get("iter_count", 0)), solver.watch.count - 1)
    except (RuntimeError, KeyboardInterrupt) as error:
        stopped = isinstance(error, KeyboardInterrupt) or "KeyboardInterrupt" in str(error)
        stats, z, cost, iterations = {}, z0, np.nan, 0
        multipliers, limits = np.zeros(len(rows_low)), np.zeros(len(z0))
        verbatim = "User_Requested_Stop" if stopped else f"error: {str(error).splitlines()[-1]}"
    if verbatim == "Invalid_Option":
        raise ValueError("Ipopt: an option in extra has a value that IPOPT does not take; its log names it")
    seconds = time.perf_counter() - begun
    derivatives = sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_"))
    log = {key: list(column) for key, column in stats.get("iterations", {}).items()}
    log |= {"obj": [size * value for value in log["obj"]]} if "obj" in log else {}
    status = STATUS.get(verbatim, Status.FAILED)
    return Answer(z, multipliers, limits, cost, status, verbatim, iterations, derivatives, seconds, log)


class Watch(ca.Callback):  # type: ignore[misc]
    """Called at every iteration: stops on request, and shows progress once a solve has lasted a while."""

    def __init__(self, nz: int, ng: int, np_: int, shown: bool) -> None:
        ca.Callback.__init__(self)
        self._sizes = {"x": nz, "f": 1, "g": ng, "lam_x": nz, "lam_g": ng, "lam_p": np_}
        self._shown = shown
        self.reset()
        self.construct("watch", {})

    def reset(self, low: Array | None = None, high: Array | None = None, size: float = 1.0) -> None:
        """Begin anew, with the limits of the rows and the size of the cost: no request to stop, no iterations."""
        self._low, self._high, self._size = low, high, size
        self.stop = False
        self.count, self._told = 0, False
        self._begun = self._last = time.perf_counter()

    def interrupt(self, *_: object) -> None:
        """Ask the solver to stop after this iteration; asked twice, interrupt at once."""
        if self.stop:
            raise KeyboardInterrupt
        self.stop = True

    def get_n_in(self) -> int:
        """Return the number of inputs, those of a solver's results."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return the number of outputs."""
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Return the shape of input i."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arg: Sequence[ca.DM]) -> list[int]:
        """Return 1 to stop, 0 to go on; show a line at most twice a second."""
        now = time.perf_counter()
        self.count += 1
        if self._shown and now - self._begun > QUIET_SECONDS and now - self._last > 0.5:
            self._last, self._told = now, True
            g = np.array(arg[2]).ravel()
            beyond = (
                0.0
                if self._low is None or self._high is None
                else float(np.max([self._low - g, g - self._high], initial=0.0))
            )
            line = f"  iteration {self.count}, cost {self._size * float(arg[1]):.6g}, infeasibility {beyond:.1e}, "
            line += f"{now - self._begun:.0f} s"
            print(f"\r{line:76s}", end="", file=sys.stderr, flush=True)
        return [int(self.stop)]

    def clear(self) -> None:
        """Wipe the line of progress, if there is one."""
        if self._told:
            print(f"\r{'':76s}\r", end="", file=sys.stderr, flush=True)


@contextmanager
def interruptible(watch: Watch) -> Iterator[None]:
    """Let Ctrl-C ask the solver to stop, instead of throwing its last iterate away; in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, watch.interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
