"""Changes of what the function of a study uses: each gives another identity, or is refused.

The projects stand in data/changes.txt.
"""

import importlib
import logging
import re
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from ocp import Study
from ocp.studies import value_content
from ocp.studies.content_hash import digest, identify
from ocp.studies.value_content import UnidentifiedError

TEXT = (Path(__file__).parent / "data" / "changes.txt").read_text(encoding="utf-8")
CHANGES = dict(re.match(r"(.*)\n((?s:.*))", part).groups() for part in TEXT.split("\n## ")[1:])


def written(folder, text, which):
    """Write the files of a project with what stands before (0) or after (1) a change."""
    text = re.sub(r"\{\{(.*?)\|(.*?)\}\}", lambda match: match[which + 1], text)
    for part in f"--- project.py\n{text}".split("--- ")[1:]:
        name, _, content = part.partition("\n")
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


def loaded(folder, read):
    """Import project.py of a folder, return what `read` finds in it, and forget everything that was imported."""
    before, paths = set(sys.modules), [str(folder), str(folder / "site-packages")]
    sys.path[:0] = paths
    importlib.invalidate_caches()
    try:
        return read(importlib.import_module("project"))
    finally:
        del sys.path[:2]
        for name in set(sys.modules) - before:
            if str(folder) in str(getattr(sys.modules[name], "__file__", "")):
                del sys.modules[name]


def value_and_digest(project):
    return float(project.f(2.0)), digest(project.f)


def test_there_are_enough_kinds():
    assert len(CHANGES) >= 50


@pytest.mark.parametrize("kind", CHANGES)
def test_a_change_is_noticed(kind, tmp_path):
    library = re.search(r"\(needs (\w+)\)", kind)
    if library:
        pytest.importorskip(library[1], reason=f"{library[1]} is not installed")
    found = []
    for name, which in (("before", 0), ("again", 0), ("after", 1)):
        written(tmp_path / name, CHANGES[kind], which)
        found.append(loaded(tmp_path / name, value_and_digest))
    assert found[0] == found[1], "the same project has two identities"
    assert found[0][0] != found[2][0], "the change has no effect on what the function returns"
    assert found[0][1] != found[2][1], "the change goes unnoticed"


def opened(path):
    return path.open()


