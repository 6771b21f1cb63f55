"""URDF files: what is read, what is refused with one sentence, and that no file costs memory or opens another one."""

import gzip
import json
import re
import resource
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from rigid_bodies.urdf_texts import AXIS_Y, GOOD, INERTIAL, joint, robot

from models import Kind, Link, from_urdf, inverse_dynamics
from models.effects import Gravity, joint_friction
from models.forms import canonical
from models.rigid_bodies.joint import Joint

VECTORS = json.loads((Path(__file__).parent / "data" / "chain_vectors.json").read_text())["robots"]


def numbers(values):
    return " ".join(repr(float(x)) for x in values)


def rpy(rotation):
    """Return roll, pitch, yaw of a rotation matrix."""
    r = np.array(rotation)
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) < 1e-12:
        return 0.0, pitch, np.arctan2(-r[0, 1], r[1, 1])
    return np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])


def text_of(given):
    """Return the URDF text of a machine of the vectors; fixed joints at the end carry the tool."""
    lines = ['<robot name="vectors"><link name="base"/>']
    names = [one["name"] for one in given["joints"]]
    for one in given["joints"]:
        t, parent = one["inertia"], one["parent"]
        before = f"l_{names[parent]}" if parent >= 0 else "base"
        entries = {"ixx": t[0][0], "iyy": t[1][1], "izz": t[2][2], "ixy": t[0][1], "ixz": t[0][2], "iyz": t[1][2]}
        inertia = " ".join(f'{key}="{value!r}"' for key, value in entries.items())
        lines += [
            f'<link name="l_{one["name"]}"><inertial><origin xyz="{numbers(one["centre"])}"/>',
            f'<mass value="{one["mass"]!r}"/><inertia {inertia}/></inertial></link>',
            f'<joint name="{one["name"]}" type="{one["kind"]}"><parent link="{before}"/>',
            f'<child link="l_{one["name"]}"/>',
            f'<origin xyz="{numbers(one["origin"])}" rpy="{numbers(rpy(one["rotation"]))}"/>',
            f'<axis xyz="{numbers(one["axis"])}"/></joint>',
        ]
    tool = given["tool"]
    lines += [
        f'<link name="tool"/><joint name="fixed" type="fixed"><parent link="l_{names[tool["joint"]]}"/>',
        f'<child link="tool"/><origin xyz="{numbers(tool["origin"])}" rpy="{numbers(rpy(tool["rotation"]))}"/></joint>',
        "</robot>",
    ]
    return "\n".join(lines)


@pytest.mark.parametrize("name", ["3R", "ur5", "panda"])
def test_a_file_moves_as_the_vectors_of_the_other_engine(name, file):
    arm = from_urdf(file(text_of(VECTORS[name])), "tool")
    torques = inverse_dynamics(arm, [Gravity()])
    tool = ca.Function("tool", [arm.q], [arm.tool])
    for state in VECTORS[name]["states"]:
        got = torques(state["q"], state["v"], state["given_acceleration"], []).full().ravel()
        assert np.allclose(got, state["inverse_dynamics"], rtol=1e-11, atol=1e-11 * np.max(np.abs(got)))
        assert np.allclose(tool(state["q"]).full().ravel(), state["tool"], rtol=0, atol=1e-11)


def test_limits_friction_and_notes_of_a_good_file(file):
    dynamics = '<dynamics damping="0.5" friction="2"/>'
    arm = from_urdf(file(robot(joint("q1", "base", "a", dynamics), joint("q2", "a", "b", AXIS_Y))))
    assert [c.name for c in arm.coordinates] == ["q1", "q2"]
    assert arm.limits == {
        "q": ((-1.0, -1.0), (2.0, 2.0)),
        "v": ((-3.0, -3.0), (3.0, 3.0)),
        "tau": ((-10.0, -10.0), (10.0, 10.0)),
    }
    assert canonical(arm).signals.keys() >= {"q", "v", "tau", "tool", "M_q1"}
    viscous, dry = joint_friction(arm)
    assert viscous.c == (0.5, 0.0)
    assert dry.f == (2.0, 0.0)


