"""Scene files with robots: shipped ones, URDF files beside the scene, their limits; what is refused."""

import numpy as np
import pytest

from models.scenes.robot_entry import shipped
from models.scenes.task_file import load
from models.scenes.toml_document import SceneError

URDF = """<robot name="two"><link name="base"/>
<link name="a"><inertial><mass value="3"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="3" effort="20"/></joint>
<joint name="lift" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="2" effort="15"/></joint></robot>"""
SCENE = """machine = {{ {machine} }}
[effects.gravity]
g = 9.81
[limits]
{limits}
[task]
from = {begin}
to = {finish}
elements = 12
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "two.urdf").write_text(URDF)

    def write(machine='urdf = "two.urdf", tip = "b"', limits="machine = true", begin="[0.0, 0.0]", finish="[1.0, 0.5]"):
        path = tmp_path / "two.toml"
        path.write_text(SCENE.format(machine=machine, limits=limits, begin=begin, finish=finish))
        return path

    return write


def test_a_urdf_file_beside_the_scene(scene):
    loaded, task = load(scene())
    assert loaded.machine.name == "two"
    assert loaded.frame_name == "coordinate"
    limits = {one.signal: (one.lower, one.upper) for one in task.limits}
    assert limits["v"] == ((-3.0, -2.0), (3.0, 2.0))
    assert limits["tau"] == ((-20.0, -15.0), (20.0, 15.0))
    assert "turn" in loaded.card()


def test_limits_of_the_scene_come_before_those_of_the_robot(scene):
    _, task = load(scene(limits="machine = true\ntau = { turn = 5.0 }"))
    limits = {one.signal: one.upper for one in task.limits}
    assert limits["tau"] == (5.0, np.inf)
    assert limits["v"] == (3.0, 2.0)
    _, without = load(scene(limits="tau = [5.0, 5.0]"))
    assert [one.signal for one in without.limits] == ["tau"]


@pytest.mark.parametrize("name", sorted(shipped()))
def test_every_shipped_robot(scene, name):
    n = len(shipped()[name]().coordinates)
    lower, upper = (np.array(side) for side in shipped()[name]().limits["q"])
    middle = ((np.maximum(lower, -3) + np.minimum(upper, 3)) / 2).tolist()
    loaded, task = load(scene(f'robot = "{name}"', begin=middle, finish=middle))
    assert loaded.system["q"].numel() == n
    assert task.problem(loaded.system)


@pytest.mark.parametrize(
    ("machine", "limits", "words"),
    [
        ('robot = "pandas"', "machine = true", "panda"),
        ('urdf = "none.urdf"', "machine = true", "there is no such file"),
        ('urdf = "two.urdf", tip = "hand"', "machine = true", "there is no link 'hand'"),
        ('urdf = "two.urdf", python = "x"', "machine = true", "python"),
        ('python = "os.system"', "machine = true", "python"),
        ('robot = "panda", urdf = "two.urdf"', "machine = true", "urdf"),
        ("urdf = 3", "machine = true", "expected a path"),
        ('urdf = "two.urdf", lock = { lift = "a" }', "machine = true", "lock"),
        ('urdf = "two.urdf", lock = { elbow = 0.0 }', "machine = true", "no joint 'elbow'"),
        ('tip = "b"', "machine = true", "the key 'urdf' or 'robot' is missing"),
        ('urdf = "two.urdf"', "machine = 1", "expected true or false"),
    ],
)
def test_wrong_entries_get_one_sentence(scene, machine, limits, words):
    with pytest.raises(SceneError) as caught:
        load(scene(machine, limits))
    message = str(caught.value)
    assert words in message
    assert "two.toml" in message
    assert "\n" not in message


def test_limits_of_a_machine_without_any(scene, tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text('machine = "spherical"\n[limits]\nmachine = true\n[task]\nfrom = [1, 0, 0, 1]\nto = [1, 1, 0, 1]\n')
    with pytest.raises(SceneError, match="spherical states no limits"):
        load(path)
