"""One entry for all commands, files of the user's own, the default folder, elapsed time, verdicts."""

from __future__ import annotations

import argparse
import io
import os
import re
import runpy
import sys
import time
from dataclasses import replace
from pathlib import Path

import hamel
import matplotlib
import matplotlib.pyplot as plt
import pytest
import time_optimal
from reports import output
from reports.output import add_output, output_folder, working
from reports.verdict import verdict

from models import cylindrical, robots
from models.effects import Gravity
from models.forms import canonical
from models.scenes import catalogue
from ocp import Ipopt, Smooth, Status, point_to_point, polish, prepare, solve, uniform, verify

ROOT = Path(__file__).parents[2]
SCARA = ROOT / "docs" / "tutorials" / "scara.py"
PAGES = sorted([*(ROOT / "docs" / "gallery").glob("*.py"), *(ROOT / "docs" / "tutorials").glob("plot_*.py")])


@pytest.fixture(autouse=True)
def _forgotten():
    yield
    catalogue._included.clear()
    sys.modules.pop("scara", None)
    plt.close("all")


def options(*arguments: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_output(parser, "files")
    return parser.parse_args(arguments)


def test_every_command_has_help(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["hamel.py"])
    for name in hamel.COMMANDS:
        with pytest.raises(SystemExit) as ended:
            hamel.main([name, "--help"])
        assert ended.value.code == 0
        shown = capsys.readouterr().out
        assert "usage:" in shown
        assert "xample" in shown
    assert hamel.main(["--help"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in hamel.COMMANDS)
    assert hamel.main([]) == 2
    assert hamel.main(["fly"]) == 2
    assert "no command 'fly'; there are time-optimal" in capsys.readouterr().err
    assert hamel.main(["torque"]) == 2
    assert capsys.readouterr().err.endswith("did you mean torques?\n")
    for name, wrong, right in (("time-optimal", "--polsh", "--polish"), ("study", "--resum", "--resume")):
        with pytest.raises(SystemExit) as ended:
            hamel.main([name, *(["s.toml"] if name == "study" else []), f"{wrong}x"])
        assert ended.value.code == 2
        said = capsys.readouterr().err
        assert f"unrecognized arguments: {wrong}x; did you mean {right}?" in said
        assert said.count("\n") == 1


def test_commands_stand_for_their_arguments(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["hamel.py"])
    assert hamel.main(["template", "torus"]) == 0
    template = capsys.readouterr().out
    assert template.startswith("# A scene of the torus manipulator")
    assert hamel.main(["card", "--machine", "torus"]) == 0
    assert "torus manipulator, canonical form" in capsys.readouterr().out


def test_a_machine_of_ones_own_reaches_a_scene_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = str(SCARA.with_name("scara.toml"))
    assert time_optimal.main([scene, "--card"]) == 2
    assert "no choice 'scara'" in capsys.readouterr().err
    assert time_optimal.main([scene, "--with", str(SCARA), "--card"]) == 0
    card = capsys.readouterr().out
    assert "shoulder [rad], elbow [rad], spindle [m]" in card
    assert "hose_spring (stiffness 6)" in card
    assert time_optimal.main([scene, "--with", str(SCARA), "--quiet", "--output", str(tmp_path)]) == 0
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".npz", ".png"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read, expected a Python file"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("x = 1\n", "has no machine"),
        ("def torus(*, a: float = 1.0) -> 'Manipulator': ...\n", "torus is the name of a machine"),
        ("def arm(a) -> 'Manipulator': ...\n", "has no machine"),
    ],
)
def test_files_that_bring_nothing_are_told(
    text: str | None, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    assert time_optimal.main(["--with", str(path), "--card"]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_files_in_the_default_folder_are_replaced_only_if_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert output_folder(options(), "arm") == Path("results")
    (tmp_path / "results" / "other.csv").touch()
    assert output_folder(options(), "arm").is_dir()
    (tmp_path / "results" / "arm.csv").write_text("old")
    with pytest.raises(FileExistsError, match=r"results/arm.csv would be replaced; use --force, or --output DIR"):
        output_folder(options(), "arm")
    assert output_folder(options("--force"), "arm").is_dir()
    assert output_folder(options("--output", "results"), "arm").is_dir()
    assert time_optimal.main(["--nodes", "5", "--quiet"]) in (0, 1)
    assert time_optimal.main(["--nodes", "5", "--quiet"]) == 2
    assert "would be replaced; use --force" in capsys.readouterr().err

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for typed, agreed in (("y\n", True), ("\n", False), ("no\n", False)):
        monkeypatch.setattr(sys, "stdin", Terminal(typed))
        monkeypatch.setattr(sys, "stderr", Terminal())
        if agreed:
            assert output_folder(options(), "arm").is_dir()
        else:
            with pytest.raises(FileExistsError):
                output_folder(options(), "arm")


def test_elapsed_time_is_shown_for_long_work_only(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(output, "PATIENCE", 60.0)
    with working("short"):
        pass
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(output, "PATIENCE", 0.0)
    with working("long"):
        while "long ..." not in capsys.readouterr().err:  # as long as it takes
            time.sleep(0.01)
    assert "long: " in capsys.readouterr().err
    with pytest.raises(ZeroDivisionError), working("breaks", False):
        1 / 0  # noqa: B018


def test_verdicts_name_one_cause_and_one_remedy() -> None:
    arm = canonical(cylindrical(), [Gravity()])
    ends, limit = ([0.0, 0.2, 0.6], [2.0, 0.8, 0.8]), [150.0, 1000.0, 300.0]
    fine = polish(solve(point_to_point(arm, *ends, tau=limit, q=([-9.0, 0.0, 0.1], [9.0, 1.2, 2.0])), grid=uniform(40)))
    good = verdict(fine, verify(fine), 0.0)
    assert good.ok == verify(fine).ok
    coarse = solve(point_to_point(arm, *ends, tau=limit), grid=uniform(3))
    bad = verdict(coarse, verify(coarse), 0.0)
    assert not bad.ok
    assert "drifts away" in bad.cause
    assert str(bad).startswith("NOT VERIFIED: ")
    count = int(re.match(r"--nodes (\d+)", bad.remedy)[1])  # type: ignore[index]
    assert count > 3
    assert "--accuracy" in bad.remedy
    finer = solve(point_to_point(arm, *ends, tau=limit), grid=uniform(count))
    assert not any("drifts away" in words for words in verify(finer).failures)
    weak = solve(point_to_point(arm, *ends, tau=[150.0, 600.0, 300.0]), grid=uniform(8))
    failed = verdict(weak, verify(weak), 0.0)
    assert failed.cause == "tau_xi cannot hold the start: 637.7 N are needed at rest, the limit is 600"
    assert failed.remedy == "raise the limit above 637.7 N or move the start"
    report = verify(fine)
    if report.ok:
        assert "torques differ" in verdict(fine, report, 1e-3).cause
        assert not verdict(replace(fine, status=weak.status), report, 0.0).ok


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_a_page_of_the_gallery_or_a_tutorial_runs(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    matplotlib.use("Agg")
    monkeypatch.syspath_prepend(path.parent)
    monkeypatch.chdir(os.fspath(path.parent))
    runpy.run_path(str(path))
    assert "np.float64" not in capsys.readouterr().out
    assert plt.get_fignums()


def test_arms_with_limits_of_speed_are_sent_to_accelerations_as_controls() -> None:
    machine = robots.ur5()
    arm = canonical(machine, [Gravity()])
    ends = [0.0, -1.0, 1.0, 0.0, 0.5, 0.0], [1.0, -0.5, 0.5, 0.5, 0.0, 0.5]
    for limits, advised in ((machine.limits, True), ({"tau": machine.limits["tau"]}, False)):
        problem = point_to_point(arm, *ends, limits=limits)
        poor = prepare(problem, grid=uniform(4), solver=Ipopt(progress=False, max_iter=2))((Smooth(),))
        poor = replace(poor, status=Status.SOLVED)
        bad = verdict(poor, verify(poor), 0.0)
        assert "drifts away" in bad.cause
        assert ("--form inverse" in bad.remedy) == advised
