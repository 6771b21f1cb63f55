"""One motion in twenty dialects of files, read to the same numbers."""

import json

import numpy as np
import pytest

from models import Motion, torus
from models.motions.coordinate_labels import labels_of
from models.motions.csv_tables import read_csv
from models.motions.opensim_tables import read_opensim
from models.motions.ros_trajectory import read_trajectory

T = np.linspace(0.0, 0.4, 9)
Q = np.stack([np.sin(3 * T), 0.4 + T, T**2 - 0.9], axis=1)
ROWS = np.column_stack([T, Q])
LABELS = labels_of(torus())
NAMES = ["q1", "q2", "q3"]


def text(header, rows, separator=",", decimal=".", end="\n"):
    lines = [separator.join(format(x, ".12g").replace(".", decimal) for x in row) for row in rows]
    return end.join([header, *lines]) + end


def points(q=Q):
    return [{"positions": row.tolist(), "time_from_start": {"sec": 0, "nanosec": round(1e9 * t)}}
            for t, row in zip(T, q, strict=True)]  # fmt: skip


JOINTS = {"joint_names": NAMES, "points": points()}
GRIPPER = {"joint_names": ["hand", *NAMES], "points": points(np.column_stack([0 * T, Q]))}
STATES = [{"header": {"stamp": {"sec": 1_700_000_000, "nanosec": round(1e9 * t)}}, "name": NAMES,
           "position": row.tolist()} for t, row in zip(T, Q, strict=True)]  # fmt: skip
DEGREES = np.column_stack([T, np.rad2deg(Q)])
HALVES = [{"joint_names": NAMES, "points": points()[:5]},
          {"joint_names": NAMES, "points": [{**point, "time_from_start": float(t)} for point, t in
                                            zip(points()[4:], T[4:] - T[4], strict=True)]}]  # fmt: skip
STO = "motion\nversion=1\nnRows=9\nnColumns=4\ninDegrees=yes\nendheader\n"
FILES = {
    "commas": ("m.csv", text("t,q1,q2,q3", ROWS)),
    "semicolons, decimal commas": ("m.csv", text("t;q1;q2;q3", ROWS, ";", ",")),
    "tabs": ("m.tsv", text("t\tq1\tq2\tq3", ROWS, "\t")),
    "tabs, decimal commas": ("m.txt", text("t\tq1\tq2\tq3", ROWS, "\t", ",")),
    "spaces": ("m.txt", text("t q1 q2 q3", ROWS, " ")),
    "byte order mark": ("m.csv", "\ufeff" + text("t,q1,q2,q3", ROWS)),
    "Windows line ends": ("m.csv", text("t,q1,q2,q3", ROWS, end="\r\n")),
    "milliseconds": ("m.csv", text("time (ms),q1,q2,q3", ROWS * [1e3, 1, 1, 1])),
    "degrees in brackets": ("m.csv", text("t,q1 [deg],q2 [deg],q3 [deg]", DEGREES)),
    "degrees in parentheses": ("m.csv", text("t,q1 (deg),q2 (deg),q3 (deg)", DEGREES)),
    "degrees as a suffix": ("m.csv", text("t,q1_deg,q2_deg,q3_deg", DEGREES)),
    "header of numpy.savetxt": ("m.csv", text("# t,q1,q2,q3", ROWS)),
    "text in a column that is not needed": ("m.csv", text("t,q1,q2,q3,state", ROWS).replace("\n0", ",idle\n0") + ""),
    "OpenSim": ("m.sto", STO + text("time\tq1\tq2\tq3", DEGREES, "\t")),
    "OpenSim, spaces": ("m.mot", STO + text("time q1 q2 q3", DEGREES, " ")),
    "JointTrajectory": ("m.json", json.dumps(JOINTS)),
    "RobotTrajectory": ("m.json", json.dumps({"trajectory": {"joint_trajectory": JOINTS}})),
    "goal of an action": ("m.json", json.dumps({"goal": {"trajectory": JOINTS}})),
    "list of trajectories": ("m.json", json.dumps(HALVES)),
    "additional joints": ("m.json", json.dumps(GRIPPER)),
    "stream of JointState": ("m.json", json.dumps(STATES)),
    "JSON lines": ("m.jsonl", "\n".join(json.dumps(state) for state in STATES)),
}


@pytest.mark.parametrize("name", FILES)
def test_a_dialect_is_the_same_motion(name, tmp_path):
    file, content = FILES[name]
    if name.startswith("text in a column"):
        lines = text("t,q1,q2,q3", ROWS).splitlines()
        content = "\n".join([f"{lines[0]},state", *(f"{line},{'' if k % 2 else 'idle'}" for k, line in
                                                    enumerate(lines[1:]))]) + "\n"  # fmt: skip
    path = tmp_path / file
    path.write_bytes(content.encode())
    if path.suffix in (".sto", ".mot"):
        found = read_opensim(path, LABELS)
    elif path.suffix in (".json", ".jsonl"):
        found = read_trajectory(path, NAMES)
    else:
        found = read_csv(path, LABELS)
    np.testing.assert_allclose(found.t, T, atol=1e-9)
    np.testing.assert_allclose(found.q, Q, atol=1e-10)
    dialects = ("semicolons", "tabs", "spaces", "OpenSim", "list of", "additional", "stream", "header of")
    if name.startswith(dialects):
        assert found.notes  # the dialect is named


def test_documents_of_yaml_and_names_of_others(tmp_path):
    pytest.importorskip("yaml", reason="reading YAML needs PyYAML")
    path = tmp_path / "m.yaml"
    other = {"joint_names": ["a", "b", "c", "hand"], "points": points(np.column_stack([Q, 0 * T]))}
    path.write_text(json.dumps(other) + "\n---\n")
    with pytest.raises(ValueError, match="--joints a=q1"):
        Motion.from_trajectory(path, torus())
    motion = Motion.from_trajectory(path, torus(), noise=0.0, joints={"a": "q1", "b": "q2", "c": "q3"})
    np.testing.assert_allclose(motion.q(T), Q, atol=1e-12)
    assert any("hand" in note for note in motion.notes)
