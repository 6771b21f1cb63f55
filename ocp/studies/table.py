"""Table of a study: one row for each case, NaN where a case failed or is not computed yet."""

from __future__ import annotations

import csv
import io
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.files import written_whole
from ocp.problem.problem import Problem
from ocp.solution.solution import Solution
from ocp.solution.storage import decode
from ocp.studies.case_result import CaseResult
from ocp.studies.designs import Case, Design, Product

WORDS = ("status", "way", "message", "resolved", "verified")
UNRESOLVED = "the grid does not resolve the motion"  # in the message of a solution


@dataclass(frozen=True, eq=False)
class StudyTable:
    """Table of the results of a study, one row for each case.

    Columns are the names of the values of a case, then `status`, `way`, `message`, `resolved` (whether the grid
    resolves the motion: yes, no, or "" if no motion was solved), `verified` (the same for `verify`, if the study asked
    for it), `seconds`, then the results; results of cases that failed or are not computed yet are NaN.

    Args:
        cases: in the order of the design.
        records: result of each case, None where nothing is stored.
        design: of the study.
        read: (id, name) -> content of a stored solution, or None.
        covers: what the identity of the cases covers, for the summary.
    """

    cases: tuple[Case, ...]
    records: tuple[CaseResult | None, ...]
    design: Design
    read: Callable[[str, str], bytes | None]
    covers: str = ""

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self.row(k) for k in range(len(self)))

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the values of a case."""
        return tuple(self.cases[0])

    @cached_property
    def results(self) -> tuple[str, ...]:
        """Names of the results."""
        return tuple(
            dict.fromkeys(name for result in self.records if result for name in result.results if name != "verified")
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.axes, *WORDS, "seconds", *(name for name in self.results if name not in self.axes))

    @property
    def ok(self) -> Array:
        """(n,) whether each case is solved."""
        return np.array([result is not None and result.ok for result in self.records])

    @property
    def failures(self) -> dict[int, str]:
        """Number of each failed case -> its message."""
        return {k: result.message for k, result in enumerate(self.records) if result is not None and not result.ok}

    def row(self, number: int) -> dict[str, Any]:
        """Return all columns of a case.

        Args:
            number: of the case.

        Raises:
            ValueError: no such case.
        """
        result = self.records[self._number(number)]
        words = _words(result)
        numbers = {name: result.results.get(name, math.nan) if result and result.ok else math.nan
                   for name in self.results}  # fmt: skip
        seconds = result.timings.get("total", math.nan) if result else math.nan
        return {**numbers, **self.cases[number], **words, "seconds": seconds}

    @property
    def unresolved(self) -> tuple[int, ...]:
        """Numbers of the solved cases whose grid does not resolve the motion."""
        return tuple(k for k, result in enumerate(self.records) if _words(result)["resolved"] == "no")

    def _number(self, number: object) -> int:
        return checks.whole("number", number, 0, len(self) - 1, "a case")

    def __getitem__(self, name: str) -> Array:
        """Return a column (n,): numbers, or texts.

        Raises:
            KeyError: no such column.
        """
        checks.text("column", name, "the name of a column")
        if name not in self.columns:
            raise KeyError(f"no column {name!r}; there are {', '.join(self.columns)}")
        return self._columns[name].copy()

    @cached_property
    def _columns(self) -> dict[str, Array]:
        rows = list(self)
        return {name: np.array([row[name] for row in rows]) for name in self.columns}

    def grid(self, name: str) -> Array:
        """Return a column in the shape of the axes, for a study over every combination.

        Raises:
            ValueError: the design is no Product.
            KeyError: no such column.
        """
        column = self[name]
        if not isinstance(self.design, Product) or math.prod(self.design.shape) != len(self):
            raise ValueError(
                f"grid: the design is {type(self.design).__name__}, expected a Product without repetitions"
            )
        return column.reshape(self.design.shape)

    def solution(self, number: int, problem: Problem | None = None) -> Solution:
        """Return the stored solution of a case.

        Args:
            number: of the case.
            problem: of the case; needed for signals by name.

        Raises:
            TypeError: problem is not a Problem.
            ValueError: no such case, or nothing is stored for it.
        """
        checks.instance("problem", problem, Problem | None, "the Problem it solves, or None")
        result = self.records[self._number(number)]
        content = self.read(result.id, "solution") if result else None
        if content is None or result is None:
            raise ValueError(f"solution: nothing is stored for case {number}, {self.cases[number]}")
        return decode(content, problem, f"solution of case {number}, {checks.shown(self.cases[number])}")

    def as_arrays(self) -> dict[str, Array]:
        """Return column -> array (n,)."""
        return {name: self[name] for name in self.columns}

    def as_pandas(self) -> Any:
        """Return the table as a pandas.DataFrame.

        Raises:
            ImportError: pandas is missing.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("as_pandas needs pandas: pip install pandas") from None
        return pandas.DataFrame(list(self), columns=list(self.columns))

    def as_xarray(self) -> Any:
        """Return the results of a study over every combination as an xarray.Dataset, its axes as coordinates.

        Raises:
            ImportError: xarray is missing.
            ValueError: the design is no Product.
        """
        try:
            import xarray
        except ImportError:
            raise ImportError("as_xarray needs xarray: pip install xarray") from None
        data = {name: (self.axes, self.grid(name)) for name in (*self.results, "seconds", "status", "way")}
        assert isinstance(self.design, Product)
        return xarray.Dataset(data, coords={name: list(values) for name, values in self.design.axes.items()})

    def write_csv(self, path: str | os.PathLike[str], units: Mapping[str, str] | None = None) -> None:
        """Write all columns; an existing file is replaced only when the new one is complete.

        Args:
            path: of the file.
            units: column -> unit, which the header has in brackets behind the name; seconds are known.

        Raises:
            TypeError, ValueError: no path of a file.
            OSError: the file cannot be written.
        """
        target = checks.path("path", path)
        if units is not None:
            checks.mapping("units", units, "column -> unit, or None")
        text = io.StringIO()
        writer = csv.writer(text)
        if units is not None:
            checks.mapping("units", units, "a dict column -> unit")
        known = {} if units is None else {"seconds": "s", **units}
        writer.writerow([f"{name} [{known[name]}]" if known.get(name) else name for name in self.columns])
        for row in self:
            values = [row[name] for name in self.columns]
            writer.writerow([repr(value) if isinstance(value, float) else value for value in values])
        with written_whole(target) as part:
            part.write_bytes(text.getvalue().encode())

    def write_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write all columns as Parquet; an existing file is replaced only when the new one is complete.

        Raises:
            ImportError: PyArrow is missing.
            TypeError, ValueError: no path of a file.
            OSError: the file cannot be written.
        """
        target = checks.path("path", path)
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            raise ImportError("write_parquet needs PyArrow: pip install pyarrow") from None
        columns = {name: [row[name] for row in self] for name in self.columns}
        content = io.BytesIO()
        pyarrow.parquet.write_table(pyarrow.table(columns), content)
        with written_whole(target) as part:
            part.write_bytes(content.getvalue())

    def __str__(self) -> str:
        counts = Counter(result.status if result else "open" for result in self.records)
        ways = Counter(result.way for result in self.records if result and result.ok)
        seconds = self["seconds"][self.ok]
        lines = [f"{len(self)} cases: {', '.join(f'{count} {name}' for name, count in counts.items())}"]
        lines += [f"  {count:5d}  {way}" for way, count in ways.most_common()]
        if len(seconds):
            lines.append(f"seconds for a case: median {np.median(seconds):.3g}, all {np.nansum(seconds):.4g}")
        lines += [f"case {k} {self.cases[k]}: {text}" for k, text in list(self.failures.items())[:10]]
        if len(self.failures) > 10:
            lines.append(f"and {len(self.failures) - 10} more failures")
        if self.unresolved:
            numbers = ", ".join(map(str, self.unresolved[:10])) + (" ..." if len(self.unresolved) > 10 else "")
            lines.append(f"solved on a grid that does not resolve the motion: {len(self.unresolved)} cases ({numbers})")
        if self.covers:
            lines.append(f"computed anew if one of these changes: values, settings, {self.covers}")
        return "\n".join(lines)


def _words(result: CaseResult | None) -> dict[str, str]:
    """Return the columns of a case that are texts."""
    if result is None:
        return {**dict.fromkeys(WORDS, ""), "status": "open"}
    solved = result.ok and "iterations" in result.results and "solver" in result.timings
    verified = result.results.get("verified", math.nan)
    return {
        "status": result.status,
        "way": result.way,
        "message": result.message,
        "resolved": ("no" if UNRESOLVED in result.message else "yes") if solved else "",
        "verified": "" if math.isnan(verified) else "yes" if verified else "no",
    }
