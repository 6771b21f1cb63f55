"""The contract between optimal control and a solver of nonlinear programs (NLPs), and its use in physical units.

A new solver is one file with two classes: frozen settings that follow `NlpSettings`, and the function they make, that
follows `NlpSolver`. `ocp.solving.ipopt` is one; `solve(problem, solver=MySettings())` takes any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol, runtime_checkable

from ocp.checks import Array
from ocp.solution.solution import Status
from ocp.transcription.scaled_nlp import Bounds, ScaledNlp


class Start(Enum):
    """What is known when a solve begins."""

    COLD = "cold"  # a rough initial guess
    WARM = "warm"  # unknowns near a solution, on or near their bounds
    MULTIPLIERS = "multipliers"  # unknowns and multipliers near a solution


@dataclass(frozen=True, eq=False)
class NlpResult:
    """What an NLP solver returns, whatever happened."""

    z: Array  # (nz,) unknowns
    multipliers: Array  # (ng,) of the rows, > 0 at upper bounds
    limits: Array  # (nz,) of the bounds of the unknowns, > 0 at upper ones
    cost: float
    status: Status
    verbatim: str  # status in the words of the solver
    iterations: int
    derivatives: float  # seconds in CasADi functions
    seconds: float  # wall clock of the whole call
    log: Mapping[str, Sequence[float]]  # "obj", "inf_pr" and others by iteration; may be empty


class NlpSolver(Protocol):
    """A solver made for one NLP, called for many parameters, bounds and initial guesses."""

    def __call__(
        self, z0: Array, s: Array, bounds: Bounds, multipliers: tuple[Array, Array] | None = None
    ) -> NlpResult:
        """Solve; a failure is a status and raises nothing, Ctrl-C is `Status.STOPPED`.

        Args:
            z0: (nz,) initial guess within its bounds.
            s: parameters of the NLP.
            bounds: lower and upper bounds of the unknowns and of the scaled rows.
            multipliers: scaled ones of the bounds (nz,) and rows (ng,) to start from, or None.
        """
        ...


@runtime_checkable
class NlpSettings(Protocol):
    """Settings of an NLP solver: a frozen dataclass, so that `replace(settings, tol=...)` works."""

    @property
    def tol(self) -> float:
        """Tolerance on the scaled NLP."""
        ...

    @property
    def max_iter(self) -> int:
        """Limit of iterations of one call."""
        ...

    @property
    def max_seconds(self) -> float:
        """Limit of wall-clock time of one call [s]."""
        ...

    @property
    def scaled(self) -> bool:
        """Whether unknowns, cost and rows are scaled."""
        ...

    def make(self, nlp: ScaledNlp, start: Start) -> NlpSolver:
        """Return the solver of an NLP.

        Args:
            nlp: with cost and rows scaled.
            start: what will be known when it is called.

        Raises:
            ValueError: the solver does not know one of the settings.
        """
        ...


def limited(settings: NlpSettings, iterations: int, seconds: float) -> NlpSettings:
    """Return settings with other limits of iterations and seconds [s] for one call."""
    changed: NlpSettings = replace(settings, max_iter=iterations, max_seconds=seconds)  # type: ignore[type-var]
    return changed


@dataclass(frozen=True, eq=False)
class PhysicalSolver:
    """An NLP solver whose callers see cost, bounds of rows and multipliers in physical units."""

    nlp: ScaledNlp
    solver: NlpSolver

    def __call__(
        self, z0: Array, s: Array, bounds: Bounds, multipliers: tuple[Array, Array] | None = None
    ) -> NlpResult:
        """Solve; arguments as for `NlpSolver`, with bounds of rows, multipliers and results in physical units."""
        nlp = self.nlp
        start = None if multipliers is None else nlp.scaled_multipliers(multipliers)
        result = self.solver(z0, s, nlp.scaled_bounds(bounds), start)
        limits, rows = nlp.physical_multipliers((result.limits, result.multipliers))
        log = dict(result.log)
        log |= {"obj": [nlp.cost * value for value in log["obj"]]} if "obj" in log else {}
        return replace(result, multipliers=rows, limits=limits, cost=nlp.cost * result.cost, log=log)


def physical_solver(nlp: ScaledNlp, settings: NlpSettings, start: Start = Start.COLD) -> PhysicalSolver:
    """Return the solver of an NLP whose callers see physical cost and rows.

    Args:
        nlp: as the solver sees it.
        settings: of the solver, such as Ipopt().
        start: what will be known when it is called.
    """
    return PhysicalSolver(nlp, settings.make(nlp, start))
