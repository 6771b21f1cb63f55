"""Scenes and scene files: cards, instruction counts, degrees, tasks, templates, budgets, errors of broken files."""

import json
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.broken_scenes import BROKEN, BROKEN_ARM, SOUND, SOUND_ARM
from reports import effect_budget as budget
from writers import write_scenes

from models import Parameter, Scene, cylindrical, spherical, torus
from models.effects import Coulomb, Gravity, LaggedDrive, MotorDrive, Payload, RotorInertia, Viscous, WindingHeat
from models.forms import canonical, hamel, lagrange
from models.scenes import catalogue, task_file
from models.scenes import scene_template as template
from models.scenes.docstring_words import argument_words
from models.scenes.toml_document import SceneError
from ocp import Fixed, Free, Sequence, point_to_point, radau, solve, uniform, verify

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
PREFIX = 'machine = "spherical"\n'


def count(machine, effects, form, frame=None):
    """Return the instructions of the right-hand side, without the scene."""
    system = form(machine, effects, frame)
    return ca.Function("f", [system.x, system.u, system.p], [system.rate]).n_instructions()


def command(*arguments):
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "MPLCONFIGDIR": tempfile.gettempdir()}
    call = [sys.executable, str(ROOT / "scripts" / "time_optimal.py"), *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, check=False, env=environment, cwd=ROOT)


def task(body, before=""):
    text = SOUND[: SOUND.index("[task]")] + "[task]\n" + body
    return task_file.of_text(text.replace("[limits]", before + "[limits]"), "arm.toml")


@pytest.mark.parametrize("make", [cylindrical, spherical, torus], ids=lambda make: make.__name__)
@pytest.mark.parametrize(
    "form", [canonical, *(pytest.param(form, marks=pytest.mark.slow) for form in (hamel, lagrange))],
    ids=lambda form: form.__name__,
)  # fmt: skip
def test_prices_are_differences_of_counts(make, form):
    effects = (Gravity(), Payload(2.0, (0.02, 0.1, 0.0)), Viscous(0.5), RotorInertia(1e-4), LaggedDrive(0.02))
    scene = Scene(make(), effects, form)
    assert scene.instructions == count(make(), effects, form)
    for k, added in enumerate(scene.prices):
        rest = effects[:k] + effects[k + 1 :]
        assert added.instructions == count(make(), effects, form) - count(make(), rest, form)
    n = len(make().coordinates)
    assert [added.states for added in scene.prices] == [0, 0, 0, 0, n]
    for added in scene.prices:
        assert f"{added.name} (" in str(scene)
        assert f"{added.instructions:+d} instruction" in " ".join(str(scene).split())


def test_an_effect_that_another_needs_has_a_reason_for_its_price():
    scene = Scene(spherical(), (MotorDrive(0.1, 1.0), WindingHeat(1.0, 100.0, limit=400.0)))
    motor, heat = scene.prices
    assert motor.instructions is None
    assert "copper_loss" in motor.reason
    assert heat.states == 4
    assert "winding_theta" in scene.card()
    assert "winding_theta <= 400 K" in scene.card()


def test_the_card_names_what_couples_the_metric():
    assert "diagonal in the frame 'regular': one division" in Scene(torus(), (Gravity(),)).card()
    card = " ".join(Scene(torus(), (Gravity(), Payload(3.0))).card().split())
    assert "coupled by the effect payload" in card


def test_a_scene_is_a_value_with_checks():
    scene = Scene(spherical(m_3=Parameter(15.0)), (Gravity(),), hamel, "ldl")
    assert (scene.form_name, scene.frame_name) == ("hamel", "ldl")
    assert "m_3 (symbol, nominal 15)" in scene.card()
    assert scene.without(scene.effects[0]).effects == ()
    with pytest.raises(ValueError, match="this scene has no effect Viscous"):
        scene.without(Viscous(1.0))
    with pytest.raises(TypeError, match="form is 'hamel', expected canonical"):
        Scene(spherical(), form="hamel")
    with pytest.raises(ValueError, match="it has paper, regular, coordinate, ldl, udu"):
        Scene(spherical(), frame="arrow")


