"""What is read leniently in a URDF file, what is noted, what is refused beside broken files."""

import pytest
from rigid_bodies.urdf_texts import GOOD, joint, robot

from models import from_urdf


def test_names_with_spaces_around_them_are_the_same_names(file):
    arm = from_urdf(file(GOOD.replace('name="q2"', 'name=" q2 "').replace('link="b"', 'link=" b"')), "b")
    assert [c.name for c in arm.coordinates] == ["q1", "q2"]
    assert len(from_urdf(file(GOOD.replace('name="q2"', 'name=" q2 "')), lock={"q2": 0.3}).coordinates) == 1


def test_what_no_robot_has_is_noted(file):
    assert from_urdf(file(GOOD)).notes == ()
    millimetres = from_urdf(file(GOOD.replace('xyz="0 0 0.5"', 'xyz="0 0 500"')))
    assert any("500 m; lengths of a URDF file are metres" in note for note in millimetres.notes)
    heavy = from_urdf(file(GOOD.replace('ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="1e5" iyy="1e5" izz="1e5"', 1)))
    assert any("radius of gyration is large: 223.6 m" in note for note in heavy.notes)
    outside = from_urdf(file(GOOD), lock={"q1": 7.0})
    assert outside.notes == ("joint 'q1' is fixed at 7, outside its range -1 to 2",)
    assert from_urdf(file(GOOD), lock={"q1": 1.0}).notes == ()


def test_a_joint_that_is_fixed_has_nothing_to_lock(file):
    text = robot(joint("q1", "base", "a"), joint("grip", "a", "b", kind="fixed"), links=("base", "a", "b"))
    with pytest.raises(ValueError, match="lock: joint 'grip' is fixed by the file and has no coordinate"):
        from_urdf(file(text), lock={"grip": 0.1})
