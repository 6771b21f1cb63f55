"""Templates of all machines: words for every number, axes of every coordinate, a scene file that is read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import time_optimal
from reports.arm_template import template

from models.scenes import catalogue, task_file
from models.scenes.robot_entry import shipped
from models.scenes.scene_template import TASKS

ROOT = Path(__file__).parents[2]
URDF = """<robot name="crane"><link name="base"/>
<link name="mast"><inertial><origin xyz="0 0 0.5"/><mass value="4"/>
<inertia ixx="0.1" iyy="0.1" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="trolley"><inertial><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="mast"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1.5" effort="40"/></joint>
<joint name="run" type="prismatic"><parent link="mast"/><child link="trolley"/>
<origin xyz="0 0 1.2"/><axis xyz="1 0 0"/>
<limit lower="0.2" upper="1.0" velocity="0" effort="0"/></joint></robot>"""


@pytest.mark.parametrize("name", TASKS)
def test_every_parameter_of_a_machine_is_explained_in_words(name: str) -> None:
    inside = template(name).partition("[parameters]")[2].partition("# Effects:")[0].splitlines()[1:]
    explained = [line.partition("#")[2] if not line.startswith("# ") else line[2:] for line in inside if line]
    assert len(explained) == len(catalogue.machines()[name]().nominal)
    for text in explained:
        assert len(text.partition(";")[2].split()) >= 3, text
    assert template(name).count("; 0: ") == len(catalogue.machines()[name]().coordinates)


@pytest.mark.parametrize("name", shipped())
def test_the_template_of_a_robot_is_a_scene_of_it(name: str) -> None:
    text = template(name)
    scene, task = task_file.of_text(text, "arm.toml")
    assert scene.machine.name == shipped()[name]().name
    for coordinate in scene.machine.coordinates:
        assert f"#   {coordinate.name} [{coordinate.unit}] " in text
    assert task.problem(scene.system).subject_to


def test_axes_and_the_tool_at_zero_are_those_of_the_data() -> None:
    text = template("ur5")
    assert "#   shoulder_pan_joint [rad] turns about e_3 through (0, 0, 0.089) m" in text
    assert "#   wrist_2_joint [rad] turns about -e_3" in text
    tool = np.array([0.81725, 0.19145, -0.005491])  # of the UR5, all joints at 0: its description in ROS
    shown = text.partition("the tool is at (")[2].partition(")")[0]
    np.testing.assert_allclose([float(x) for x in shown.split(",")], tool, atol=1e-3)


def test_a_urdf_file_has_a_template(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane.urdf").write_text(URDF, encoding="utf-8")
    text = template("crane.urdf")
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    scene, _ = task_file.load(tmp_path / "arm.toml")
    assert [c.name for c in scene.machine.coordinates] == ["turn", "run"]
    assert "#   turn [rad] turns about e_3" in text
    assert "#   run [m] moves along e_1" in text
    assert "from = [0.0, 0.6]" in text
    assert "turn 4 kg" in text
    assert "tau = [40.0, 100.0]  # N m, N; 100 where nothing is stated" in text


def test_a_machine_of_ones_own_has_a_template(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(ROOT / "docs" / "tutorials" / "scara.py")
    try:
        assert time_optimal.main(["--with", file, "--template", "scara"]) == 0
        text = capsys.readouterr().out
        assert "L_1 = 0.4" in text
        assert "lengths of the two links" in text
        assert "#   spindle [m] moves along -e_3" in text
        scene, _ = task_file.of_text(text, "arm.toml")
        assert scene.machine.name == "scara"
    finally:
        catalogue._included.clear()


def test_names_of_other_alphabets_are_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "kran.py").write_text(
        "from models import Joint, Link, Manipulator, serial\n"
        "def kränchen(*, länge: float = 0.5) -> Manipulator:\n"
        "    link = Link(2.0, (0.1, 0.0, 0.0), (0.01, 0.05, 0.05))\n"
        "    return serial([Joint('größe', link=link)], tool=(länge, 0.0, 0.0), name='Müller')\n",
        encoding="utf-8",
    )
    try:
        assert time_optimal.main(["--with", str(tmp_path / "kran.py"), "--template", "kränchen"]) == 0
        scene, _ = task_file.of_text(capsys.readouterr().out.replace("0.5 ", "0.7 "), "arm.toml")
        assert [c.name for c in scene.machine.coordinates] == ["größe"]
    finally:
        catalogue._included.clear()


def test_an_unknown_machine_has_no_template(capsys: pytest.CaptureFixture[str]) -> None:
    assert time_optimal.main(["--template", "ur6"]) == 2
    said = capsys.readouterr().err
    assert "no machine 'ur6', expected one of cylindrical, spherical, torus" in said
    assert "ur5" in said
    assert said.count("\n") == 1
