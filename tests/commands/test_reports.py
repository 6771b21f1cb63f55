"""Reports: one file without a network, figures that show what was computed, playback that works in a real browser."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue.report_texts import LARGEST, STUDY, text_of

pytest.importorskip("plotly", reason="reports need Plotly: pip install plotly")

import accuracy
import study
import time_optimal
import torques
from html_reports.playback import playback
from html_reports.time_curves import Panel, intervals, time_curves
from reports.scene_toml import as_toml

from models import cylindrical
from models.plots.signals import skeleton
from models.scenes import task_file
from models.scenes.scene_template import TASKS, scene_text
from models.scenes.toml_document import parse
from ocp import Ball, load

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motion")
    scene = ROOT / "scripts" / "scenes" / "cylindrical.toml"
    assert time_optimal.main([str(scene), "--nodes", "30", "--report", "--quiet", "--output", str(folder)]) in (0, 1)
    return folder / "time_optimal.html"


def test_a_report_is_one_small_file_without_a_network(motion: Path) -> None:
    assert motion.stat().st_size < LARGEST
    text = text_of(motion)
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)
    for words in ("verdict", "The motion takes", "What limits it", "torque_speed_phi", "casadi", "plotly", "command: "):
        assert words in text


def test_a_report_contains_the_scene_that_made_it(motion: Path) -> None:
    import html

    blocks = [html.unescape(block) for block in re.findall(r"<pre>(.*?)</pre>", text_of(motion), re.DOTALL)]
    written = tomllib.loads(blocks[0])
    given = tomllib.loads((ROOT / "scripts" / "scenes" / "cylindrical.toml").read_text(encoding="utf-8"))
    assert written == given


@pytest.mark.parametrize("name", TASKS)
def test_scenes_survive_being_written(name: str) -> None:
    entries = parse(scene_text(name), name).entries
    assert tomllib.loads(as_toml(entries)) == entries


def test_awkward_entries_survive_being_written() -> None:
    entries = {
        "machine": 'a "quoted" \\ name', "flag": True, "n": 3, "x": 1e-300, "list": [[1.0, 2.0], [3.0]],
        "effects": {"gravity": {}, "coulomb": {"f": {"theta": 1.0}, "odd key.": [0.5]}},
        "task": {"to": {"tool": [1.0, 2.0]}, "obstacles": [{"shape": "ball", "radius": 0.1}, {"shape": "box"}]},
        "study": {"over": {"limits.tau.factor": {"from": 0.5, "to": 1.0}}},
    }  # fmt: skip
    assert tomllib.loads(as_toml(entries)) == entries


def test_a_playback_shows_the_arm_at_its_times() -> None:
    t, q = np.linspace(0.0, 2.0, 5), np.random.default_rng(1).uniform(0.1, 0.9, (5, 3))
    corners = skeleton(cylindrical(), q)
    drawing = playback(t, corners, [Ball([5.0, 0.0, 0.0], 0.5)], np.array([[0.1, 0.2, 0.3]]))
    for k, frame in enumerate(drawing.frames):
        pose = np.array([frame.data[0][axis] for axis in "xyz"]).T
        np.testing.assert_allclose(pose, corners[k], atol=1e-5)
    names = [trace.name for trace in drawing.data]
    assert {"arm", "path of the tool", "start", "goal", "via points", "Ball (obstacle)"} <= set(names)
    assert [step.label for step in drawing.layout.sliders[0].steps] == [f"{time:.3f}" for time in t]


def test_curves_shade_the_times_at_a_limit() -> None:
    t = np.linspace(0.0, 1.0, 101)
    values = np.clip(np.sin(2.0 * np.pi * t) * 2.0, -1.0, 1.0)
    panel = Panel("u [N]", t, {"": values}, np.full(101, -1.0), np.full(101, 1.0))
    drawing = time_curves([[panel, panel], [panel]])
    rectangles = [shape for shape in drawing.layout.shapes if shape.type == "rect"]
    assert len(rectangles) == 6
    edge = np.arcsin(0.5) / (2.0 * np.pi)
    upper = min(rectangles, key=lambda shape: shape.x0)
    assert (upper.x0, upper.x1) == pytest.approx((edge, 0.5 - edge), abs=0.01)
    assert sum(shape.name == "cursor" for shape in drawing.layout.shapes) == 2
    assert intervals(t[:6], np.array([True, True, False, True, False, True])) == [(0.0, 0.01)]


def test_torques_of_the_motion_have_a_report(motion: Path, tmp_path: Path) -> None:
    scene = ROOT / "scripts" / "scenes" / "cylindrical.toml"
    arguments = [str(motion.with_suffix(".npz")), str(scene), "--limit", "100", "1100", "400", "--report", "--quiet"]
    assert torques.main([*arguments, "--output", str(tmp_path)]) == 1
    text = text_of(tmp_path / "torques.html")
    assert "limits are exceeded: tau_phi" in text
    assert "Torque over speed" in text
    assert (tmp_path / "torques.html").stat().st_size < LARGEST


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "lift.toml").write_text(STUDY, encoding="utf-8")
    assert study.main([str(folder / "lift.toml"), "--report", "--quiet", "--output", str(folder)]) == 1
    return folder / "lift.html"


def test_a_study_shows_failures_and_the_motion_of_every_case(studied: Path) -> None:
    text = text_of(studied)
    assert "6 cases, 4 solved, 2 failed" in text
    assert text.count("cannot hold the start") >= 2
    motions = json.loads(re.search(r"window\.motions = (.*?);</script>", text).group(1))  # type: ignore[union-attr]
    assert sorted(motions) == ["1", "2", "4", "5"]
    first = np.array(motions["1"]["poses"])
    wanted = skeleton(cylindrical(), np.array([[0.0, 0.2, 0.6], [1.0, 0.5, 0.7]]))
    np.testing.assert_allclose(first[[0, -1]].transpose(0, 2, 1), wanted, atol=2e-3)
    assert tomllib.loads(STUDY) == tomllib.loads(
        re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)[-1].replace("&quot;", '"')
    )


@pytest.mark.slow
def test_an_accuracy_bill_has_a_report(tmp_path: Path) -> None:
    arguments = [
        "--parts",
        "control",
        "--grids",
        "6",
        "12",
        "--methods",
        "uniform",
        "--repeats",
        "1",
        "--forms",
        "canonical",
    ]
    assert accuracy.main([*arguments, "--quiet", "--report", "--output", str(tmp_path)]) == 0
    assert "Seconds to an error" in text_of(tmp_path / "accuracy.html")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright: pip install playwright")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    flags = ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--ignore-gpu-blocklist"]
    with playwright.sync_playwright() as driver:
        window = driver.chromium.launch(executable_path=chromium, args=flags)
        yield window
        window.close()


def opened(browser: Any, path: Path) -> tuple[Any, list[str]]:
    """Return a page without network, and what it complained about or asked for, which goes on growing."""
    context = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True)
    window, said = context.new_page(), []
    window.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
    window.on("pageerror", lambda error: said.append(str(error)))
    window.on("request", lambda asked: said.append(asked.url) if asked.url.startswith("http") else None)
    window.goto(f"file://{path}", timeout=180_000)
    window.set_default_timeout(60_000)
    return window, said


@pytest.mark.slow
def test_the_slider_moves_the_arm_and_the_cursor_in_a_browser(browser: Any, motion: Path) -> None:
    window, said = opened(browser, motion)
    window.wait_for_function("document.getElementById('arm')._transitionData._frames.length === 81")
    rail = window.locator("#arm .slider-rail-touch-rect").bounding_box()
    window.mouse.click(rail["x"] + 0.75 * rail["width"], rail["y"] + rail["height"] / 2.0)
    cursor = "document.getElementById('curves').layout.shapes.filter(s => s.name === 'cursor').map(s => s.x0)"
    window.wait_for_function(f"({cursor})[0] > 0")
    at = window.evaluate(cursor)
    solution = load(motion.with_suffix(".npz"))
    scene, _ = task_file.load(ROOT / "scripts" / "scenes" / "cylindrical.toml")
    assert at[0] == pytest.approx(0.75 * solution.duration, rel=0.05)
    assert len(set(at)) == 1
    pose = np.array([window.evaluate(f"document.getElementById('arm').data[0].{axis}") for axis in "xyz"]).T
    np.testing.assert_allclose(pose, skeleton(scene.machine, solution.x(at[0])[None, :3])[0], atol=1e-3)
    # The verdict is green or red, and the path of the tool is there in its colour.
    window.wait_for_timeout(500)
    image = tmp_image(window)
    assert np.sum(np.all(np.abs(image - [217, 140, 31]) < 40, axis=2)) > 100
    # A click on a curve moves the arm there.
    window.locator("#curves").scroll_into_view_if_needed()
    panel = window.locator("#curves .nsewdrag").first.bounding_box()
    place = panel["x"] + 0.2 * panel["width"], panel["y"] + panel["height"] / 2.0
    window.mouse.move(place[0] - 5.0, place[1])
    window.mouse.move(*place)
    window.locator("#curves .hoverlayer .legend, #curves .hoverlayer .hovertext").first.wait_for()
    window.mouse.click(*place)
    window.wait_for_function(f"({cursor})[0] < {0.5 * solution.duration}")
    assert said == []


@pytest.mark.slow
def test_a_click_on_a_case_shows_its_motion_in_a_browser(browser: Any, studied: Path) -> None:
    window, said = opened(browser, studied)
    window.wait_for_function("document.getElementById('case').textContent.startsWith('case 1')")
    window.locator("tr[data-case='5']").click()
    window.wait_for_function("document.getElementById('case').textContent.startsWith('case 5')")
    wanted = window.evaluate("window.motions['5'].poses[0]")
    window.wait_for_function("document.getElementById('arm').data[1].x.length === window.motions['5'].poses.length")
    shown = [window.evaluate(f"Array.from(document.getElementById('arm').data[0].{axis})") for axis in "xyz"]
    np.testing.assert_allclose(shown, wanted)
    assert said == []


def tmp_image(window: Any) -> np.ndarray:
    """Return what the browser shows as an image (rows, columns, 3), 0 to 255."""
    import io

    from matplotlib import image

    return 255.0 * image.imread(io.BytesIO(window.screenshot()), format="png")[:, :, :3]
