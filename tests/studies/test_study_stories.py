"""The examples of docs/studies.md and the example study run as printed."""

import re
from pathlib import Path

import pytest
from reports import study_file

ROOT = Path(__file__).parents[2]
STORIES = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "studies.md").read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("number", range(len(STORIES)))
def test_a_story_runs_as_printed(number, capsys):
    exec(compile(STORIES[number], f"studies.md, story {number}", "exec"), {"__name__": __name__})
    assert capsys.readouterr().out


def test_there_are_two():
    assert len(STORIES) == 2


def test_the_example_is_a_study_of_200_cases(tmp_path):
    study, _ = study_file.load(ROOT / "scripts" / "scenes" / "study.toml", tmp_path / "s.db")
    assert len(study.cases) == 200
    assert study.polished
    assert study.function.symbols == ("payload.mass",)
