"""Files with motions: what is read, and a sentence for everything that cannot be; the command from the shell."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from models import Motion, spherical, torus
from models.effects import Gravity
from models.motions.csv_tables import read_csv
from models.motions.ros_trajectory import as_trajectory, trajectory

ROOT = Path(__file__).parents[2]
T = np.linspace(0.0, 1.0, 21)
Q = np.stack([np.sin(T), 0.4 + T**2, -0.9 + 0 * T], axis=1)


@pytest.fixture(scope="module")
def command():
    """Return the main function of the command; its own folder is on the path as when it is run."""
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        import torques

        yield torques.main
    finally:
        sys.path.remove(str(ROOT / "scripts"))


def csv(header, rows):
    return header + "\n" + "\n".join(",".join(repr(float(x)) for x in row) for row in rows) + "\n"


GOOD = csv("t,q1,q2,q3", np.column_stack([T, Q]))


def replaced(row, column, text):
    lines = GOOD.splitlines()
    cells = lines[row].split(",")
    cells[column] = text
    lines[row] = ",".join(cells)
    return "\n".join(lines)


def point(**changes):
    return {"positions": [0.0, 0.0, 0.0], "time_from_start": 0.0, **changes}


def message(*points, names=("q1", "q2", "q3")):
    return json.dumps({"joint_names": list(names), "points": list(points)})


BAD = {
    "empty file": ("m.csv", "", "the file is empty"),
    "empty first line": ("m.csv", "\n1,2\n", "first line is empty"),
    "no rows": ("m.csv", "t,q1,q2,q3\n", "no row of numbers"),
    "no header": ("m.csv", GOOD.split("\n", 1)[1], "the first line holds numbers"),
    "missing column": ("m.csv", GOOD.replace("q3", "x"), "no column q3 or q_q3 or qq3; the header has t, q1, q2, x"),
    "half of the velocities": ("m.csv", csv("t,q1,q2,q3,v1", np.column_stack([T, Q, T])), "no column"),
    "twice the same column": ("m.csv", GOOD.replace("q3", "q2"), "'q2' stands twice"),
    "one column": ("m.csv", GOOD.replace(",", ""), "has one column"),
    "ragged row": ("m.csv", GOOD + "1.5,0,0\n", "line 23 has 3 columns, the header has 4"),
    "a word": ("m.csv", replaced(5, 2, "fast"), "line 6: 'fast' is no number"),
    "an empty cell": ("m.csv", replaced(5, 2, ""), "line 6: an empty cell is no number"),
    "nan": ("m.csv", replaced(5, 2, "nan"), "q is not finite in sample 5"),
    "infinite": ("m.csv", replaced(5, 0, "inf"), "t is not finite in sample 5"),
    "repeated time": ("m.csv", replaced(5, 0, repr(float(T[3]))), "times are repeated: sample 4 at 0.15 s"),
    "unsorted times": ("m.csv", replaced(5, 0, "0.01"), "times are not increasing"),
    "too few samples": ("m.csv", "\n".join(GOOD.splitlines()[:6]), "5 samples, a smoothing spline needs at least 8"),
    "one sample": ("m.csv", "\n".join(GOOD.splitlines()[:2]), "1 samples, expected at least 2"),
    "degrees?": ("m.csv", csv("t,q1,q2,q3", np.column_stack([T, Q * 57.3])), "degrees? Write q1 [deg]"),
    "unknown unit": ("m.csv", GOOD.replace("q1", "q1 [furlong]"), "is in 'furlong', expected one of rad, deg"),
    "metres for an angle": ("m.csv", GOOD.replace("q1", "q1 [m]"), "is in 'm', expected one of rad, deg"),
    "time in minutes": ("m.csv", GOOD.replace("t,", "t [min],"), "expected s, ms, us or ns"),
    "speed without a unit per second": (
        "m.csv", csv("t,q1,q2,q3,v1 [rad],v2,v3", np.column_stack([T, Q, Q])), "expected a unit per s"
    ),
    "velocities in deg/s": (
        "m.csv", csv("t,q1,q2,q3,v1,v2,v3", np.column_stack([T, Q, 57.3 * np.cos(T), 114.6 * T, 0 * T])), "deg/s"
    ),
    "UTF-16": ("m.csv", GOOD.encode("utf-16"), "UTF-16 or binary"),
    "Latin-1": ("m.csv", GOOD.replace("q3", "q3,\u00e4").encode("latin-1"), "no UTF-8 text"),
    "binary": ("m.csv", bytes(range(256)) * 10, "UTF-8"),
    "header of 1 GB": ("m.csv", 1 << 30, "header line is longer than 65536 bytes"),
    "row of 1 MB": ("m.csv", GOOD + "1" * (1 << 20), "line 23 is longer"),
    "brackets": ("m.csv", GOOD.replace("q1", "q1]["), "cannot be read"),
    "unknown kind": ("m.xls", "x", "the kind '.xls' is unknown"),
    "no such file": ("m.csv", None, "No such file"),
    "waypoints without limits": ("m.csv", GOOD.replace("t,q1", "q1,t"), "give --limit"),
    "broken JSON": ("m.json", "{", "no JSON"),
    "JSON of something else": ("m.json", "[1, 2]", "no JointTrajectory"),
    "no joint names": ("m.json", '{"points": [1]}', "joint_names is missing"),
    "no points": ("m.json", message(), "points is empty"),
    "short positions": ("m.json", message(point(positions=[1.0])), "point 1: positions must be a list of 3"),
    "no time": ("m.json", message({"positions": [0.0] * 3}), "no time_from_start"),
    "time of words": ("m.json", message(point(time_from_start="now")), "time_from_start is 'now'"),
    "velocities at some points": (
        "m.json", message(point(), point(time_from_start=1, velocities=[0.0] * 3)), "velocities stand at some"
    ),
    "other number of joints": (
        "m.json",
        message(*({"positions": [0.0, 0.0], "time_from_start": float(k)} for k in range(9)), names=("a", "b")),
        "torus has 3 (q1, q2, q3)",
    ),
    "unreachable tool point": (
        "m.csv", csv("t,x,y,z", [[0, 1, 0, 0], [1, 1.4, 0, 0.2], [2, 1.2, 0.9, 0.6]]), "cannot be reached: farther than"
    ),
    "tool points of two axes": ("m.csv", csv("t,x,y", [[0, 1, 0], [1, 1, 1]]), "no column q1"),
    "damaged archive": ("m.npz", b"PK nothing", "no readable NPZ"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_sentence_and_no_file(name, command, tmp_path, capsys):
    file, content, words = BAD[name]
    path = tmp_path / file
    if isinstance(content, int):
        with path.open("wb") as stream:  # a sparse file: its size costs nothing
            stream.write(b"t,q1")
            stream.truncate(content)
    elif content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    output = tmp_path / "results"
    assert command([str(path), "--machine", "torus", "--output", str(output)]) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.startswith("torques: ")
    assert printed.err.count("\n") == 1
    assert len(printed.err) < 700
    assert not output.exists() or not any(output.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--limit", "1", "2"], "--limit: got 2 numbers, torus has 3 drives (q1, q2, q3)"),
        (["--limit", "1", "2", "-1"], "peak is -1.0"),
        (["--corner", "1", "1", "1"], "corner"),
        (["--payload", "-1"], "payload.mass"),
        (["--noise", "-1"], "noise"),
        (["--viscous", "1", "2"], "viscous"),
        (["--output", "/proc/nowhere"], "/proc/nowhere"),
    ],
)
def test_wrong_usage_is_one_sentence(arguments, words, command, tmp_path, capsys):
    (tmp_path / "m.csv").write_text(GOOD)
    given = [str(tmp_path / "m.csv"), "--machine", "torus", "--output", str(tmp_path / "r"), *arguments]
    assert command(given) == 2
    assert words in capsys.readouterr().err


def test_the_command_writes_what_it_computes(command, tmp_path, capsys):
    (tmp_path / "m.csv").write_text(GOOD)
    limits = ["--limit", "90", "500", "200", "--speed", "4", "4", "4", "--continuous", "50", "400", "100"]
    code = command([
        str(tmp_path / "m.csv"), "--machine", "torus", "--json", "--export", "--code", "--compare",
        "--output", str(tmp_path / "r"), *limits,
    ])  # fmt: skip
    account = json.loads(capsys.readouterr().out)
    motion = Motion.from_csv(tmp_path / "m.csv", torus())
    table = motion.torques(torus(), [Gravity()])
    assert account["drives"][1]["peak"] == pytest.approx(table.loads[1].peak)
    assert code == int(any(drive["exceeded"] or drive["overheated"] for drive in account["drives"]))
    files = sorted(path.name for path in (tmp_path / "r").iterdir())
    assert files == [
        "inverse_dynamics.c", "inverse_dynamics.casadi", "inverse_dynamics.h", "torques.csv", "torques.json",
        "torques.png", "trajectory.json",
    ]  # fmt: skip
    # The table and the trajectory are motions again, with the same torques.
    for again in (
        Motion.from_csv(tmp_path / "r" / "torques.csv", torus()),
        Motion.from_trajectory(tmp_path / "r" / "trajectory.json", torus()),
    ):
        np.testing.assert_allclose(again.torques(torus(), [Gravity()]).tau, table.tau, rtol=1e-8, atol=1e-8)
    header = (tmp_path / "r" / "torques.csv").read_text().splitlines()[0].split(",")
    assert header[:2] == ["t [s]", "q1 [rad]"]
    assert header[-4:] == ["gravity of tau_q3 [N m]", *(f"uncertainty of tau_q{k} [N m]" for k in (1, 2, 3))]
    assert (tmp_path / "r" / "torques.png").read_bytes().startswith(b"\x89PNG")


def test_waypoints_from_the_shell(command, tmp_path, capsys):
    (tmp_path / "way.csv").write_text("q1,q2,q3\n0,0.4,-0.9\n0.7,0.9,-1.2\n1.3,0.5,-0.8\n")
    options = ["--machine", "torus", "--limit", "250", "600", "220", "--no-picture", "--output", str(tmp_path / "r")]
    assert command([str(tmp_path / "way.csv"), *options]) in (0, 1)
    assert "minimum time" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["torques.csv", "torques.json"]


def test_tool_points_from_the_shell(command, tmp_path, capsys):
    points = np.array([[1.0, 0.0, 0.1], [0.9, 0.3, 0.2], [0.7, 0.5, 0.2], [0.5, 0.6, 0.1]])
    (tmp_path / "tool.csv").write_text(csv("t,x [mm],y [mm],z [mm]", np.column_stack([range(4), 1e3 * points])))
    options = ["--machine", "torus", "--no-picture", "--quiet", "--output", str(tmp_path / "r")]
    assert command([str(tmp_path / "tool.csv"), *options]) == 0
    motion = Motion.from_csv(tmp_path / "r" / "torques.csv", torus())
    np.testing.assert_allclose(motion.torques(torus(), times=[0.0, 1.0, 2.0, 3.0]).tool, points, atol=1e-8)


def test_a_scene_file_says_machine_and_effects(command, tmp_path, capsys):
    (tmp_path / "m.csv").write_text(GOOD)
    scene = ROOT / "scripts" / "scenes" / "torus.toml"
    options = ["--no-picture", "--json", "--output", str(tmp_path / "r")]
    assert command([str(tmp_path / "m.csv"), str(scene), *options]) in (0, 1)
    account = json.loads(capsys.readouterr().out)
    assert account["machine"] == "torus"
    assert {"gravity", "payload", "viscous"} <= set(account["split_rms"])
    assert command([str(tmp_path / "m.csv"), str(scene), "--payload", "2", *options]) == 2
    assert "leave one of them out" in capsys.readouterr().err
    assert command([str(tmp_path / "m.csv"), str(tmp_path / "no.toml"), *options]) == 2


def test_units_names_and_order(tmp_path):
    degrees = np.rad2deg(Q)
    table = csv("time [ms],q3 [deg],q1 [deg],q2 [deg],note", np.column_stack([1e3 * T, degrees[:, [2, 0, 1]], T]))
    (tmp_path / "m.csv").write_text("\ufeff" + table, encoding="utf-8")
    result = read_csv(tmp_path / "m.csv", Motion.from_samples(T, Q, noise=0.0).labels)
    np.testing.assert_allclose(result.q, Q, atol=1e-14)
    np.testing.assert_allclose(result.t, T, atol=1e-14)
    assert result.notes == ("columns left out: note",)
    arm = spherical()
    columns = np.column_stack([T, Q, 1e3 * np.ones_like(T)])
    (tmp_path / "s.csv").write_text(csv("t,theta,psi,phi,r [mm]", columns))
    motion = Motion.from_csv(tmp_path / "s.csv", arm, noise=0.0)
    np.testing.assert_allclose(motion.q(T)[:, 3], 1.0)
    assert [str(label) for label in motion.labels] == ["theta [rad]", "psi [rad]", "phi [rad]", "r [m]"]


def test_trajectories_there_and_back(tmp_path):
    v, a = np.stack([np.cos(T), 2 * T, 0 * T], axis=1), np.stack([-np.sin(T), 2 + 0 * T, 0 * T], axis=1)
    message_ = as_trajectory(T + 3.0, Q, v, a, ["q1", "q2", "q3"])
    result = trajectory(json.loads(json.dumps(message_)), ["q3", "q1", "q2"])
    np.testing.assert_array_equal(result.q, Q[:, [2, 0, 1]])
    np.testing.assert_array_equal(result.v, v[:, [2, 0, 1]])
    np.testing.assert_allclose(result.t, T, atol=1e-9)
    ros1 = {"trajectory": {"joint_names": ["a", "b", "c"], "points": [
        {"positions": list(map(float, q)), "time_from_start": {"secs": k, "nsecs": 500}} for k, q in enumerate(Q)
    ]}}  # fmt: skip
    result = trajectory(ros1, ["q1", "q2", "q3"])
    assert result.v is None
    assert result.t[3] == 3.0000005
    assert "a, b, c are taken for q1, q2, q3" in result.notes[0]
    path = tmp_path / "m.yaml"
    path.write_text("joint_names: [q1, q2, q3]\npoints:\n- {positions: [0, 0, 0], time_from_start: 0.0}\n")
    try:
        import yaml  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="pip install pyyaml"):
            Motion.from_trajectory(path)
    else:
        with pytest.raises(ValueError, match="1 samples"):
            Motion.from_trajectory(path)
