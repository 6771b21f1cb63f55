"""Parameter studies: a function over many cases, each stored when it is finished, resumed after an interruption."""

from __future__ import annotations

import functools
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ocp import checks
from ocp.problem.problem import Problem
from ocp.problem.sequence import Sequence as Phases
from ocp.solution.solution import Solution
from ocp.solving.ipopt import Ipopt
from ocp.studies.case_solver import StudySettings
from ocp.studies.content_hash import as_json, digest, identify, versions
from ocp.studies.default_measures import measures
from ocp.studies.designs import Case, Design, Product, plain_rows
from ocp.studies.plan import Plan, Progress
from ocp.studies.runner import carry_out
from ocp.studies.store import Store
from ocp.studies.sweeping import check_function
from ocp.studies.table import StudyTable
from ocp.studies.value_content import Coverage
from ocp.studies.warm_start_tree import parents
from ocp.transcription.grid import Grid
from ocp.transcription.schemes.scheme import Scheme

COMPILED_FROM = 100  # cases; compiling takes 0.1 to 0.7 s and saves at least 2 ms for each case

Run = Executor | Callable[[], Executor] | None


@dataclass(frozen=True, eq=False)
class Study:
    """A function over many cases, or a problem over values of its parameters.

    The function takes the values of a case as keyword arguments (a dot in a name may be an underscore) and returns a
    Problem, which the study solves; or a Solution, a number, or a mapping name -> number. Values that the function does
    not take are parameters of the problem it returns. If the system is built once, outside of the function, the study
    prepares its NLP once in each process.

    Every case has an identity: the hash of the function (code and everything that it refers to), values, settings and
    versions. A case whose identity is stored is not computed again; other settings give other identities.

    Cases form a tree: each starts from its nearest neighbour, with the neighbour's switching structure (polished
    studies), or else from its motion and multipliers, or else cold. The tree depends on the cases alone, so results
    depend neither on the executor nor on interruptions. A share of the cases (`checked`) is solved cold as well, and
    the better solution is kept.

    Args:
        function: of keyword arguments, or a Problem.
        over: name -> values (every combination), or a design: Product, Zip, Listed, Random, LatinHypercube, Sobol.
        store: SQLite file; None keeps the results in the table only.
        scheme: default radau(3).
        grid: default uniform(50).
        solver: settings.
        polished: whether solutions are polished.
        neighbours: whether cases start from their neighbours.
        checked: share of such cases that are solved cold as well.
        measure: of a Solution, returns name -> number; default cost, duration, peak and root mean square of controls.
        slopes: whether the derivatives of cost and duration by every number of a case are computed as well, from the
            optimality conditions, as columns "d duration / d NAME".
        compiled: whether the functions of an element are compiled to machine code, where a C compiler is there; None
            for studies without polish of at least 100 cases, which is when it pays.
        settings: anything else that results depend on; part of the identity.
        gentle: whether drives with slack move with the least effort (`gentlest`) where a motion is not polished.
        starts: of the search for other local optima wherever a case is solved cold; the best one counts.
        verified: whether every solution is checked by `verify` as well; column `verified`, reasons in the message.

    Raises:
        TypeError, ValueError: wrong input, named.
    """

    function: Any
    over: Mapping[str, Sequence[Any]] | Design
    store: str | os.PathLike[str] | None = None
    scheme: Scheme | None = None
    grid: Grid | None = None
    solver: Ipopt = field(default_factory=lambda: Ipopt(progress=False))
    polished: bool = False
    neighbours: bool = True
    checked: float = 0.05
    measure: Callable[[Solution], Mapping[str, float]] = measures
    slopes: bool = False
    compiled: bool | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    verified: bool = False
    gentle: bool = False
    starts: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.function, Problem | Phases):
            check_function("Study: function", self.function)
        if isinstance(self.over, Mapping):
            object.__setattr__(self, "over", Product(self.over))
        if not callable(getattr(self.over, "cases", None)):
            shown = checks.shown(self.over)
            raise TypeError(f"Study: over is {shown}, expected name -> values, or a design such as Product, Sobol")
        if self.store is not None:
            checks.path("Study: store", self.store)
        checks.instance("Study: scheme", self.scheme, Scheme | None, "a Scheme such as radau(3), or None")
        checks.instance("Study: grid", self.grid, Grid | None, "a Grid such as uniform(50), or None")
        checks.instance("Study: solver", self.solver, Ipopt, "settings of the solver, Ipopt(...)")
        for name in ("polished", "neighbours", "slopes", "verified", "gentle"):
            checks.truth(f"Study: {name}", getattr(self, name))
        checks.whole("Study: starts", self.starts, 1)
        checks.instance("Study: compiled", self.compiled, bool | None, "True, False, or None for where it pays")
        share = "a share between 0 and 1"
        if checks.number("Study: checked", self.checked, share, at_least=0.0) > 1.0:
            raise checks.refused("Study: checked", self.checked, share)
        if not callable(self.measure):
            raise TypeError(f"Study: measure is {checks.shown(self.measure)}, expected a function of a Solution")
        checks.mapping("Study: settings", self.settings, "name -> value")

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """The cases, each once, in the order of the design."""
        assert not isinstance(self.over, Mapping)
        rows = plain_rows("Study: cases of over", self.over.cases())
        return tuple({as_json(row): row for row in rows}.values())

    @property
    def identity(self) -> str:
        """Hash of everything but the values of the cases.

        Raises:
            UnidentifiedError: the function uses something whose content cannot be read, and there is a store.
        """
        return self._identified[0]

    @property
    def covers(self) -> Coverage:
        """What the identity covers: functions, classes and files by content, libraries by version."""
        return self._identified[1]

    @cached_property
    def _identified(self) -> tuple[str, Coverage]:
        own = (
            self.scheme,
            self.grid,
            self.solver,
            self.polished,
            self.neighbours,
            self.checked,
            self.measure,
            self.slopes,
        )
        own += ("verified",) if self.verified else ()  # type: ignore[assignment]
        own += ("gentle",) if self.gentle else ()  # type: ignore[assignment]
        own += (("starts", self.starts),) if self.starts > 1 else ()  # type: ignore[assignment]
        parts = (self.function, own, dict(self.settings), versions())
        return identify(parts, self.settings, strict=self.store is not None)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Identity of every case."""
        return tuple(digest(self.identity, as_json(case)) for case in self.cases)

    @property
    def about(self) -> dict[str, Any]:
        """Function, settings and versions in words, as they are stored."""
        name = getattr(self.function, "__qualname__", type(self.function).__name__)
        return {
            "function": f"{getattr(self.function, '__module__', '')}.{name}",
            "names": list(self.cases[0]),
            "scheme": repr(self.scheme),
            "grid": repr(self.grid),
            "solver": repr(self.solver),
            "polished": self.polished,
            "neighbours": self.neighbours,
            "checked": self.checked,
            "slopes": self.slopes,
            "settings": {key: repr(value) for key, value in self.settings.items()},
            "signatures": sorted(self.covers.signatures),
            "python": platform.python_version(),
            "platform": platform.platform(),
            **versions(),
        }

    def run(
        self, executor: Run = None, retry_failed: bool = False, watch: Callable[[Progress], None] | None = None
    ) -> StudyTable:
        """Compute the cases that are not stored yet and return the table of all cases.

        A case that fails is stored with its diagnosis, and the study goes on. A run that is interrupted or killed loses
        only the cases that were being computed; the next run computes the rest. Two processes may run the same study on
        one store, each computing a part of the cases.

        Args:
            executor: any concurrent.futures.Executor, or a function that makes one (then a pool with a dead process is
                replaced); None computes in this process.
            retry_failed: whether cases that failed are tried again, with the whole ladder of guesses.
            watch: called with the progress after every case.

        Raises:
            TypeError, ValueError: an argument of the wrong kind, or a design without cases.
            UnidentifiedError: the study has a store, and the function uses something whose content cannot be read.
            StoreError: the store cannot be read or written; what was stored is kept.
            RuntimeError: the executor broke; what was stored is kept.
        """
        if executor is not None and not isinstance(executor, Executor) and not callable(executor):
            shown = checks.shown(executor)
            raise TypeError(
                f"run: executor is {shown}, expected a concurrent.futures.Executor, or a function that makes one"
            )
        checks.truth("run: retry_failed", retry_failed)
        if watch is not None and not callable(watch):
            raise TypeError(f"run: watch is {checks.shown(watch)}, expected a function of the progress, or None")
        about = self.about  # before the store is opened: it may be refused
        store = Store(self.store)
        try:
            store.begin(self.identity, about)
            self._check_signatures(store, about)
            settings = StudySettings(
                self.identity, self.function, self._first, self.measure, self.scheme, self.grid, self.solver,
                self.polished, self.neighbours, self.checked, self.slopes, self._compiled, self.verified,
                self.gentle, self.starts,
            )  # fmt: skip
            plan = Plan(settings, self.cases, self.ids, self._parents)
            carry_out(plan, store, executor, retry_failed, watch)
            return self._table(store)
        finally:
            if self.store is not None:
                store.close()

    def table(self) -> StudyTable:
        """Return the table of the stored cases, with gaps for the others; nothing is computed or written.

        Raises:
            StoreError: there is no store, or it cannot be read.
            ValueError: the study has no store.
        """
        if self.store is None:
            raise ValueError("table: this study has no store; run() returns its table")
        with Store(self.store, write=False) as store:
            return self._table(store)

    def _check_signatures(self, store: Store, about: Mapping[str, Any]) -> None:
        """Refuse stored cases of functions whose arguments had other names; names of arguments are not hashed."""
        stored = store.studies()[self.identity].get("signatures", about["signatures"])
        if stored != about["signatures"]:
            changed = ", ".join(sorted(set(about["signatures"]) ^ set(stored)))
            raise ValueError(
                f"run: arguments were renamed or exchanged since cases were stored ({changed}); "
                "give another value in settings= to compute them anew"
            )

    @cached_property
    def _parents(self) -> tuple[int | None, ...]:
        return tuple(parents(self.cases)) if self.neighbours else (None,) * len(self.cases)

    @property
    def _compiled(self) -> bool:
        # From the number of cases alone, so that every process and every run decides the same.
        long = len(self.cases) >= COMPILED_FROM and not (self.polished and self.neighbours)
        return long if self.compiled is None else self.compiled

    @property
    def _first(self) -> Case:
        """The root of the tree, for which the NLP is prepared."""
        return self.cases[self._parents.index(None)]

    def _table(self, store: Store) -> StudyTable:
        stored = store.records(self.ids)
        assert not isinstance(self.over, Mapping)
        read = functools.partial(_read, self.store) if self.store is not None else store.solution
        rows = tuple(stored.get(name) for name in self.ids)
        return StudyTable(self.cases, rows, self.over, read, str(self.covers))


def _read(path: str | os.PathLike[str], case: str, name: str) -> bytes | None:
    with Store(path, write=False) as store:
        return store.solution(case, name)
