"""Scene files that keep links clear and have goals of the tool: what is read, what is refused, what is kept."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.broken_scenes import SOUND_ARM

from models import inverse_kinematics, robots
from models.rigid_bodies import least_clearance
from models.rigid_bodies.orientations import rotation_matrix
from models.scenes import task_file
from models.scenes.toml_document import SceneError
from ocp import Ball, Cylinder, solve, uniform
from ocp.problem.boundary_states import ends

ROOT = Path(__file__).resolve().parents[2]
URDF = """<robot name="two"><link name="base"/>
<link name="a"><inertial><origin xyz="0.25 0 0"/><mass value="3"/><inertia ixx="0.01" iyy="0.1" izz="0.1"/></inertial>
<collision><origin xyz="0.25 0 0" rpy="0 1.5707963 0"/><geometry><cylinder radius="0.05" length="0.5"/></geometry>
</collision></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="2"/><inertia ixx="0.01" iyy="0.1" izz="0.1"/></inertial>
<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.06 0.06"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="3" effort="20"/></joint>
<joint name="bend" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2.8" upper="2.8" velocity="3" effort="15"/></joint></robot>"""
SCENE = """machine = { urdf = "two.urdf", tip = "b" }
[limits]
machine = true
[collisions]
clearance = 0.02
self = true
[task]
from = [0.0, 0.0]
to = [1.2, 0.3]
elements = 15
[[task.obstacles]]
name = "post"
shape = "ball"
centre = [0.75, 0.35, 0.0]
radius = 0.1
"""
SLIDES = """machine = "cylindrical"
[limits]
q = { lower = [-3.0, 0.0, 0.3], upper = [3.0, 1.2, 1.0] }
tau = [150.0, 1000.0, 300.0]
[collisions]
radius = 0.05
clearance = 0.03
[task]
from = [0.0, 0.2, 0.6]
to = [2.0, 0.8, 0.8]
[[task.obstacles]]
shape = "ball"
centre = [-0.5, 0.9, 0.9]
radius = 0.1
"""


def test_what_is_read():
    scene, task = task_file.of_text(SOUND_ARM, "arm.toml")
    clear = task.clearance
    assert clear.obstacles == {"post": task.obstacles[0].region}
    assert isinstance(clear.obstacles["post"], Cylinder)
    assert (clear.distance, clear.apart, clear.floor) == (0.02, 0.0, 0.0)
    assert clear.pairs == (("shoulder_lift_joint", "wrist_1_joint"),)
    own = task_file.of_text(SOUND_ARM.replace('name = "post"', 'signal = "tool"'), "arm.toml")[1]
    assert (own.clearance.obstacles, own.obstacles[0].name) == ({}, "Cylinder_1")
    every = task_file.of_text(SOUND_ARM.replace('[["shoulder_lift_joint", "wrist_1_joint"]]', "true"), "arm.toml")[1]
    assert ("elbow_joint", "wrist_3_joint") in every.clearance.pairs
    assert "0.02 m above the floor at 0 m" in " ".join(task.card(scene.system).split())
    assert [one.name for one in task.drawn] == ["post", "floor"]
    count = len(task.problem(scene.system).subject_to)
    without = SOUND_ARM[: SOUND_ARM.index("[collisions]")] + SOUND_ARM[SOUND_ARM.index("[task]") :]
    plain = task_file.of_text(without, "arm.toml")[1]
    assert plain.clearance is None
    assert count > len(plain.problem(scene.system).subject_to)


def test_capsules_along_the_lines_of_a_machine_that_has_none():
    scene, task = task_file.of_text(SLIDES, "lift.toml")
    assert len(scene.machine.shapes) >= 3
    nearest = task.clearance.nearest(np.array([[0.0, 0.2, 0.6], [2.0, 0.8, 0.8]]))
    by_hand = least_clearance(scene.machine, [[0.0, 0.2, 0.6], [2.0, 0.8, 0.8]], [Ball((-0.5, 0.9, 0.9), 0.1)])
    assert nearest[0].least == by_hand["Ball_1"]
    with pytest.raises(SceneError, match=r"line 6: collisions.radius: xi has no limits"):
        task_file.of_text(
            SLIDES.replace("q = { lower = [-3.0, 0.0, 0.3], upper = [3.0, 1.2, 1.0] }\n", "v = 9.0\n"), "x"
        )
    more = '[[collisions.capsules]]\nbody = "arm"\nstart = [0, 0, 0]\nend = [0, 0.1, 0]\nradius = 0.08\n[task]'
    more, _ = task_file.of_text(SLIDES.replace("[task]", more), "lift.toml")
    assert len(more.machine.shapes) == len(scene.machine.shapes) + 1


@pytest.mark.slow
def test_a_small_arm_of_a_file_keeps_its_clearance(tmp_path):
    (tmp_path / "two.urdf").write_text(URDF)
    (tmp_path / "two.toml").write_text(SCENE)
    scene, task = task_file.load(tmp_path / "two.toml")
    assert len(scene.machine.shapes) == 2
    solution = solve(task.problem(scene.system), grid=uniform(task.elements))
    assert solution.ok
    q = solution.signal("q", np.linspace(0.0, float(solution.duration), 4001))
    (nearest,) = [one for one in task.clearance.nearest(q) if one.other == "post"]
    assert 0.02 <= nearest.least < 0.05
    assert least_clearance(scene.machine, q, [task.obstacles[0].region])["Ball_1"] == nearest.least


