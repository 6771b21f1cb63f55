"""Identity by content: what counts, what does not, and the same in another process."""

import functools
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from models import Parameter, spherical
from models.effects import Gravity, Viscous
from models.forms import canonical, hamel
from ocp import point_to_point, radau, uniform
from ocp.studies.content_hash import as_json as line
from ocp.studies.content_hash import digest, versions

FACTOR = 2.0


def scaled(x):
    return [FACTOR * one for one in x]


def task(mass=15.0, c=0.5, form=canonical, limit=260.0):
    arm = form(spherical(m_3=mass), [Gravity(), Viscous(c)])
    return point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=[limit, 160.0, 3.0, 400.0])


@dataclass(frozen=True)
class Family:
    a: float
    b: np.ndarray

    def __call__(self, x):
        return self.a * x


def test_the_content_of_a_problem_counts_not_the_object():
    assert digest(task()) == digest(task())
    others = [task(mass=15.1), task(c=0.6), task(form=hamel), task(limit=261.0), task(mass=Parameter(15.0))]
    assert len({digest(problem) for problem in (task(), *others)}) == 6
    assert digest(task().system) == digest(task().system)


def test_settings_count():
    assert digest(radau(3)) == digest(radau(3))
    assert len({digest(radau(3)), digest(radau(4)), digest(uniform(5)), digest(uniform(6))}) == 4
    assert digest(Family(1.0, np.ones(2))) == digest(Family(1.0, np.ones(2)))
    assert digest(Family(1.0, np.ones(2))) != digest(Family(1.0, np.zeros(2)))
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert len({digest(1), digest(1.0), digest(True), digest("1"), digest([1]), digest(None)}) == 6


def test_a_function_is_its_code_and_what_it_names(monkeypatch):
    before = digest(scaled)
    assert digest(scaled) == before
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 3.0)  # used inside of a comprehension
    assert digest(scaled) != before

    def enclosing(k):
        return lambda x: k * x

    assert digest(enclosing(1)) == digest(enclosing(1))
    assert digest(enclosing(1)) != digest(enclosing(2))
    assert digest(lambda x: x + 1) != digest(lambda x: x + 2)
    assert digest(functools.partial(scaled, 1)) != digest(functools.partial(scaled, 2))


def test_circles_end():
    ring = [1]
    ring.append(ring)
    assert digest(ring) == digest(ring)


def test_another_process_finds_the_same():
    root = Path(__file__).parents[2]
    code = "from test_identity import digest, task, scaled; print(digest(task(), scaled))"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root,
        env={"PYTHONPATH": f"{root}:{Path(__file__).parent}", "PYTHONHASHSEED": "7"},
    )  # fmt: skip
    assert found.stdout.strip() == digest(task(), scaled)


def test_versions_are_named():
    assert set(versions()) == {"hamel", "casadi"}
    assert all(versions().values())


def test_a_case_is_one_line_of_json():
    assert line({"b": 1.0, "a": "x"}) == line({"a": "x", "b": 1.0}) == '{"a": "x", "b": 1.0}'
    with pytest.raises(ValueError, match="JSON"):
        line({"a": float("nan")})
