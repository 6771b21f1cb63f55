"""Reports of motions through points, budgets, motions of no length, infeasible tasks, arms with capsules."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from catalogue.report_texts import LARGEST, STUDY, text_of

pytest.importorskip("plotly", reason="reports need Plotly: pip install plotly")

import study
import time_optimal
from html_reports.playback import playback

from models import Joint, Link, cylindrical, serial
from models.plots.signals import links, skeleton
from models.rigid_bodies import Capsule


@pytest.mark.slow
def test_a_study_of_motions_through_points_shows_them(tmp_path: Path) -> None:
    text = STUDY.replace("elements = 8", "via = [[0.5, 0.3, 0.6]]\nelements = 6").replace("[0.1, 1.0, 1.2]", "[1.0]")
    (tmp_path / "via.toml").write_text(text, encoding="utf-8")
    assert study.main([str(tmp_path / "via.toml"), "--report", "--quiet", "--output", str(tmp_path)]) == 0
    found = re.search(r"window\.motions = (.*?);</script>", text_of(tmp_path / "via.html"))
    motions = json.loads(found.group(1))  # type: ignore[union-attr]
    assert sorted(motions) == ["0", "1"]
    wanted = skeleton(cylindrical(), np.array([[0.0, 0.2, 0.6], [1.0, 0.5, 0.7], [0.5, 0.3, 0.6]]))
    for motion in motions.values():
        poses = np.array(motion["poses"]).transpose(0, 2, 1)
        np.testing.assert_allclose(poses[[0, -1]], wanted[:2], atol=2e-3)
        assert np.min(np.linalg.norm(poses[:, -1] - wanted[2, -1], axis=1)) < 0.05


@pytest.mark.slow
def test_a_budget_has_a_report(tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text(STUDY[: STUDY.index("[study.over]")].replace("= 8", "= 20"), encoding="utf-8")
    arguments = [str(tmp_path / "lift.toml"), "--budget", "--report", "--quiet", "--output", str(tmp_path)]
    assert time_optimal.main(arguments) in (0, 1)
    text = text_of(tmp_path / "budget.html")
    assert "The dearest effect is gravity" in text
    assert "without gravity" in text
    assert (tmp_path / "budget.html").stat().st_size < LARGEST


@pytest.mark.slow
def test_a_motion_of_no_length_and_an_infeasible_one_have_reports(tmp_path: Path) -> None:
    scene = STUDY[: STUDY.index("[study.over]")]
    for name, change, words in (
        ("same", ("[1.0, 0.5, 0.7]", "[0.0, 0.2, 0.6]"), "Start and goal coincide: nothing moves"),
        ("wall", ("elements", "horizon = 0.05\nelements"), "There is no motion"),
    ):
        (tmp_path / "s.toml").write_text(scene.replace(*change), encoding="utf-8")
        arguments = [str(tmp_path / "s.toml"), "--report", "--quiet", "--output", str(tmp_path / name)]
        assert time_optimal.main(arguments) == int(name == "wall")
        text = text_of(tmp_path / name / "time_optimal.html")
        assert words in text
        assert ("Remedy: try a longer duration" in text) == (name == "wall")
        assert ("currentvalue" in text) == (name == "wall")


def test_capsules_of_links_move_with_the_arm() -> None:
    link = Link(4.0, (0.25, 0.0, 0.0), (0.01, 0.1, 0.1), (Capsule((0, 0, 0), (0.5, 0, 0), 0.05),))
    arm = serial([Joint("q1", link=link), Joint("q2", origin=(0.5, 0, 0), link=link)], tool=(0.5, 0, 0))
    q = np.array([[0.0, 0.0], [0.7, -1.1], [1.5, 0.4]])
    corners, hulls = skeleton(arm, q), links(arm, q)
    drawing = playback(np.array([0.0, 0.5, 1.0]), corners, links=hulls)
    assert drawing.data[-1].name == "links"
    for k, frame in enumerate(drawing.frames):
        points = np.array([frame.data[1][axis] for axis in "xyz"]).T
        a, b, c = corners[k][-3:]  # the joints and the tool: ends of the lines of both capsules
        away = np.minimum(distance(points, a, b), distance(points, b, c))
        np.testing.assert_allclose(away[distance(points, a, b) > 0.06].max(), 0.05, atol=1e-3)
        assert away.max() < 0.0501


def distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distances (K,) of points (K, 3) from a straight line between two points."""
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)
