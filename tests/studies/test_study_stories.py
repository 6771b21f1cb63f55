"""The example study is what docs/studies.md says."""

from pathlib import Path

from reports import study_file

ROOT = Path(__file__).parents[2]


def test_the_example_is_a_study_of_200_cases(tmp_path):
    study, _ = study_file.load(ROOT / "scripts" / "scenes" / "study.toml", tmp_path / "s.db")
    assert len(study.cases) == 200
    assert study.polished
    assert study.function.symbols == ("payload.mass",)
