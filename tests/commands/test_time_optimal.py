"""The command `time_optimal.py`: files, figures, exit status and messages."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from ocp import load

ROOT = Path(__file__).parents[2]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "scripts" / "time_optimal.py"), *arguments]
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "MPLCONFIGDIR": tempfile.gettempdir()}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=ROOT)


def test_the_main_job(tmp_path: Path) -> None:
    done = run("--output", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    account = json.loads(done.stdout)
    assert account["verified"]
    assert account["drift"] < 1e-6
    assert account["torque_difference"] < 1e-8
    assert account["hamiltonian_value"] == pytest.approx(-1.0, abs=1e-6)
    with (tmp_path / "time_optimal.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header[:5] == ["t [s]", "theta [rad]", "psi [rad]", "phi [rad]", "r [m]"]
    assert header[-4:] == ["tau_theta [N m]", "tau_psi [N m]", "tau_phi [N m]", "tau_r [N]"]
    table = np.array(rows, dtype=float)
    assert table.shape == (150, 17)
    # Within the limits, and the columns are derivatives of each other where the motion is smooth.
    assert np.all(np.abs(table[:, -4:]) <= np.array([260.0, 160.0, 3.0, 400.0]) * (1.0 + 1e-9))
    solution = load(tmp_path / "time_optimal.npz")
    np.testing.assert_allclose(solution.x(table[:, 0])[:, :4], table[:, 1:5], atol=1e-9)
    picture = (tmp_path / "time_optimal.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 50_000
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"time_optimal.{kind}" for kind in ("csv", "npz", "png")
    ]


@pytest.mark.slow
@pytest.mark.parametrize("machine", ["cylindrical", "torus"])
@pytest.mark.parametrize(("form", "frame"), [("hamel", "paper"), ("lagrange", "ldl"), ("canonical", "udu")])
def test_other_machines_forms_and_frames(tmp_path: Path, machine: str, form: str, frame: str) -> None:
    arguments = ("--machine", machine, "--form", form, "--frame", frame, "--nodes", "40", "--output", str(tmp_path))
    done = run(*arguments, "--quiet")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


def test_no_solution_is_exit_1_and_a_sentence(tmp_path: Path) -> None:
    done = run("--machine", "cylindrical", "--limit", "150", "600", "300", "--nodes", "10", "--output", str(tmp_path))
    assert done.returncode == 1
    assert "tau_xi cannot hold the start" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--from", "1", "2"), "4 coordinates (theta, psi, phi, r)"),
        (("--limit", "1", "1", "-1", "1"), "limits > 0"),
        (("--frame", "arrow"), "it has paper, regular, coordinate, ldl, udu"),
        (("--nodes", "0"), "expected a whole number >= 1"),
        (("--machine", "scara"), "invalid choice"),
        (("--to", "a"), "invalid float"),
        (("--output", "/proc/nowhere"), "--output"),
    ],
)
def test_wrong_usage_is_exit_2(arguments: tuple[str, ...], words: str) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_starts_and_accuracy_and_what_counts_as_verified(tmp_path: Path) -> None:
    common = ("--machine", "torus", "--output", str(tmp_path), "--force")
    done = run(*common, "--starts", "2", "--accuracy", "1e-5")
    assert done.returncode == 0, done.stderr
    assert "local optima from 2 starts" in done.stdout
    assert "above this local optimum" in done.stdout
    account = done.stdout.split("t_f ")[1].split()[0]
    assert float(account) == pytest.approx(0.4505294013, abs=1e-5)  # of the polished motion
    strict = run(*common, "--allow", "switching=1e-5")
    assert strict.returncode == 1
    assert "--accuracy 1e-4" in strict.stdout
    wrong = run(*common, "--allow", "speed=1")
    assert wrong.returncode == 2
    assert "one of drift" in wrong.stderr


@pytest.mark.slow
def test_another_cost_than_time_is_named(tmp_path: Path) -> None:
    text = run("--template", "torus").stdout
    text = text.replace('minimise = "time"', "minimise = { squares = { tau = 1e-4 } }")
    text = text.replace("horizon = { guess = 1.0 }", "horizon = 1.0")
    scene = tmp_path / "effort.toml"
    scene.write_text(text, encoding="utf-8")
    done = run(str(scene), "--output", str(tmp_path / "out"))
    assert "in units of the cost above this local optimum" in done.stdout, done.stdout + done.stderr
    assert "constant along an optimal motion" in done.stdout
    assert "-1 is optimal" not in done.stdout
    assert " s above" not in done.stdout


@pytest.mark.slow
def test_drives_with_slack_take_the_least_effort(tmp_path: Path) -> None:
    found = []
    for options in ((), ("--gentle",)):
        path = tmp_path / str(len(options))
        done = run("--machine", "cylindrical", "--nodes", "30", "--output", str(path), *options)
        assert done.returncode == 0, done.stderr
        rows = np.loadtxt(path / "time_optimal.csv", delimiter=",", skiprows=1)
        header = (path / "time_optimal.csv").read_text(encoding="utf-8").partition("\n")[0].split(",")
        found.append((rows[-1, 0], np.mean(rows[:, header.index("tau_xi [N]")] ** 2)))
    (before, chatter), (after, least) = found
    assert after == pytest.approx(before, rel=2e-4)
    assert least < chatter