REFUSED = {
    "a lock": ("import threading\nk = threading.Lock()\ndef f(x):\n    return x + k.locked()\n", "'k'"),
    "an open file": ("k = open(__file__)\ndef f(x):\n    return x + k.closed\n", "'k'"),
    "a generator": ("k = (i for i in [1.0])\ndef f(x):\n    return x * next(k)\n", "'k'"),
    "a function behind a ufunc": ("import numpy\nk = numpy.frompyfunc(lambda x: x, 1, 1)\ndef f(x):\n    return k(x)\n",
                                  "'k'"),
    "a graph of CasADi": ("import casadi as ca\nk = ca.Opti()\ndef f(x):\n    return x * k.nx\n", "'k'"),
    "a lock in an object": ("import threading\nclass K:\n    pass\nk = K()\nk.inner = [threading.Lock()]\n"
                            "def f(x):\n    return x * len(k.inner)\n", "'k'"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_what_cannot_be_identified_is_refused_before_anything_is_stored(kind, tmp_path):
    text, name = REFUSED[kind]
    written(tmp_path, text, 0)

    def run(project):
        study = Study(project.f, over={"x": [1.0]}, store=tmp_path / "s.db")
        with pytest.raises(UnidentifiedError, match=rf"variable {name}.*settings=") as caught:
            study.run()
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "s.db").exists()
        given = [Study(project.f, over={"x": [1.0]}, settings={"k": k}).identity for k in (1, 2, 1)]
        assert given[0] == given[2] != given[1]
        assert "by settings: k" in str(identify((project.f,), {"k": 1})[1])
        assert Study(project.f, over={"x": [1.0]}).run().ok.all()  # without a store nothing old can come back
        getattr(project.k, "close", lambda: None)()

    loaded(tmp_path, run)


def test_other_libraries_do_not_change_the_identity_of_a_logger(tmp_path):
    written(tmp_path, "import logging\nlog = logging.getLogger('mine')\ndef f(x):\n    log.debug(x)\n    return x\n", 0)

    def twice(project):
        before = digest(project.f)
        logging.getLogger("of.another.library").addHandler(logging.NullHandler())
        logging.getLogger("mine.child").debug("text")
        project.f(1.0)
        return before, digest(project.f)

    before, after = loaded(tmp_path, twice)
    assert before == after


SAME = """
import functools
import weakref
class K:
    @functools.cached_property
    def g(self):
        return 2.0
@functools.singledispatch
def h(x):
    return x
@functools.lru_cache
def c(x):
    return x
k, held = K(), weakref.WeakValueDictionary()
def f(x):
    held[x] = k
    return k.g * h(x) * c(x)
--- other.py
g = {{1.0|2.0}}
"""


def test_a_call_and_a_file_that_is_not_imported_change_nothing(tmp_path):
    for name, which in (("before", 0), ("after", 1)):
        written(tmp_path / name, SAME, which)
    first = loaded(tmp_path / "before", lambda project: (digest(project.f), project.f(1.0), digest(project.f)))
    second = loaded(tmp_path / "after", lambda project: digest(project.f))
    assert first[0] == first[2] == second


def test_values_that_refer_to_each_other_many_times_come_to_an_end(monkeypatch):
    monkeypatch.setattr(value_content, "MOST", 2000)
    functions = "\n".join(f"def f{k}(x):\n    return [{', '.join(f'f{j}' for j in range(12))}]" for k in range(12))
    space = {"__name__": "mine"}
    exec(functions, space)
    assert digest(space["f0"]) == digest(space["f0"]) != digest(space["f1"])
    deep = [np.ones(3)]
    for _ in range(40):
        deep = [deep, deep]
    assert digest(deep) == digest(deep)


EXCHANGED = """
def g({{mass, force|force, mass}}):
    return {{force / mass|mass / force}}
def f(x, y):
    return x - y + g(mass=x, force=y)
"""


def test_exchanged_names_of_arguments_are_refused(tmp_path):
    """The byte code stays the same, and so does the digest; the store knows the names."""

    def run(project):
        study = Study(project.f, over={"x": [1.0], "y": [3.0]}, store=tmp_path / "s.db")
        return study.run()["value"].tolist()

    for name, which in (("before", 0), ("after", 1)):
        written(tmp_path / name, EXCHANGED, which)
    assert loaded(tmp_path / "before", run) == [1.0 - 3.0 + 3.0 / 1.0]
    assert loaded(tmp_path / "before", run) == [1.0 - 3.0 + 3.0 / 1.0]
    with pytest.raises(ValueError, match=r"renamed or exchanged .*g\(force, mass\).*settings="):
        loaded(tmp_path / "after", run)
    anew = lambda project: Study(project.f, over={"x": [1.0], "y": [3.0]}, settings={"arguments": 2},  # noqa: E731
                                 store=tmp_path / "s.db").run()["value"].tolist()  # fmt: skip
    assert loaded(tmp_path / "after", anew) == [1.0 - 3.0 + 1.0 / 3.0]


def test_coverage_is_said_in_the_summary(tmp_path):
    written(tmp_path, CHANGES["module behind a function of an imported module"], 0)
    study_text = loaded(tmp_path, lambda project: str(Study(project.f, over={"x": [1.0]}).run()))
    assert "function project.f(x)" in study_text
    assert "function tables_of_mine.h()" in study_text
    assert "file params_of_mine.py" in study_text


def test_locks_of_the_process_do_not_hinder_a_function_that_does_not_name_them():
    lock = threading.Lock()
    assert lock is not None
    assert digest(opened)
