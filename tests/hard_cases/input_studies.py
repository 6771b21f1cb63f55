"""Valid calls of studies, their stores and tables, sensitivities and structures, and what fits their arguments."""

from __future__ import annotations

from typing import Any

import casadi as ca

import ocp
from hard_cases import input_examples as example
from hard_cases.input_call import (
    ANY_TEXT,
    AT_LEAST_ZERO,
    LIST,
    MAP,
    NOTHING,
    OPTIONAL,
    TRUTH,
    Argument,
    Call,
)  # fmt: skip
from ocp.numerics.compilation import compiled, pays
from ocp.studies.case_result import CaseResult
from ocp.studies.default_measures import measures
from ocp.studies.main_effects import influences, jumps

A = Argument
CALLED = frozenset({"function", "kind"})  # whatever can be called is a function; its errors are given by value
SHARE = frozenset({"zero", "half"})
AXIS = frozenset({"words", "truths", "long", "falling", "ragged", "cube"})
COUNT = frozenset({"zero"})


def _product(a: float, b: float = 1.0) -> float:
    return a * b


def _axis(values: object) -> ocp.Product:
    return ocp.Product({"a": values})  # type: ignore[dict-item]


def _range(pair: object) -> ocp.Random:
    return ocp.Random({"a": pair}, 3)  # type: ignore[dict-item]


def _case(row: object) -> ocp.Listed:
    return ocp.Listed([{"a": 1.0}, row])  # type: ignore[list-item]


def _cases(rows: object) -> object:
    return ocp.Study(_product, over=_Given(rows)).run()


class _Given:
    """A design of the user's own."""

    def __init__(self, rows: Any) -> None:
        self.rows = rows

    def cases(self) -> Any:
        """Return what was given as cases."""
        return self.rows


def designs() -> tuple[Call, ...]:
    """Return the calls of designs and sweeps."""
    names = frozenset({"names"})
    axes = {"axes": A({"a": [1.0, 2.0], "b": [3.0, 4.0]}, NOTHING, ("axis",))}
    box = {"ranges": A({"a": (0.0, 1.0)}, NOTHING, ("range",)), "count": A(4), "seed": A(0, COUNT)}
    return (
        Call("ocp.Product", ocp.Product, axes),
        Call("ocp.Zip", ocp.Zip, axes),
        Call("ocp.Listed", ocp.Listed, {"rows": A([{"a": 1.0}, {"a": 2.0}])}),
        Call("ocp.Random", ocp.Random, box),
        Call("ocp.LatinHypercube", ocp.LatinHypercube, box),
        Call("ocp.Sobol", ocp.Sobol, box),
        Call("values of an axis", _axis, {"values": A([1.0, 2.0], AXIS, ("axis",))}),
        Call("range of an axis", _range, {"pair": A((0.0, 1.0), NOTHING, ("range",))}),
        Call("row of a list", _case, {"row": A({"a": 2.0}, NOTHING, ("rows",))}),
        Call("design of one's own", _cases, {"rows": A([{"a": 1.0}], NOTHING, ("cases",))}),
        Call("ocp.sweep", ocp.sweep, {
            "function": A(_product, CALLED), "cases": A([{"a": 1.0}], LIST), "executor": A(None, OPTIONAL)}, list),
        Call("a case of a sweep", lambda case: ocp.sweep(_product, [case]), {
            "case": A({"a": 1.0}, frozenset({"map"}) | names)}),
    )  # fmt: skip


