"""Stored solutions: bit-exact round trips, use without the model, refusal of everything that is no solution file."""

import io
import json
import os
import pickle
from dataclasses import fields, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Control,
    Free,
    Label,
    Problem,
    Status,
    System,
    along,
    end,
    legendre,
    load,
    lobatto,
    polish,
    radau,
    save,
    simulate,
    solve,
    start,
    uniform,
    verify,
)
from ocp.solution.structure import Contact

x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 2)
LABELS = {"x": (Label("height", "m"), Label("speed", "m/s")), "u": (Label("force", "N"),)}
axis = System(
    x, u, p, ca.vertcat(x[1], u / p[0] - p[1]), {"q": x[0], "power": u * x[1]}, {"mass": 2.0, "g": 1.0}, LABELS
)
PROBLEM = Problem(
    axis,
    Free(1.0),
    Bolza(time=1.0),
    (start(x, [0.1, 0.0]), end(x, [1.0, 0.0]), along(u, -9.0, 9.0), along(p[1], 0.5, 3.0)),
)
SOLUTION = solve(PROBLEM, grid=uniform(7), values={"mass": 1.3})
ARRAYS = [f.name for f in fields(SOLUTION) if isinstance(getattr(SOLUTION, f.name), np.ndarray)]
PLAIN = ["status", "message", "solver_status", "free", "values", "timings", "iterations", "rung", "log", "structure"]


def assert_equal(loaded, saved):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(saved, name), strict=True, err_msg=name)
    for name in PLAIN:
        assert getattr(loaded, name) == getattr(saved, name), name
    assert (loaded.multipliers is None) == (saved.multipliers is None)
    for field in fields(saved.multipliers) if saved.multipliers else ():
        got, expected = (getattr(solution.multipliers, field.name) for solution in (loaded, saved))
        np.testing.assert_array_equal(got, expected, strict=True, err_msg=field.name)
    np.testing.assert_array_equal([loaded.duration, loaded.cost], [saved.duration, saved.cost])
    np.testing.assert_array_equal(loaded.grid.ends, saved.grid.ends)
    assert repr(loaded.scheme) == repr(saved.scheme)


def stored(tmp_path, solution=SOLUTION):
    path = tmp_path / "motion.npz"
    save(solution, path)
    return path


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("make", [radau, legendre, lobatto])
def test_round_trip_is_exact(tmp_path, make, control):
    solution = solve(PROBLEM, make(3, control), uniform(5))
    loaded = load(stored(tmp_path, solution))
    assert_equal(loaded, solution)
    t = np.linspace(0.0, solution.duration, 97)
    for name in ("x", "u", "rate", "costate"):
        np.testing.assert_array_equal(getattr(loaded, name)(t), getattr(solution, name)(t))


def test_all_fields_are_compared():
    # `accuracy` belongs to a refinement and is not saved.
    compared = {*ARRAYS, *PLAIN, "duration", "cost", "grid", "scheme", "problem", "multipliers", "accuracy"}
    assert compared == {f.name for f in fields(SOLUTION)}


def test_structure_of_a_polished_solution_round_trip(tmp_path):
    slow = replace(PROBLEM, subject_to=(*PROBLEM.subject_to, along(x[1], -1.0, 1.0)))
    polished = polish(solve(slow, grid=uniform(20), values={"mass": 1.3}))
    assert any(arc.held for arc in polished.structure.arcs)
    loaded = load(stored(tmp_path, polished))
    assert_equal(loaded, polished)
    assert str(loaded.structure) == str(polished.structure)
    touching = replace(polished.structure.arcs[0], touched=(Contact(0, -1),))
    again = replace(polished, structure=replace(polished.structure, arcs=(touching,)))
    assert load(stored(tmp_path, again)).structure == again.structure


def test_file_without_a_structure(tmp_path):
    path = stored(tmp_path)
    with np.load(path) as file:
        parts = dict(file)
    about = json.loads(str(parts["about"]))
    assert about.pop("structure") is None
    np.savez(path.with_suffix(".old.npz"), **{**parts, "about": np.array(json.dumps(about))})
    assert load(path.with_suffix(".old.npz")).structure is None


def test_failed_solution_round_trip(tmp_path):
    refused = solve(replace(PROBLEM, subject_to=(*PROBLEM.subject_to, along(x[0], 2.0, 3.0))), grid=uniform(3))
    assert refused.status is Status.INFEASIBLE
    assert np.isnan(refused.cost)
    assert_equal(load(stored(tmp_path, refused)), refused)


def test_use_without_the_model(tmp_path):
    loaded = load(stored(tmp_path))
    assert loaded.problem is None
    np.testing.assert_array_equal(loaded.signal("x", 0.1), SOLUTION.x(0.1))
    with pytest.raises(ValueError, match=r"loaded without its problem; use load\(path, problem=...\)"):
        loaded.signal("power", 0.1)
    moved = simulate(axis, loaded.states[0, 0], loaded, loaded.nodes)
    np.testing.assert_allclose(moved.x, SOLUTION.x(SOLUTION.nodes), rtol=0, atol=1e-9)


