"""Studies of scene files from the shell."""

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import study as command
import time_optimal
from reports import study_file
from reports.progress import lines_of, progress_of

from models.scenes.task_file import of_text
from models.scenes.toml_document import SceneError, parse
from ocp import Study

ROOT = Path(__file__).parents[2]
SCENE = """
machine = "cylindrical"
[effects.gravity]
[effects.payload]
mass = 1.0
[limits]
tau = [160.0, 1100.0, 320.0]
[task]
from = [0.0, 0.2, 0.6]
to = [1.0, 0.5, 0.7]
elements = 12
[study]
checked = 0.0
[study.over]
"""
AXES = '"payload.mass" = [0.0, 2.0]\n"limits.tau.factor" = { from = 0.9, to = 1.1, count = 3 }\n'


def write(tmp_path, axes=AXES, scene=SCENE, name="s.toml"):
    path = tmp_path / name
    path.write_text(scene + axes)
    return path


def call(tmp_path, *options, path=None):
    given = [str(path or write(tmp_path)), "--output", str(tmp_path / "out"), "--quiet", *options]
    return command.main(given)


def test_a_study_is_computed_drawn_and_resumed(tmp_path, capsys):
    assert call(tmp_path, "--dry-run") == 0
    assert "6 cases: 0 stored, 0 failed, 6 to compute" in capsys.readouterr().out
    assert call(tmp_path, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["cases"] == printed["solved"] == 6
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"s.csv", "s_contours.png", "s_ranking.png"}
    with (tmp_path / "out" / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["payload.mass [kg]"] for row in rows] == ["0.0"] * 3 + ["2.0"] * 3
    durations = [float(row["duration [s]"]) for row in rows]
    assert durations[0] > durations[1] > durations[2]
    assert all(light <= heavy for light, heavy in zip(durations[:3], durations[3:], strict=True))
    assert call(tmp_path, "--resume") == 0
    assert call(tmp_path, "--dry-run") == 0
    assert "6 stored, 0 failed, 0 to compute" in capsys.readouterr().out


def test_resume_refuses_other_settings(tmp_path, capsys):
    assert call(tmp_path, "--resume") == 2
    assert "holds no case of this study" in capsys.readouterr().err
    assert call(tmp_path) == 0
    other = write(tmp_path, scene=SCENE.replace("elements = 12", "elements = 13"))
    assert call(tmp_path, "--resume", path=other) == 2


