"""What would spoil the files of a command is noticed before its work; each failure has one cause and one remedy."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import accuracy
import pytest
import study
import time_optimal
import torques
from reports import output
from reports.command import exit_with
from reports.verdict import diagnosis

ROOT = Path(__file__).parents[2]
STUDY = """
machine = "cylindrical"
[limits]
tau = [150.0, 1000.0, 300.0]
[task]
from = [0.0, 0.2, 0.6]
to = [1.0, 0.5, 0.7]
[study.over]
"limits.tau.factor" = [1.0, 1.2]
"""
MOTION = "t,q1,q2,q3\n0,0,0.2,0.6\n1,0.5,0.2,0.6\n2,1,0.2,0.6\n3,1.5,0.2,0.6\n4,2,0.2,0.6\n"
WORK = {time_optimal: "find", study: "_run", accuracy: "bill", torques: "read_motion"}


def called(command: Any, folder: Path, *options: str) -> int:
    """Return the exit status of a command with files of its own."""
    (folder / "s.toml").write_text(STUDY, encoding="utf-8")
    (folder / "m.csv").write_text(MOTION, encoding="utf-8")
    files = {time_optimal: [], accuracy: [], study: ["s.toml"], torques: ["m.csv", "--machine", "cylindrical"]}[command]
    try:
        status: int = command.main([*(str(folder / f) if "." in f else f for f in files), *options])
    except SystemExit as ended:
        return int(ended.code or 0)
    return status


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every command fail that begins its work."""

    def begun(*_: object, **__: object) -> None:
        raise AssertionError("the work has begun")

    for command, name in WORK.items():
        monkeypatch.setattr(command, name, begun)
    monkeypatch.setattr(time_optimal.budget, "effect_budget", begun)


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("command", WORK, ids=lambda command: command.__name__)
def test_files_that_cannot_be_written_are_noticed_before_the_work(
    command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken").write_text("", encoding="utf-8")
    assert called(command, tmp_path, "--output", str(tmp_path / "taken")) == 2
    assert "taken is a file, expected a folder" in capsys.readouterr().err
    monkeypatch.setattr(output, "find_spec", lambda _: None)
    assert called(command, tmp_path, "--report", "--output", str(tmp_path)) == 2
    assert "a report needs Plotly: pip install plotly" in capsys.readouterr().err

    def full(**_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    assert called(command, tmp_path, "--output", str(tmp_path)) == 2
    assert "No space left" in capsys.readouterr().err


@pytest.mark.usefixtures("idle")
def test_a_budget_looks_for_plotly_before_it_solves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(output, "find_spec", lambda _: None)
    assert called(time_optimal, tmp_path, "--budget", "--report", "--output", str(tmp_path)) == 2
    assert "needs Plotly" in capsys.readouterr().err


@pytest.mark.usefixtures("idle")
def test_a_study_looks_at_its_exports_before_it_solves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file, words in (("table.xls", ".csv or .parquet"), ("nowhere/table.csv", "no folder")):
        assert called(study, tmp_path, "--output", str(tmp_path), "--export", str(tmp_path / file)) == 2
        assert words in capsys.readouterr().err


PAGE = (ROOT / "docs" / "failures.md").read_text(encoding="utf-8")
MESSAGES = [" ".join(line[2:] for line in text.split("\n") if line) for text in re.findall(r"\n((?:> .*\n)+)", PAGE)]


@pytest.mark.parametrize(
    ("number", "cause", "remedy"),
    [
        (0, "tau_xi cannot hold the start: 637.7 N are needed at rest, the limit is 600",
         "raise the limit above 637.7 N or move the start"),
        (2, "r is 0.5 m at the start, below its limit of 0.6 by 0.1 m", "move the start inside or widen the limit"),
        (6, "the start is singular: the frame 'paper' of the spherical manipulator is singular where sin(theta) is 0",
         "use frame='regular' (met at theta = 0)"),
        (8, "the iterates diverge: the cost or the motion has no bound", "try an upper limit of the duration, "
         "Free(guess, upper=...), limits on the states, or a cost bounded below"),
        (10, "the shortest motion found within these limits takes 0.682 s, 0.5 s were asked",
         "try a longer duration: with Free() and minimise time the same limits show the shortest one"),
    ],
)  # fmt: skip
def test_of_all_that_is_wrong_one_cause_and_one_remedy_are_said(number: int, cause: str, remedy: str) -> None:
    assert diagnosis(MESSAGES[number]) == (cause, remedy)


def test_the_console_command_needs_no_general_names(tmp_path: Path) -> None:
    """As an installation calls it: from elsewhere, with nothing but the root on the search path."""
    code = (
        "import importlib.util as u, sys; sys.argv = ['hamel', 'card', '--machine', 'torus'];"
        f"spec = u.spec_from_file_location('console', {str(ROOT / 'scripts' / 'console.py')!r});"
        "module = u.module_from_spec(spec); spec.loader.exec_module(module); module.run()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)}
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("scene         torus manipulator")


def test_a_python_without_casadi_is_told_how_to_get_it() -> None:
    command = [sys.executable, "-S", str(ROOT / "scripts" / "torques.py"), "motion.csv"]  # -S: no installed packages
    result = subprocess.run(command, capture_output=True, text=True, env={}, check=False)
    assert result.returncode == 1
    assert result.stderr.startswith(f"torques.py: CasADi is not installed for {sys.executable}")
    assert result.stderr.count("\n") == 1


def test_an_interrupted_command_ends_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as ended:
        exit_with(interrupted)
    assert ended.value.code == 130
    assert capsys.readouterr().err == "\ninterrupted; nothing more is written\n"
