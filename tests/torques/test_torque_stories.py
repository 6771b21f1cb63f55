"""The examples of docs/torques.md run as printed."""

import re
from pathlib import Path

import pytest

STORIES = re.findall(
    r"```python\n(.*?)```",
    (Path(__file__).parents[2] / "docs" / "torques.md").read_text(encoding="utf-8"),
    re.DOTALL,
)


@pytest.mark.parametrize("number", range(len(STORIES)))
def test_a_story_runs_as_printed(number, capsys):
    exec(compile(STORIES[number], f"torques.md, story {number}", "exec"), {})
    assert capsys.readouterr().out


def test_there_are_four():
    assert len(STORIES) == 4
