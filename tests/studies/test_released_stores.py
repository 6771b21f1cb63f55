"""Stores that release 0.1.0 wrote are read, and none of their cases is computed again."""

import json
import shutil
import sqlite3
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.released import studies
from catalogue.released_values import values
from reports import study_file

import models
import ocp
from ocp.solution.storage import decode
from ocp.studies import study as study_module
from ocp.studies import worker
from ocp.studies.content_hash import digest

DATA = Path(__file__).parent / "data"
WRITTEN_BY = {"hamel": "not installed", "casadi": "3.8.2"}  # versions that are part of the stored identities
NAMES = ("numbers", "machine", "shortest", "polished", "problem", "scene")
# Code is hashed as byte code, graphs as CasADi writes them: with other versions all identities are others.
same_versions = pytest.mark.skipif(
    sys.version_info[:2] != (3, 11) or ca.CasadiMeta.version() != WRITTEN_BY["casadi"],
    reason="the stores were written with Python 3.11 and CasADi 3.8.2",
)


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """Return name -> study, each with a copy of its store."""
    monkeypatch.setattr(study_module, "versions", lambda: WRITTEN_BY)
    for file in DATA.iterdir():
        shutil.copy(file, tmp_path)
    scene, _ = study_file.load(tmp_path / "released.toml", tmp_path / "released.db")
    return {**studies(tmp_path), "scene": scene}


def rows(path):
    with sqlite3.connect(path) as connection:
        return connection.execute("select id, status, way, results, attempts, finished from cases").fetchall()


@same_versions
@pytest.mark.parametrize("name", NAMES)
def test_no_case_of_a_released_store_is_computed_again(stored, name, monkeypatch):
    study = stored[name]
    before = rows(study.store)
    assert sorted(study.ids) == sorted(row[0] for row in before)

    def never(*_):
        raise AssertionError("a stored case was computed again")

    monkeypatch.setattr(worker, "call", never)
    table = study.run()
    assert np.all(table.ok)
    assert rows(study.store) == before


@pytest.mark.parametrize("name", ["shortest", "polished", "problem", "scene"])
def test_stored_solutions_are_read_with_their_switching_structure(stored, name):
    path = stored[name].store
    with ocp.Store(path, write=False) as store:
        (identity,) = store.studies()
        results = store.records(store.of_study(identity))
        assert len(results) in (2, 4)
        for case, result in results.items():
            solution = decode(store.solution(case), None, case)
            assert solution.duration == result.results["duration"]
            assert (solution.structure is not None) == (result.structure is not None)
        assert any(result.structure for result in results.values()) == (name in ("polished", "scene"))


@same_versions
def test_values_keep_the_digests_that_the_release_gave_them():
    """A field that an effect, a scheme, a machine got since then counts only if it is not its default."""
    released = json.loads((DATA / "digests.json").read_text())
    assert {name: [digest(value), digest(type(value))] for name, value in values().items()} == released


def _of_package(package):
    """Yield the classes of a package that its modules define."""
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == package:
            yield from (v for v in vars(module).values() if isinstance(v, type) and v.__module__ == name)


@pytest.mark.parametrize("package", [ocp, models])
def test_every_class_counts_by_a_name_that_does_not_depend_on_its_file(package, monkeypatch):
    """A class that is moved to another module keeps its digest, whether it was released or is new."""
    classes = set(_of_package(package.__name__))
    assert len(classes) > 40
    for kind in classes:
        before = digest(kind)
        with monkeypatch.context() as moved:
            moved.setattr(kind, "__module__", f"{package.__name__}.somewhere.else")
            assert digest(kind) == before, kind


def test_a_class_of_the_user_is_not_taken_for_one_of_the_package():
    mine = type("Gravity", (), {"__module__": "mine"})
    assert digest(mine) != digest(models.effects.Gravity)
    assert digest(mine) != digest(type("Gravity", (), {"__module__": "others"}))