def test_failures_leave_gaps_and_an_exit_status(tmp_path, capsys):
    path = write(tmp_path, '"payload.mass" = [0.0, 1.0, 3000.0]\n')
    assert command.main([str(path), "--output", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr()
    assert "2 solved" in printed.out
    assert "case 2 {'payload.mass': 3000.0}" in printed.out
    assert (tmp_path / "out" / "s_lines.png").exists()
    with (tmp_path / "out" / "s.csv").open(newline="") as file:
        assert [row["duration [s]"] == "nan" for row in csv.DictReader(file)] == [False, False, True]


@pytest.mark.slow
def test_three_axes_texts_and_samples(tmp_path):
    three = '"payload.mass" = [0.0, 2.0]\n"limits.tau.factor" = [1.0, 1.1]\n"task.to.1" = [0.9, 1.0]\n'
    assert call(tmp_path, path=write(tmp_path, three, name="three.toml")) == 0
    assert (tmp_path / "out" / "three_multiples.png").exists()
    forms = '"form" = ["canonical", "hamel"]\n"parameters.m_3" = [18.0, 20.0]\n'
    assert call(tmp_path, path=write(tmp_path, forms, name="forms.toml")) == 0
    with (tmp_path / "out" / "forms.csv").open(newline="") as file:
        results = {(row["form"], row["m_3 [kg]"]): float(row["duration [s]"]) for row in csv.DictReader(file)}
    assert results["canonical", "18.0"] == pytest.approx(results["hamel", "18.0"], rel=1e-4)
    pytest.importorskip("scipy", reason="SciPy is not installed (extra study)")
    sampled = (
        SCENE.replace("[study]", '[study]\ndesign = "sobol"\ncount = 4')
        + '"payload.mass" = [0.0, 2.0]\nm_3 = [15, 20]\n'
    )
    path = tmp_path / "sobol.toml"
    path.write_text(sampled)
    assert call(tmp_path, path=path) == 0
    assert (tmp_path / "out" / "sobol_scatter.png").exists()


def test_numbers_of_the_graph_stay_symbols_and_share_one_system():
    study = study_file.of_document(parse(SCENE + AXES, "s.toml"), None)
    assert study.function.symbols == ("payload.mass",)
    assert study.function.others == ("limits.tau.factor",)
    one, other = (study.function(limits_tau_factor=f) for f in (0.9, 1.1))
    assert one.system is other.system
    assert list(one.system.nominal) == ["payload.mass"]
    units = study_file.units(study)
    assert units["payload.mass"] == "kg"
    assert units["peak tau_xi"] == "N"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SCENE.partition("[study]")[0], "'study' is missing"),
        (SCENE, "is empty"),
        (SCENE + '"payload.weight" = [1.0]\n', "weight"),
        (SCENE + '"viscous.c" = [1.0]\n', "effect 'viscous' is off"),
        (SCENE + '"m_9" = [1.0]\n', "'m_9' is no key of this scene"),
        (SCENE + '"payload.mass" = 3\n', "expected a list"),
        (SCENE + '"payload.mass" = []\n', "at least one value"),
        (SCENE + '"payload.mass" = [-1.0]\n', "payload.mass"),
        (SCENE + '"payload.mass" = { from = 0, to = 1, count = 0 }\n', "count.*>= 1"),
        (SCENE + '"payload.mass" = { from = 0, to = 1, count = 3, spacing = "log" }\n', "log needs two numbers"),
        (SCENE + '"limits.tau.7" = [1.0]\n', "no component '7'"),
        (SCENE + '"limits.v.factor" = [1.0]\n', "no 'v' to multiply"),
        (SCENE + '"machine.factor" = [1.0]\n', "expected numbers to multiply"),
        (SCENE.replace("checked = 0.0", 'design = "grid"') + AXES, "design"),
        (SCENE.replace("checked = 0.0", "seed = 1") + AXES, "seed"),
        (SCENE.replace("checked = 0.0", "polished = 1") + AXES, "true or false"),
    ],
)
def test_a_wrong_file_is_refused_with_its_key(text, words):
    with pytest.raises(SceneError, match=words) as caught:
        study_file.of_document(parse(text, "s.toml"), None)
    assert "s.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_study_is_a_scene_for_the_other_commands(tmp_path, capsys):
    _, task = of_text(SCENE + AXES, "s.toml")
    assert task.elements == 12
    assert time_optimal.main([str(write(tmp_path)), "--card"]) == 0
    assert "payload" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["study", "time_optimal", "torques", "accuracy", "benchmark", "stability", "hamel"])
def test_a_command_ends_quietly_whatever_reads_its_output_and_draws_its_pictures(name):
    given = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "module://not_installed_here.backend"}
    reader, writer = os.pipe()
    os.close(reader)  # as of `| head -0`
    run = [sys.executable, str(ROOT / "scripts" / f"{name}.py"), "--help"]
    done = subprocess.run(run, stdout=writer, stderr=subprocess.PIPE, text=True, env=given, check=False)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode in (0, 141)  # argparse itself ends quietly, with 0


def test_progress_is_a_line_every_few_seconds_without_tqdm(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    with progress_of(3, True) as watch:
        Study(lambda x: 1.0 / x, over={"x": [1.0, 0.0, 2.0]}).run(watch=watch)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "study: 0 of 3 cases"
    assert re.fullmatch(r"study: 3 of 3 cases, 1 failed, \S+ s for a case, about 0 s left", lines[-1])
    every = lines_of(0.0)
    Study(lambda x: x, over={"x": range(4)}).run(watch=every)
    assert len(capsys.readouterr().err.splitlines()) == 5
    with progress_of(3, False) as watch:
        assert watch is None


def test_wrong_options(tmp_path, capsys):
    assert call(tmp_path, "--executor", "threads") == 2
    assert "expected one of here, processes" in capsys.readouterr().err
    assert call(tmp_path, "--result", "time") == 2
    assert "no column 'time'" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_runs_in_two_processes(tmp_path):
    path = write(tmp_path)
    run = [
        sys.executable,
        str(ROOT / "scripts" / "study.py"),
        str(path),
        "--jobs",
        "2",
        "--output",
        str(tmp_path / "out"),
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    results = subprocess.run(run, capture_output=True, text=True, env=environment, check=True)
    assert "6 cases: 6 solved" in results.stdout
    assert "what duration depends on" in results.stdout