EVERY_BROKEN = [(sound, *case) for sound, cases in ((SOUND, BROKEN), (SOUND_ARM, BROKEN_ARM)) for case in cases]


@pytest.mark.parametrize(("sound", "name", "old", "new"), EVERY_BROKEN, ids=[case[1] for case in EVERY_BROKEN])
def test_a_broken_file_gets_its_sentence(sound, name, old, new):
    assert sound.count(old) >= 1
    with pytest.raises(SceneError) as caught:
        task_file.of_text(sound.replace(old, new, 1), "arm.toml")
    message = str(caught.value)
    assert message.startswith("arm.toml")
    assert "\n" not in message
    assert f"- {name}: `{message}`\n" in DOCUMENT


def test_the_line_is_that_of_the_key():
    text = "# a = [\n" + PREFIX + "[task]\nfrom = [ # a comment = 3\n 1.0,\n 2.0, 3.0 ] # ]\n  to  = [1.0]\n"
    with pytest.raises(SceneError, match=r"x\.toml, line 4: task\.from: got 3 numbers"):
        task_file.of_text(text, "x.toml")
    with pytest.raises(SceneError, match=r"x\.toml, line 7: task\.to: got 1 number,"):
        task_file.of_text(text.replace("1.0,\n 2.0, 3.0", "1.0,\n 0, 0, 1"), "x.toml")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe", "is no text in UTF-8"),
        (b"machine = ", "is no TOML"),
        (b"x = " + b"[" * 100_000, "is nested too deeply"),
        (b'machine = "spherical"\n[parameters]\nm_3 = 1' + b"0" * 400, "parameters.m_3: got inf"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_bad_file_is_exit_2_and_one_sentence(tmp_path, content, words):
    path = tmp_path / "arm.toml"
    if content is not None:
        path.write_bytes(content)
    done = command(path, "--output", tmp_path / "out")
    assert done.returncode == 2
    assert words in done.stderr
    assert str(path) in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_degrees_are_degrees():
    _, by_name = task("from = { theta_deg = 60, psi = 0, phi_deg = -90.0, r = 0.8 }\nto_deg = [90, 30, 0, 0.9]\n")
    np.testing.assert_allclose(by_name.begin[0].lower, [math.pi / 3, 0.0, -math.pi / 2, 0.8], rtol=1e-15)
    np.testing.assert_allclose(by_name.finish[0].upper, [math.pi / 2, math.pi / 6, 0.0, 0.9], rtol=1e-15)
    scene, _ = task("from = 0.5\nto = 0.6\n", "[effects.joint_stop]\nupper = { theta_deg = 150, r = 1.0 }\n"
                    "[effects.coulomb]\nf = 1.0\nwidth_deg = [3, 3, 3, 0.1]\n")  # fmt: skip
    stop, friction = scene.effects[-2:]
    np.testing.assert_allclose([stop.upper[0], stop.upper[3]], [150 * math.pi / 180, 1.0])
    assert stop.upper[1] is None
    np.testing.assert_allclose(friction.width, [math.pi / 60] * 3 + [0.1])
    _, limited = task("from = 0.5\nto = 0.6\n", "")
    assert limited.limits[0].signal == "q"


def test_tasks_become_problems():
    scene, plain = task('from = [0.9, 0.0, 0.0, 0.85]\nto = { tool = [0.9, 0.0, 0.4] }\nminimise = { time = 2.0, '
                        "squares = { tau = 1e-3 }, integral = { power = 0.5 } }\n"
                        "horizon = { guess = 0.7, upper = 3 }\n")  # fmt: skip
    problem = plain.problem(scene.system)
    assert problem.horizon == Free(0.7, 0.0, 3.0)
    assert problem.minimise.time == 2.0
    tau, power = scene.system["tau"], scene.system["power"]
    wanted = 1e-3 * ca.sumsqr(tau) + 0.5 * power
    residual = ca.Function("r", [scene.system.x, scene.system.u], [problem.minimise.running - wanted])
    assert abs(float(residual(np.arange(8.0) + 1.0, np.arange(4.0)))) < 1e-12
    ends = [c for c in problem.subject_to if c.where.value == "end" and c.expression.numel() == 3]
    assert ca.is_equal(ends[0].expression, scene.system["tool"], 5)
    np.testing.assert_allclose(ends[0].lower, [0.9, 0.0, 0.4])
    _, legs = task("from = 0.5\nto = 0.7\nvia = [0.6, { r = 0.6, theta_deg = 40, psi = 0, phi = 0 }]\n"
                   "horizon = [ 0.5, { guess = 0.4 }, { upper = 2.0 } ]\n")  # fmt: skip
    sequence = legs.problem(scene.system)
    assert isinstance(sequence, Sequence)
    assert [problem.horizon for problem in sequence.problems] == [Fixed(0.5), Free(0.4), Free(upper=2.0)]
    assert sequence.links == ("q", "p")


@pytest.mark.parametrize(
    ("via", "legs"),
    [("0.5", 1), ("0.7", 1), ("0.6, 0.6", 2), ("0.5, 0.6, 0.6, 0.7", 2), ("0.5, 0.7", 1), ("0.6, 0.5", 3)],
)
def test_a_via_point_where_the_motion_is_already_is_no_leg(via, legs):
    # A leg of free duration without length has no equations that determine it: the command ended with status 1.
    _, plain = task(f"from = 0.5\nto = 0.7\nvia = [{via}]\n")
    assert len(plain.horizons) == legs
    assert len(plain.via) == legs - 1


def test_legs_of_a_given_duration_and_points_passed_at_speed_are_kept():
    _, waits = task("from = 0.5\nto = 0.7\nvia = [0.5]\nhorizon = [ 0.5, {} ]\n")
    assert waits.horizons == (Fixed(0.5), Free())
    _, slow = task("from = 0.5\nto = 0.7\nvia = [0.5]\nhorizon = [ { lower = 0.2 }, {} ]\n")
    assert len(slow.horizons) == 2
    _, later = task("from = 0.5\nto = 0.7\nvia = [0.5, 0.6]\nhorizon = [ {}, { guess = 0.3 }, { guess = 0.4 } ]\n")
    assert later.horizons == (Free(0.3), Free(0.4))
    pose = "q = [0.5, 0.0, 0.0, 0.85]"
    ends = "from = { q = [0.5, 0.0, 0.0, 0.85] }\nto = { q = [0.7, 0.0, 0.0, 0.85] }\n"
    _, moving = task(f"{ends}via = [{{ {pose}, v = [0.1, 0.0, 0.0, 0.0] }}]\n")
    _, resting = task(f"{ends}via = [{{ {pose}, v = [0.0, 0.0, 0.0, 0.0] }}]\n")
    assert (len(moving.via), len(resting.via)) == (1, 0)


def test_a_task_starts_and_ends_drives_at_rest():
    scene, plain = task("from = [0.9, 0.0, 0.0, 0.85]\nto = [1.6, 2.0, 0.5, 0.9]\n",
                        "[effects.elastic_drive]\nstiffness = 2e4\ninertia = 1.0\n")  # fmt: skip
    wanted = point_to_point(scene.system, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9])
    rest = [c for c in wanted.subject_to if c.where.value == "start"]
    made = [c for c in plain.problem(scene.system).subject_to if c.where.value == "start"]
    assert [c.expression.numel() for c in made] == [c.expression.numel() for c in rest]