def studies() -> tuple[Call, ...]:
    """Return the calls of studies and of their tables."""
    study, table, folder = example.study(), example.table(), example.folder()
    column = {"name": A("duration", NOTHING, ("column",))}
    number = A(0, COUNT)
    result = {"table": A(table), "result": A("duration", NOTHING, ("column",))}
    return (
        Call("ocp.Study", ocp.Study, {
            "function": A(_product, CALLED), "over": A({"a": [1.0]}, NOTHING, ("axes", "axis")),
            "store": A(folder / "study.db", OPTIONAL | {"text"}), "scheme": A(ocp.radau(3), OPTIONAL),
            "grid": A(ocp.uniform(4), OPTIONAL), "solver": A(ocp.Ipopt(progress=False)),
            "polished": A(False, TRUTH), "neighbours": A(True, TRUTH), "verified": A(True, TRUTH),
            "checked": A(0.1, SHARE), "gentle": A(False, TRUTH), "starts": A(1),
            "measure": A(measures, CALLED), "slopes": A(False, TRUTH),
            "compiled": A(None, TRUTH | OPTIONAL), "settings": A({}, frozenset({"map", "names"})),
        }),
        Call("Study.run", study.run, {
            "executor": A(None, OPTIONAL), "retry_failed": A(False, TRUTH), "watch": A(None, OPTIONAL | CALLED)}),
        Call("StudyTable.row", table.row, {"number": number}),
        Call("StudyTable.grid", table.grid, column),
        Call("StudyTable.__getitem__", table.__getitem__, column),
        Call("StudyTable.solution", table.solution, {"number": number, "problem": A(example.cart(), OPTIONAL)}),
        Call("StudyTable.write_csv", table.write_csv, {
            "path": A(folder / "table.csv", frozenset({"text"})), "units": A(None, OPTIONAL | {"map", "names"})}),
        Call("StudyTable.write_parquet", table.write_parquet, {
            "path": A(folder / "table.parquet", frozenset({"text"}))}, needs="pyarrow"),
        Call("ocp.influence.influences", influences, result),
        Call("ocp.influence.jumps", jumps, result),
    )  # fmt: skip


def stores() -> tuple[Call, ...]:
    """Return the calls of stores."""
    store = ocp.Store(None)
    record = CaseResult("one", {"a": 1.0}, "solved", "function", "")
    return (
        Call("ocp.Store", ocp.Store, {
            "path": A(example.folder() / "store.db", OPTIONAL | {"text"}), "write": A(True, TRUTH)}, ocp.Store.close),
        Call("Store.begin", store.begin, {
            "study": A("study", ANY_TEXT), "about": A({"grid": "4"}, frozenset({"map", "names"}))}),
        Call("Store.records", store.records, {"ids": A(["one"], LIST | {"words", "map", "names"})}),
        Call("Store.of_study", store.of_study, {"study": A("study", ANY_TEXT)}),
        Call("Store.solution", store.solution, {"case": A("one", ANY_TEXT), "name": A("solution", ANY_TEXT)}),
        Call("Store.claim", store.claim, {"case": A("one", ANY_TEXT)}),
        Call("Store.finish", store.finish, {"study": A("study", ANY_TEXT), "record": A(record)}),
    )  # fmt: skip


def optima() -> tuple[Call, ...]:
    """Return the calls of sensitivities, of structures carried over and of compilation."""
    problem, polished = example.cart(), example.polished()
    known, carried = ocp.sensitivity(polished), ocp.prepare_structure(polished)
    shares = frozenset({"zero", "half", "falling"})
    at = {"t": A(0.5, shares), "held": A(ocp.Held.SHARE)}
    x = ca.SX.sym("x")
    square = ca.Function("square", [x], [x**2])
    return (
        Call("ocp.sensitivity", ocp.sensitivity, {
            "solution": A(polished), "names": A("m", OPTIONAL | LIST), "toward": A({"limit": problem}, MAP),
            "problem": A(None, OPTIONAL)}),
        Call("Sensitivity.x", known.x, at),
        Call("Sensitivity.u", known.u, at),
        Call("Sensitivity.signal", known.signal, {"signal": A("q"), **at}),
        Call("Sensitivity.switches", known.switches, {"control": A("u", NOTHING, ("row",))}),
        Call("SequenceSensitivity.signal", ocp.sensitivity(example.there_and_back()).signal, {
            "signal": A("q"), "share": A(0.5, shares), "phase": A(1, COUNT | {"zero"}, ("phase",))}),
        Call("Sensitivity.labels", known.labels, {"signal": A("q"), "name": A("m")}),
        Call("ocp.prepare_structure", ocp.prepare_structure, {
            "polished": A(polished), "solver": A(None, OPTIONAL)}),
        Call("PreparedStructure.__call__", carried, {
            "values": A({"m": 1.1}, MAP, ("parameter",)), "problem": A(None, OPTIONAL),
            "guess": A(None, OPTIONAL)}),
        Call("ocp.compilation.pays", pays, {"cases": A(10, COUNT), "derivatives": A(0.1, AT_LEAST_ZERO)}),
        Call("ocp.compilation.compiled", compiled, {"functions": A([square], LIST)}),
    )  # fmt: skip