def test_use_with_the_problem(tmp_path):
    loaded = load(stored(tmp_path), problem=PROBLEM)
    t = np.linspace(0.0, SOLUTION.duration, 11)
    np.testing.assert_array_equal(loaded.signal("power", t), SOLUTION.signal("power", t))
    assert str(verify(loaded)) == str(verify(SOLUTION))


def test_scheme_of_the_user_is_in_the_file(tmp_path):
    # Gauss points under a name of the user's own, and under the name of another family.
    for name in ("mine", "radau"):
        own = replace(legendre(2), name=name)
        saved = solve(PROBLEM, scheme=own, grid=uniform(5))
        loaded = load(stored(tmp_path, saved), PROBLEM)
        assert_equal(loaded, saved)
        for field in fields(own):
            np.testing.assert_array_equal(getattr(loaded.scheme, field.name), getattr(own, field.name))
        t = np.linspace(0.0, saved.duration, 7)
        np.testing.assert_array_equal(loaded.x(t), saved.x(t))
        again = solve(PROBLEM, scheme=loaded.scheme, grid=uniform(5), guess=loaded)
        assert again.cost == pytest.approx(saved.cost, rel=1e-9)


def test_damaged_scheme_of_the_user_is_refused(tmp_path):
    saved = solve(PROBLEM, scheme=replace(radau(2), name="mine"), grid=uniform(4))
    path = stored(tmp_path, saved)
    for damage in ({"at": [0, 9]}, {"weights": [1.0]}, {"state": [[1.0, 2.0]]}, {"points": [0.1, None]}, {"degree": 3}):
        with np.load(path) as file:
            parts = dict(file)
        about = json.loads(str(parts["about"]))
        about["scheme"] = about["scheme"] | damage
        damaged = tmp_path / "damaged.npz"
        np.savez(damaged, **{**parts, "about": np.array(json.dumps(about))})
        with pytest.raises(ValueError, match="incomplete or damaged"):
            load(damaged)


def test_use_as_a_guess(tmp_path):
    loaded = load(stored(tmp_path))
    again = solve(PROBLEM, grid=uniform(7), guess=loaded, values={"mass": 1.3})
    assert again.ok
    assert again.duration == pytest.approx(SOLUTION.duration, rel=1e-7)
    assert again.iterations == solve(PROBLEM, grid=uniform(7), guess=SOLUTION, values={"mass": 1.3}).iterations


def test_file_is_open_to_other_readers(tmp_path):
    with np.load(stored(tmp_path), allow_pickle=False) as file:
        limits = {"limits_x", "limits_u", "limits_path", "limits_ends"}
        assert set(file.files) == {"states", "controls", "slopes", "costates", "ends", "about"} | limits
        about = json.loads(str(file["about"]))
        np.testing.assert_array_equal(file["states"], SOLUTION.states)
    assert about["x"] == ["height [m]", "speed [m/s]"]
    assert about["u"] == ["force [N]"]
    assert about["values"] == {"mass": 1.3, "g": SOLUTION.free["g"]}
    assert about["scheme"] == {"name": "radau", "degree": 3, "control": "constant"}
    assert (about["format"], about["version"]) == ("hamel-solution", 2)


def test_suffix_and_rights_are_the_users(tmp_path):
    path = tmp_path / "motion.dat"
    save(SOLUTION, str(path))
    assert [entry.name for entry in tmp_path.iterdir()] == ["motion.dat"]
    plain = tmp_path / "plain"
    plain.touch()
    assert path.stat().st_mode == plain.stat().st_mode


def rewritten(path, **changes):
    """Write the file at path again with other arrays, or other entries of the JSON text."""
    with np.load(path) as file:
        parts = dict(file)
    about = json.loads(str(parts["about"]))
    arrays = {name: value for name, value in changes.items() if name in parts}
    about |= {name: value for name, value in changes.items() if name not in parts}
    np.savez(path, **{**parts, "about": np.array(json.dumps(about)), **arrays})


def without(path, name):
    with np.load(path) as file:
        parts = {key: value for key, value in file.items() if key != name}
    np.savez(path, **parts)


def arc(**changes):
    return {"kinds": ["upper"], "duration": 1.0, "held": [], "touched": []} | changes


STRUCTURE = {"rows": [["u", "upper", 0.0, 1.0]], "arcs": [arc()]}


def structured(part, entry):
    return STRUCTURE | {part: [entry]}


class Bomb:
    def __reduce__(self):
        return (os.mkdir, ("exploded",))


def pickled_array(path):
    with np.load(path) as file:
        parts = dict(file)
    np.savez(path, **{**parts, "states": np.array([Bomb()], dtype=object)})