def test_zero_effort_and_velocity_are_unknown_and_decimal_angles_exact(file):
    limit = '<limit lower="-1" upper="1" velocity="0" effort="0"/>'
    turned = '<origin rpy="0 1.5708 0"/>'
    text = robot(joint("q1", "base", "a", inside=limit), joint("q2", "a", "b", turned, inside=limit))
    arm, as_written = from_urdf(file(text)), from_urdf(file(text), exact_angles=False)
    assert set(arm.limits) == {"q"}
    assert any("1.5708" in note and "pi/12" in note for note in arm.notes)
    cosine = [float(ca.Function("z", [one.q], [one.tool_axes[0, 0]])([0.3, 0.2])) for one in (arm, as_written)]
    assert cosine[0] == pytest.approx(0.0, abs=1e-16)
    assert 1e-7 < abs(cosine[1]) < 5e-6


def test_side_branches_locks_and_mimics(file):
    fingers = joint("f1", "b", "c", kind="prismatic") + joint("f2", "b", "d", '<mimic joint="f1" multiplier="-1"/>')
    text = robot(joint("q1", "base", "a"), joint("q2", "a", "b", AXIS_Y), fingers, links=("base", "a", "b", "c", "d"))
    arm = from_urdf(file(text), "b")
    assert [c.name for c in arm.coordinates] == ["q1", "q2"]
    assert sum("f1" in note or "f2" in note for note in arm.notes) == 2
    assert float(arm.bodies[-1].mass) == 6.0  # fingers ride along
    with pytest.raises(ValueError, match=r"f2 mimics another joint; fix it with lock=\{'f2': 0\.0\}"):
        from_urdf(file(text))
    moved = from_urdf(file(text), lock={"f2": 0.1})
    assert [c.name for c in moved.coordinates] == ["q1", "q2", "f1"]
    locked = from_urdf(file(GOOD), lock={"q2": np.pi / 2})
    assert len(locked.coordinates) == 1
    assert locked.coordinates[0].name == "q1"


def shaped(geometry):
    """Return a file whose last link has a collision shape."""
    return GOOD.replace('<link name="b">', f'<link name="b"><collision><geometry>{geometry}</geometry></collision>')