@pytest.mark.slow
@pytest.mark.parametrize("make", [robots.ur5, robots.panda], ids=["ur5", "panda"])
def test_goals_of_the_tool_lead_to_a_near_position(make):
    machine = make()
    tool = ca.Function("tool", [machine.q], [ca.densify(machine.tool), ca.densify(machine.tool_orientation)])
    name = "ur5" if machine.name == "UR5" else "panda"
    lower, upper = (np.clip(side, -1.6, 1.6) for side in machine.limits["q"])
    random, n = np.random.default_rng(8), len(machine.coordinates)
    for _ in range(3):
        begin, wanted = random.uniform(lower, upper, (2, n))
        angles = random.uniform(-1.5, 1.5, 3)
        place = tool(wanted)[0].full().ravel()
        for orientation in (None, angles):
            axes = "" if orientation is None else f", orientation = {angles.tolist()}"
            text = f"""machine = {{ robot = "{name}" }}
[limits]
machine = true
[task]
from = {begin.tolist()}
to = {{ tool = {place.tolist()}{axes} }}
"""
            scene, task = task_file.of_text(text, "arm.toml")
            turned = None if orientation is None else rotation_matrix(angles)
            found = inverse_kinematics(machine, place, turned, near=begin)
            if not len(found):
                continue
            last = ends(task.problem(scene.system), [])[1][:n]
            reached, axes = (part.full() for part in tool(last))
            assert np.max(np.abs(reached.ravel() - place)) < 1e-9
            assert turned is None or np.max(np.abs(axes - turned)) < 1e-9
            assert np.all(last >= np.array(machine.limits["q"][0]) - 1e-9)
            assert np.all(last <= np.array(machine.limits["q"][1]) + 1e-9)
            assert np.linalg.norm(last - begin) < 1.6 * np.linalg.norm(found[0] - begin)


def test_links_without_capsules_are_named_and_can_have_some(tmp_path):
    begin = URDF.index("<collision>")
    bare = URDF[:begin] + URDF[URDF.index("</collision>") + len("</collision>") :]
    swapped = bare.replace("<collision>", "<x>").replace("</collision>", "</x>").replace("</inertial>\n</link>", (
        '</inertial><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'), 1)  # fmt: skip
    (tmp_path / "two.urdf").write_text(swapped)
    scene_file = tmp_path / "two.toml"
    scene_file.write_text(SCENE)
    scene, task = task_file.load(scene_file)
    assert [shape.body for shape in scene.machine.shapes] == ["turn"]
    assert task.clearance.notes == (
        "bend: without capsules, nothing is kept away from there; 'radius' in [collisions] gives some",
    )
    assert "bend: without capsules" in " ".join(task.card(scene.system).split())
    scene_file.write_text(SCENE.replace("clearance = 0.02", "clearance = 0.02\nradius = 0.04"))
    scene, task = task_file.load(scene_file)
    assert {shape.body for shape in scene.machine.shapes} == {"turn", "line 1"}
    assert task.clearance.notes == ()


def test_accelerations_as_controls_have_no_frame():
    scene, task = task_file.of_text(SLIDES.replace('"cylindrical"', '"cylindrical"\nform = "inverse"'), "lift.toml")
    assert scene.form_name == "inverse"
    assert task.problem(scene.system)
    framed = SLIDES.replace('"cylindrical"', '"cylindrical"\nform = "inverse"\nframe = "regular"')
    with pytest.raises(SceneError, match=r"line 3: frame: the form inverse has none"):
        task_file.of_text(framed, "lift.toml")


def test_an_orientation_of_a_machine_without_axes_of_its_tool():
    text = SLIDES.replace("to = [2.0, 0.8, 0.8]", "to = { tool = [0.5, 0.5, 0.5], orientation_deg = [0, 0, 90] }")
    with pytest.raises(SceneError, match=r"line 10: task.to.orientation_deg: is for arms of links"):
        task_file.of_text(text, "arm.toml")


@pytest.mark.slow
def test_a_robot_with_obstacles_through_the_command(tmp_path):
    text = SOUND_ARM.replace(
        "to = { q = [1.6, -1.0, 1.2, -1.6, -1.5, 0.5] }",
        "to = { tool = [-0.13, 0.69, 0.27], orientation_deg = [180.0, 0.0, 90.0] }\nelements = 20",
    )
    (tmp_path / "ur5.toml").write_text(text)
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "MPLCONFIGDIR": tempfile.gettempdir()}
    call = [sys.executable, str(ROOT / "scripts" / "time_optimal.py"), str(tmp_path / "ur5.toml"), "--json",
            "--nodes", "20", "--output", str(tmp_path / "out")]  # fmt: skip
    done = subprocess.run(call, capture_output=True, text=True, check=False, env=environment, cwd=ROOT)
    account = json.loads(done.stdout)
    assert account["status"] == "SOLVED", account["message"]
    assert {one["other"] for one in account["clearances"]} == {"post", "floor", "wrist_1_joint"}
    for one in account["clearances"]:
        assert one["least"] >= one["kept"]