def one_array():
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    return buffer.getvalue()


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("t,x,u\n0,0,0\n"),
    "picture": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100)),
    "one array": lambda path: path.write_bytes(one_array()),
    "pickle": lambda path: path.write_bytes(pickle.dumps(Bomb())),
    "pickled array": pickled_array,
    "foreign": lambda path: np.savez(path, a=np.zeros(3)),
    "no about": lambda path: without(path, "about"),
    "no states": lambda path: without(path, "states"),
    "about no JSON": lambda path: rewritten(path, about=np.array("{")),
    "about a list": lambda path: rewritten(path, about=np.array("[1]")),
    "about a number": lambda path: rewritten(path, about=np.zeros(2)),
    "newer": lambda path: rewritten(path, version=3),
    "version word": lambda path: rewritten(path, version="2"),
    "other format": lambda path: rewritten(path, format="other"),
    "unknown status": lambda path: rewritten(path, status="PERFECT"),
    "unknown scheme": lambda path: rewritten(path, scheme={"name": "euler", "degree": 3, "control": "constant"}),
    "impossible degree": lambda path: rewritten(path, scheme={"name": "radau", "degree": 99, "control": "constant"}),
    "unknown control": lambda path: rewritten(path, scheme={"name": "radau", "degree": 3, "control": "wild"}),
    "incomplete scheme": lambda path: rewritten(path, scheme={"name": "radau"}),
    "timings": lambda path: rewritten(path, timings={"setup": 1.0}),
    "duration word": lambda path: rewritten(path, duration="long"),
    "states flat": lambda path: rewritten(path, states=np.zeros(4)),
    "states short": lambda path: rewritten(path, states=SOLUTION.states[1:]),
    "states words": lambda path: rewritten(path, states=np.full((7, 4, 2), "a")),
    "costates of another size": lambda path: rewritten(path, costates=np.zeros((7, 3, 5))),
    "structure a word": lambda path: rewritten(path, structure="bang-bang"),
    "structure without arcs": lambda path: rewritten(path, structure={"rows": STRUCTURE["rows"], "arcs": []}),
    "structure without rows": lambda path: rewritten(path, structure={"arcs": STRUCTURE["arcs"]}),
    "structure of unknown kind": lambda path: rewritten(path, structure=structured("rows", ["u", "high", 0.0, 1.0])),
    "structure with a short row": lambda path: rewritten(path, structure=structured("rows", ["u", "upper", 0.0])),
    "structure of two controls": lambda path: rewritten(path, structure=structured("arcs", arc(kinds=["upper"] * 2))),
    "structure of unknown arc": lambda path: rewritten(path, structure=structured("arcs", arc(kinds=["high"]))),
    "structure of duration None": lambda path: rewritten(path, structure=structured("arcs", arc(duration=None))),
    "structure with one side": lambda path: rewritten(path, structure=structured("arcs", arc(held=[[0, 0, 0]]))),
    "grid backwards": lambda path: rewritten(path, ends=SOLUTION.grid.ends[::-1]),
}


@pytest.mark.parametrize("what", DAMAGE)
def test_what_is_no_solution_file_is_refused(tmp_path, monkeypatch, what):
    monkeypatch.chdir(tmp_path)
    path = stored(tmp_path)
    written = path.with_suffix(".tmp.npz")  # where numpy would add a suffix itself
    path.rename(written)
    DAMAGE[what](written)
    with pytest.raises(ValueError, match=written.name):
        load(written)
    assert not Path("exploded").exists()


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.9, 0.999])
def test_truncated_file_is_refused(tmp_path, share):
    path = stored(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=path.name):
        load(path)


def test_changed_bytes_never_change_a_number(tmp_path):
    path = stored(tmp_path)
    content = path.read_bytes()
    refused = 0
    for index in range(0, len(content), 11):
        path.write_bytes(content[:index] + bytes([content[index] ^ 0x55]) + content[index + 1 :])
        try:
            loaded = load(path)
        except ValueError as error:
            assert path.name in str(error)  # noqa: PT017
            refused += 1
        else:
            assert_equal(loaded, SOLUTION)  # a byte without effect, such as a date
    assert refused > len(content) / 11 / 2


def test_missing_file_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing"):
        load(tmp_path / "nothing.npz")
    with pytest.raises(OSError, match="nowhere"):
        save(SOLUTION, tmp_path / "nowhere" / "motion.npz")


def test_failing_save_leaves_the_old_file(tmp_path):
    path = stored(tmp_path)
    before = path.read_bytes()
    with pytest.raises(TypeError, match="JSON"):
        save(replace(SOLUTION, log={"inf_pr": [object()]}), path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_interrupted_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = stored(tmp_path)
    before = path.read_bytes()

    def interrupted(file, **arrays):
        file.write(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(replace(SOLUTION, cost=0.0), path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_save_replaces_an_existing_file(tmp_path):
    path = stored(tmp_path)
    save(replace(SOLUTION, cost=-1.0), path)
    assert load(path).cost == -1.0
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