BROKEN = {
    "no XML": ("robot", "is no well-formed XML"),
    "empty": ("", "no element found"),
    "cut off": (GOOD[:-20], "line 1: is no well-formed XML"),
    "binary": (b"\x00\x01\x02\xff", "is no well-formed XML"),
    "wrong encoding": (b'<?xml version="1.0" encoding="klingon"?><robot/>', "encoding"),
    "another root": ("<sdf><model/></sdf>", "begins with <sdf>, expected <robot>"),
    "doctype": ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "DOCTYPE"),
    "xacro": ('<robot name="r"><xacro:macro name="m"/></robot>', "is xacro source"),
    "xacro with a namespace": (
        '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:macro name="m"/></robot>', "is xacro source"),
    "expression": (GOOD.replace('"0 0 0.5"', '"0 0 ${h}"'), "is xacro source"),
    "no links": ('<robot name="r"/>', "there is no <link>"),
    "no joints": (robot(links=("base",)), "there is no <joint>"),
    "link without name": (GOOD.replace('<link name="a">', "<link>"), "<link> has no 'name'"),
    "two links of one name": (GOOD.replace('<link name="b">', '<link name="a">'), "a second link is called 'a'"),
    "two joints of one name": (GOOD.replace('"q2"', '"q1"'), "a second joint is called 'q1'"),
    "unknown child": (GOOD.replace('<child link="b"/>', '<child link="x"/>'), "its child 'x' is no "),
    "no parent": (GOOD.replace('<parent link="a"/>', ""), "joint 'q2': has no <parent>"),
    "loop": (
        robot(joint("q1", "base", "a"), joint("q2", "a", "b"), joint("q3", "b", "a")), "link 'a' hangs on two joints"),
    "circle": (robot(joint("q1", "a", "b"), joint("q2", "b", "a"), links=("base", "a", "b")), "form a loop"),
    "two robots": (robot(joint("q1", "base", "a"), links=("base", "a", "b")), "there are 2 (base, b)"),
    "floating": (GOOD.replace('"revolute"', '"floating"', 1), "joint 'q1' is floating"),
    "planar": (GOOD.replace('"revolute"', '"planar"', 1), "joint 'q1' is planar"),
    "unknown type": (GOOD.replace('"revolute"', '"ball"', 1), "its type is 'ball', expected one of revolute"),
    "no type": (GOOD.replace(' type="revolute"', "", 1), "<joint> has no 'type'"),
    "zero axis": (GOOD.replace("0 1 0", "0 0 0"), "joint 'q2': its axis is zero"),
    "two numbers": (GOOD.replace('"0 0 0.5"', '"0 0.5"'), "xyz is '0 0.5', expected three numbers"),
    "no number": (GOOD.replace('"0 0 0.5"', '"0 0 half"'), "xyz has 'half', expected a finite number"),
    "comma": (GOOD.replace('"0 0 0.5"', '"0 0 0,5"'), "'0,5'"),
    "nan": (GOOD.replace('value="2"', 'value="nan"', 1), "value has 'nan', expected a finite number"),
    "infinite": (GOOD.replace('ixx="0.1"', 'ixx="1e999"', 1), "ixx has '1e999'"),
    "underscore": (GOOD.replace('value="2"', 'value="1_0"', 1), "'1_0'"),
    "negative mass": (GOOD.replace('value="2"', 'value="-2"', 1), "its mass is -2 kg"),
    "no mass": (GOOD.replace('<mass value="2"/>', "", 1), "its <inertial> has no <mass>"),
    "no inertia": (GOOD.replace('<inertia ixx="0.1" iyy="0.1" izz="0.1"/>', "", 1), "has no <inertia>"),
    "no izz": (GOOD.replace(' izz="0.1"', "", 1), "<inertia> has no 'izz'"),
    "impossible tensor": (
        GOOD.replace('<link name="b">' + INERTIAL, '<link name="b">' + INERTIAL.replace('ixx="0.1"', 'ixx="-0.1"')),
        "no rigid body has them"),
    "lower above upper": (GOOD.replace('lower="-1"', 'lower="3"', 1), "joint 'q1': lower 3 is above upper 2"),
    "negative speed": (GOOD.replace('velocity="3"', 'velocity="-3"', 1), "velocity is -3"),
    "negative radius": (shaped('<sphere radius="-1"/>'), "its collision <sphere> has the radius -1"),
    "negative length": (shaped('<cylinder radius="0.1" length="-2"/>'), "its collision <cylinder> has the length -2"),
    "negative side": (shaped('<box size="1 -1 1"/>'), "its collision <box> has the size -1"),
    "box without size": (shaped("<box/>"), "size is '', expected three numbers"),
    "nan among angles": (GOOD.replace('xyz="0 0 0.5"', 'xyz="0 0 0.5" rpy="0 nan 0"'), "rpy has 'nan'"),
    "four numbers": (GOOD.replace('"0 1 0"', '"0 1 0 0"'), "expected three numbers"),
    "negative damping": (GOOD.replace("</joint>", '<dynamics damping="-1"/></joint>', 1), "damping is -1"),
    "packed": (gzip.compress(GOOD.encode()), "is no well-formed XML"),
    "its own child": (GOOD.replace('<child link="b"/>', '<child link="a"/>'), "link 'a' hangs on two joints"),
    "two parents": (GOOD.replace('<parent link="a"/>', '<parent link="a"/><parent link="base"/>'),
                    "joint 'q2': has 2 <parent>, expected one"),
    "two origins": (GOOD.replace('<origin xyz="0 0 0.5"/>', '<origin xyz="0 0 1"/><origin xyz="0 0 0.5"/>'),
                    "joint 'q2': has 2 <origin>, expected one"),
    "two axes": (GOOD.replace(AXIS_Y, AXIS_Y + '<axis xyz="1 0 0"/>'), "has 2 <axis>, expected one"),
    "two limits": (GOOD.replace("<limit", '<limit lower="-3" upper="3"/><limit', 1), "joint 'q1': has 2 <limit>"),
    "two masses": (GOOD.replace('<mass value="2"/>', '<mass value="2"/><mass value="3"/>', 1), "has 2 <mass>"),
    "two inertials": (GOOD.replace(INERTIAL, 2 * INERTIAL, 1), "has 2 <inertial>, expected one"),
    "nothing moves": (GOOD.replace("revolute", "fixed"), "none of them moves"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gets_one_sentence(name, file):
    text, words = BROKEN[name]
    path = file(text)
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        from_urdf(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert len(message) < 500
    assert "\n" not in message


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tip": "hand"}, "tip: there is no link 'hand'; there are base, a, b"),
        ({"tip": "base"}, "tip: 'base' is the base"),
        ({"lock": {"q7": 0.0}}, "lock: there is no joint 'q7'"),
        ({"lock": {"q1": float("nan")}}, "lock: q1"),
        ({"lock": {"q2": None}}, "lock: q2"),
    ],
)
def test_wrong_arguments(arguments, words, file):
    with pytest.raises(ValueError, match=words.replace("(", "\\(")):
        from_urdf(file(GOOD), **arguments)