@pytest.mark.slow
@pytest.mark.parametrize("name", template.TASKS)
def test_the_template_is_the_default_scene(name):
    scene, default = task_file.of_text(template.scene_text(name), name)
    known = template.TASKS[name]
    assert scene.effects == (Gravity(),)
    assert scene.machine.nominal == catalogue.machines()[name]().nominal
    assert default.begin[0].lower == known.q0
    assert default.finish[0].lower == known.q1
    assert {limit.signal: limit.upper for limit in default.limits} == {"q": known.q_max, "tau": known.limit}
    done = command("--template", name)
    assert done.stdout == template.scene_text(name)


@pytest.mark.parametrize("effect", [name for name in catalogue.effects() if name != "gravity"])
def test_every_effect_of_the_template_can_be_switched_on(effect):
    lines = template.scene_text("torus").splitlines()
    wanted = {effect} | ({"motor_drive"} if effect == "winding_heat" else set())
    table = ""
    for number, line in enumerate(lines):
        header = re.match(r"# \[effects\.(\w+)\]", line)
        table = header.group(1) if header else "" if not line.strip() else table
        if table in wanted:
            lines[number] = line.removeprefix("# ")
    text = "\n".join(lines)
    if effect == "joint_stop":
        text = re.sub(r"# upper = \.\.\. +#.*", "upper = 2.0", text)
    scene, _ = task_file.of_text(text, "torus")
    assert effect in [added.name for added in scene.prices]


