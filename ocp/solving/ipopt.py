"""IPOPT as an NLP solver: settings, options, status. The only file that calls nlpsol."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.solution.solution import Status
from ocp.solving.iteration_watch import Watch, interruptible
from ocp.solving.nlp_solver import NlpResult, Start
from ocp.transcription.scaled_nlp import Bounds, ScaledNlp

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
LATE = "Maximum_WallTime_Exceeded"
# Options for a start from the multipliers of a neighbouring solution: the iterates stay near the active bounds.
# Measured on refined grids: a third to two thirds of the iterations of a cold start.
NEAR = 1e-6
CONTINUED = {"mu_init": NEAR, "warm_start_init_point": "yes"} | {
    f"warm_start_{name}": NEAR
    for name in ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
}
SOURCE = re.compile(r"\S+\.[ch]pp:\d+: ")  # file and line of a C++ source, in error messages of CasADi
LARGE, QAMD = 10_000, 6  # rows of the KKT matrix; number of an ordering in MUMPS


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
                given = f"{checks.shown(name)}: {checks.shown(value)}"
                raise ValueError(f"Ipopt: extra has {given}, expected the name of an option and a number or a text")

    @property
    def shown(self) -> bool:
        """Whether progress is shown."""
        return sys.stderr.isatty() if self.progress is None else self.progress

    def options(self, warm: bool, multipliers: bool = False) -> dict[str, Any]:
        """Return the options for nlpsol; those of IPOPT are in an entry of their own.

        Args:
            warm: whether the initial guess is near a solution and may touch its bounds.
            multipliers: whether those of a neighbouring solution are given as well.
        """
        checks.truth("warm", warm)
        checks.truth("multipliers", multipliers)
        ipopt: dict[str, Any] = {
            "tol": self.tol,
            "max_iter": int(self.max_iter),
            "max_wall_time": min(float(self.max_seconds), 1e20),
            "print_level": self.print_level,
            "sb": "yes",
            "mu_strategy": "monotone",
            # IPOPT would relax the bounds of the user by 1e-8.
            "bound_relax_factor": 0.0,
            "honor_original_bounds": "yes",
            # Unknowns are scaled to about one; larger iterates mean that the problem is unbounded.
            "diverging_iterates_tol": 1e10,
        }
        if warm:
            # A good guess must not be pushed away from the bounds it lies on.
            ipopt |= {"mu_init": 1e-3, "bound_push": 1e-4, "bound_frac": 1e-4}
        ipopt |= {**(CONTINUED if multipliers else {}), **self.extra}
        quiet = dict.fromkeys(("print_time", "error_on_fail", "calc_lam_p", "calc_lam_x", "calc_f", "calc_g"), False)
        return {"ipopt": ipopt, **quiet, "record_time": True, "no_nlp_grad": True}

    def make(self, nlp: ScaledNlp, start: Start) -> IpoptSolver:
        """Return IPOPT for an NLP; see `NlpSettings`.

        Raises:
            ValueError: IPOPT does not know an option in `extra`.
        """
        checks.instance("nlp", nlp, ScaledNlp, "a ScaledNlp")
        checks.instance("start", start, Start, ", ".join(map(str, Start)))
        # In MUMPS' own choice for more than 10000 rows of the KKT matrix, METIS, a solve took 1.1 to 1.7 times as long.
        large = nlp.unknowns + len(nlp.rows) > LARGE and self.extra.get("linear_solver", "mumps") == "mumps"
        options = self.options(start is not Start.COLD, start is Start.MULTIPLIERS) | dict(nlp.derivatives)
        if large:
            options["ipopt"] = {"mumps_pivot_order": QAMD, **options["ipopt"]}
        watch = Watch(nlp, self.shown)
        options["iteration_callback"] = watch
        try:
            return IpoptSolver(ca.nlpsol("solver", "ipopt", dict(nlp.expressions), options), watch)
        except RuntimeError as error:
            given = checks.shown(dict(self.extra))
            why = SOURCE.sub("", str(error).strip().splitlines()[-1])
            raise ValueError(f"Ipopt: extra is {given}, expected options of IPOPT ({checks.shown(why)})") from None


@dataclass(frozen=True, eq=False)
class IpoptSolver:
    """IPOPT made for one NLP, with the callback that watches it (CasADi keeps no reference of its own)."""

    function: ca.Function
    watch: Watch

    def __call__(
        self, z0: Array, s: Array, bounds: Bounds, multipliers: tuple[Array, Array] | None = None
    ) -> NlpResult:
        """Solve; see `NlpSolver`."""
        begun = time.perf_counter()
        low, high, rows_low, rows_high = bounds
        first = {} if multipliers is None else {"lam_x0": multipliers[0], "lam_g0": multipliers[1]}
        try:
            self.watch.reset(rows_low, rows_high)
            with interruptible(self.watch):
                given = {"x0": z0, "p": s, "lbx": low, "ubx": high, "lbg": rows_low, "ubg": rows_high, **first}
                result = self.function(**{name: _argument(values) for name, values in given.items()})
            self.watch.clear()
            stats = self.function.stats()
            z, of_rows, of_bounds = (np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x"))
            cost, verbatim = float(result["f"]), str(stats["return_status"])
            verbatim = LATE if verbatim == "User_Requested_Stop" and not self.watch.stop else verbatim
        except (RuntimeError, KeyboardInterrupt) as error:
            stopped = isinstance(error, KeyboardInterrupt) or "KeyboardInterrupt" in str(error)
            stats, z, cost = {}, z0, np.nan
            of_rows, of_bounds = np.zeros(len(rows_low)), np.zeros(len(z0))
            verbatim = "User_Requested_Stop" if stopped else f"error: {str(error).splitlines()[-1]}"
        if verbatim == "Invalid_Option":
            raise ValueError("Ipopt: an option in extra has a value that IPOPT does not take; its log names it")
        seconds = time.perf_counter() - begun
        derivatives = sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_"))
        log = {key: list(column) for key, column in stats.get("iterations", {}).items()}
        # IPOPT's own count is not set when it stops before the first iteration; the log has a line for iteration 0.
        iterations = max(len(log.get("inf_pr", [])), self.watch.count, 1) - 1
        status = STATUS.get(verbatim, Status.FAILED)
        return NlpResult(z, of_rows, of_bounds, cost, status, verbatim, iterations, derivatives, seconds, log)


def _argument(values: Array) -> float | list[float]:
    """Return what CasADi reads fastest: a list, or one number if all are the same."""
    return float(values[0]) if len(values) and np.all(values == values[0]) else values.tolist()