def test_missing_files_and_folders(tmp_path):
    for path in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises((ValueError, OSError), match=r"there is no such file|folder"):
            from_urdf(path)


def test_a_link_without_inertia_is_named_where_the_motion_feels_it(file):
    bare = GOOD.replace(f'<link name="b">{INERTIAL}</link>', '<link name="b"/>')
    arm = from_urdf(file(bare))
    with pytest.raises(ValueError, match="no inertia about q2 at any position"):
        canonical(arm, [Gravity()])


ATTACKS = {
    "billion laughs": "<!DOCTYPE r ["
    + '<!ENTITY l0 "lol">'
    + "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 10))
    + "]><robot>&l9;</robot>",
    "quadratic": f'<!DOCTYPE r [<!ENTITY a "{"x" * 50_000}">]><robot>{"&a;" * 50_000}</robot>',
    "external entity": '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>',
    "external DTD": '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/x.dtd"><robot/>',
    "parameter entity": '<!DOCTYPE r [<!ENTITY % p SYSTEM "file:///etc/hostname"> %p;]><robot/>',
    "deep": "<robot>" + "<a>" * 500_000,
    "wide": "<robot>" + "<a/>" * 3_000_000,
}


@pytest.mark.parametrize("name", ATTACKS)
def test_no_attack_costs_memory_or_opens_a_file(name, file):
    path = file(ATTACKS[name])
    opened = []
    sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event == "open" else None)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=r"DOCTYPE|levels|elements"):
        from_urdf(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300 * 1024  # kB
    assert not [name for name in opened if "passwd" in name or "hostname" in name or ".dtd" in name]


def test_huge_file_is_refused(tmp_path):
    path = tmp_path / "huge.urdf"
    with path.open("wb") as stream:
        stream.truncate(64 * 1024**2)
    with pytest.raises(ValueError, match="has more than 32 MB"):
        from_urdf(path)


@pytest.mark.slow
def test_hundred_joints(file):
    links = tuple(f"l{k}" for k in range(101))
    axes = ("0 0 1", "0 1 0", "1 0 0")
    parts = [
        joint(f"q{k}", f"l{k}", f"l{k + 1}", f'<axis xyz="{axes[k % 3]}"/><origin xyz="0 0 0.1"/>') for k in range(100)
    ]
    arm = from_urdf(file(robot(*parts, links=links)))
    torques = inverse_dynamics(arm, [Gravity()])
    rng = np.random.default_rng(1)
    q, v, a = (rng.uniform(-1, 1, 100) for _ in range(3))
    metric = ca.Function("m", [arm.q], [ca.densify(arm.metric)])(q).full()
    rest = torques(q, v, np.zeros(100), []).full().ravel()
    assert np.allclose(
        torques(q, v, a, []).full().ravel(), metric @ a + rest, rtol=1e-9, atol=1e-9 * np.max(np.abs(rest))
    )


def test_joint_and_link_values_are_checked():
    with pytest.raises(ValueError, match="joint 'q': axis"):
        Joint("q", axis=(0, 0, 0))
    with pytest.raises(ValueError, match="joint 'q': lower 2 is above upper 1"):
        Joint("q", lower=2.0, upper=1.0)
    with pytest.raises(ValueError, match="right-handed"):
        Joint("q", rotation=np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(ValueError, match=r"link\.mass"):
        Link(-1.0)
    assert Joint("q", Kind.PRISMATIC).kind is Kind.PRISMATIC