@pytest.mark.slow
def test_the_cards_of_the_document_are_those_of_the_command():
    for name in write_scenes.EXAMPLES:
        assert f"```\n{write_scenes.example(name)}\n```" in DOCUMENT
    assert command(ROOT / "scripts/scenes/torus.toml", "--card").stdout == write_scenes.example("torus") + "\n"
    assert (ROOT / "scripts/scenes/spherical.toml").read_text(encoding="utf-8") in DOCUMENT
    assert write_scenes.HEAD in DOCUMENT


@pytest.mark.slow
@pytest.mark.parametrize("name", write_scenes.EXAMPLES)
def test_an_example_is_solved_and_verified(tmp_path, name):
    done = command(ROOT / f"scripts/scenes/{name}.toml", "--output", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    account = json.loads(done.stdout)
    assert account["verified"]
    printed = re.findall(r"^whole scene +([\d.]+)", DOCUMENT, re.MULTILINE)[write_scenes.EXAMPLES.index(name)]
    assert account["t_f"] == pytest.approx(float(printed), abs=2e-4)


@pytest.mark.slow
def test_options_change_the_scene(tmp_path):
    done = command(ROOT / "scripts/scenes/cylindrical.toml", "--form", "lagrange", "--to", "1", "0.5", "0.7", "--card")
    assert "lagrange form" in done.stdout
    assert "phi = 1 rad; xi = 0.5 m; r = 0.7 m" in done.stdout
    done = command(ROOT / "scripts/scenes/cylindrical.toml", "--machine", "torus")
    assert done.returncode == 2
    assert "--machine" in done.stderr


def test_the_budget_is_what_solving_by_hand_gives():
    machine, effects = cylindrical(), (Gravity(), Payload(3.0), Coulomb(5.0, 0.5))
    q0, q1, tau = (0.0, 0.2, 0.6), (2.0, 0.8, 0.8), (150.0, 1000.0, 300.0)
    text = ('machine = "cylindrical"\n[effects.gravity]\n[effects.payload]\nmass = 3.0\n[effects.coulomb]\nf = 5.0\n'
            f"width = 0.5\n[limits]\ntau = {list(tau)}\n[task]\nfrom = {list(q0)}\nto = {list(q1)}\n")  # fmt: skip
    scene, given = task_file.of_text(text, "lift")
    table = budget.effect_budget(scene, given, uniform(20))
    assert [row.name for row in table.rows] == ["", "gravity", "payload", "coulomb"]
    for row in table.rows:
        kept = [e for e in effects if row.name == "" or budget.name_of(e) != row.name]
        problem = point_to_point(canonical(machine, kept), q0, q1, tau=tau)
        solution = solve(problem, scheme=radau(3), grid=uniform(20))
        assert row.duration <= solution.duration * (1.0 + 1e-7)
        assert row.ok == verify(solution).ok
        if abs(row.duration - solution.duration) < 1e-9:
            ends = np.linspace(0.0, solution.duration, 40_001)
            force, speed = solution.signal("tau", ends), solution.signal("v", ends)
            net = np.trapezoid(np.sum(force * speed, axis=1), ends)
            assert row.net == pytest.approx(net, rel=2e-3)
            assert row.peak == pytest.approx(np.max(np.abs(force), axis=0), rel=1e-3)
    assert "without payload" in str(table)
    assert json.loads(json.dumps(table.plain()))["rows"][0]["status"] == "SOLVED"


def test_a_row_of_the_budget_that_is_not_possible_says_so():
    text = (PREFIX + "[effects.motor_drive]\nconstant = 0.1\nresistance = 1.0\n"
            "[effects.winding_heat]\nresistance = 1.0\n"
            "capacity = 500.0\n[limits]\nvoltage = 60.0\nwinding = { upper = 400.0 }\n"
            "[task]\nfrom = [0.9, 0.0, 0.0, 0.85]\n"
            "to = [1.2, 0.5, 0.2, 0.9]\n")  # fmt: skip
    scene, given = task_file.of_text(text, "heat")
    table = budget.effect_budget(scene, given, uniform(10))
    row = next(row for row in table.rows if row.name == "motor_drive")
    assert row.status is None
    assert "copper_loss" in row.message
    assert "without motor_drive: not possible" in str(table)


@pytest.mark.parametrize("name", template.TASKS)
def test_a_template_explains_every_parameter_and_coordinate(name):
    text = template.scene_text(name)
    machine = template.TASKS[name].machine()
    for coordinate in machine.coordinates:
        assert re.search(rf"^#   {coordinate.name} \w+ .*; 0: ", text, re.MULTILINE)
    table = text[text.index("[parameters]") : text.index("# Effects")]
    for parameter in machine.nominal:
        line = next(line for line in table.splitlines() if line.removeprefix("# ").startswith(f"{parameter} = "))
        unit, _, words = line.partition("# ")[2].removeprefix(f"{parameter} = ...".ljust(22) + "# ").partition("; ")
        assert len(words.split()) >= 2, line
        assert unit, line
    assert "moment of inertia of the column" in table


def test_words_of_arguments():
    def thing(a, b, c):
        """Do nothing.

        Args:
            a, b: masses of the links,
                both of them [kg].
            c: of the load; a long explanation that goes on and on, far beyond what fits into the margin [kg].

        Returns:
            d: none of these.
        """

    words = argument_words(thing)
    assert words == {
        "a": "masses of the links, both of them", "b": "masses of the links, both of them",
        "c": "masses of the load",
    }  # fmt: skip
    assert argument_words(test_words_of_arguments) == {}


SHAPES = {
    "ball": ("centre = [5.0, 0.0, 0.0]\nradius = 0.1", "outside"),
    "box": ("lower = [-3.0, -3.0, -1.0]\nupper = [3.0, 3.0, 3.0]", "inside"),
    "cylinder": ("centre = [5.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\nradius = 0.1", "outside"),
    "half_space": ("point = [0.0, 0.0, -0.5]\nnormal = [0.0, 0.0, 1.0]", "outside"),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("signal", ["", 'signal = "tool"\n'])
def test_every_shape_is_read_from_a_file(shape, signal):
    numbers, keep = SHAPES[shape]
    text = template.scene_text("cylindrical").partition("# [[task.obstacles]]")[0]
    text += f'[[task.obstacles]]\nshape = "{shape}"\nkeep = "{keep}"\n{numbers}\n{signal}'
    scene, task = task_file.of_text(text, "arm.toml")
    (obstacle,) = task.obstacles
    assert type(obstacle.region).__name__.lower() == shape.replace("_", "")
    assert obstacle.keep.__name__ == keep
    assert obstacle.point == "tool"
    assert task.problem(scene.system)


def test_the_signal_of_an_obstacle_is_named_once():
    text = template.scene_text("cylindrical").partition("# [[task.obstacles]]")[0] + "[[task.obstacles]]\n"
    ball = 'shape = "ball"\ncentre = [5.0, 0.0, 0.0]\nradius = 0.1\n'
    _, task = task_file.of_text(f'{text}{ball}point = "tool"\n', "arm.toml")  # as of release 0.1.0
    assert task.obstacles[0].point == "tool"
    with pytest.raises(SceneError, match="beside 'signal'"):
        task_file.of_text(f'{text}{ball}point = "tool"\nsignal = "tool"\n', "arm.toml")
    with pytest.raises(SceneError, match="expected tool"):
        task_file.of_text(f'{text}{ball}signal = "q"\n', "arm.toml")
