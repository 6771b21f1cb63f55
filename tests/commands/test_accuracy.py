import csv
import io
import json
from math import inf, nan

import accuracy
import pytest
from accuracy_bill import table
from accuracy_bill.contenders import Contender, Run
from accuracy_bill.measurement import Progress, Row, against, curves, measure
from accuracy_bill.pareto_front import Curve, Point, cheapest, front, recommend, seconds_to
from accuracy_bill.reference import Reference, extrapolated, polished
from accuracy_bill.scene import machine_scene, problem_scene

LUUS = 2.98227994254784
# Errors fall as seconds^-2: ten times more accuracy costs sqrt(10) times the time.
GRID = Curve("grid", tuple(Point(f"{n}", 1.0 / n**2, float(n)) for n in (1, 10, 100)), continuous=True)
SHARP = Curve("sharp", (Point("only", 1e-9, 20.0),))


def test_front_keeps_what_nothing_beats():
    a, b, c = Point("a", 1e-2, 1.0), Point("b", 1e-4, 2.0), Point("c", 1e-6, 9.0)
    beaten = [Point("slower", 1e-4, 3.0), Point("less accurate", 2e-4, 2.0), Point("as c, later", 1e-6, 10.0)]
    unusable = [Point("breaks limits", 1e-12, 0.1, valid=False), Point("nan", nan, 0.1), Point("inf", 1e-9, inf)]
    assert front([c, *beaten, a, *unusable, b]) == (a, b, c)
    assert front([]) == ()


def test_price_is_interpolated_in_logarithms_only_where_settings_between_exist():
    assert seconds_to(GRID, 1e-3) == pytest.approx(1e-3**-0.5)
    assert seconds_to(GRID, 1e-2) == pytest.approx(10.0)
    assert seconds_to(GRID, 5.0) == 1.0  # the coarsest run is accurate enough, nothing is extrapolated
    assert seconds_to(GRID, 1e-5) == inf
    steps = Curve("steps", GRID.points)
    assert seconds_to(steps, 1e-3) == 100.0
    cheaper = Curve("cheaper", (*GRID.points, Point("1000", 1e-7, 5.0)), continuous=True)
    assert seconds_to(cheaper, 1e-3) == 5.0  # what is more accurate may be cheaper
    with pytest.raises(ValueError, match="tolerance is 0"):
        seconds_to(GRID, 0.0)


def test_luck_is_no_accuracy():
    """An error that changes its sign between two grids is small between them, but not on finer ones."""
    lucky = Curve("lucky", (Point("25", 1e-2, 1.0), Point("50", 1e-7, 2.0), Point("100", 1e-4, 4.0)))
    assert [p.error for p in lucky.lasting] == [1e-2, 1e-4, 1e-4]
    assert seconds_to(lucky, 1e-6) == inf
    assert seconds_to(lucky, 1e-4) == 2.0


def test_failed_and_broken_runs_are_never_taken():
    curve = Curve("c", (Point("broken", 1e-9, 0.1, valid=False), Point("failed", nan, 0.2), Point("good", 1e-3, 1.0)))
    result = cheapest([curve], 1e-2)
    assert result is not None
    assert result[1].label == "good"
    assert cheapest([curve], 1e-6) is None


def test_recommendation_in_words():
    assert recommend([GRID], 1e-2, "s", "t_f") == (
        "For 1e-02 s in t_f take grid, 10, 10 s; ten times more accuracy costs 3.2 times the time."
    )
    assert recommend([GRID, SHARP], 1e-3, "s", "t_f") == (
        "For 1e-03 s in t_f take sharp, only, 20 s; ten times more accuracy costs nothing more: "
        "the same run is at 1.0e-09 s."
    )
    assert recommend([GRID, SHARP], 1e-2, "s", "t_f").endswith(
        "take grid, 10, 10 s; ten times more accuracy costs 2.0 times the time (sharp, only)."
    )
    assert recommend([GRID], 1e-4, "", "J").endswith("100 s; none of those tried is ten times more accurate.")
    assert recommend([GRID], 1e-6, "s", "t_f") == (
        "For 1e-06 s in t_f there is nothing to recommend: the most accurate run, grid, 100, is at 1.0e-04 s "
        "after 100 s."
    )
    assert "no run succeeded" in recommend([], 1e-6, "s", "t_f")


def test_tables_tell_everything(tmp_path):
    rows = [
        Row("a, uniform", "10 elements", True, 1.5, 1e-3, 2e-3, 1e-9, 0.0, 0.1, 0.02, 0.3, 0.42, 3),
        Row("b", "20 elements", True, nan, note="no motion found"),
    ]
    text = table.as_csv(rows, "s")
    read = list(csv.DictReader(io.StringIO(text)))
    assert float(read[0]["error [s]"]) == 1e-3
    assert float(read[0]["total [s]"]) == 0.42
    assert read[1]["note"] == "no motion found"
    shown = table.as_markdown(rows, "t_f", "s", [("a, uniform", "10 elements")], 1e-12).splitlines()
    hidden = table.as_markdown(rows, "t_f", "s", [], 1e-2)
    assert "| < 1.0e-02 |" in hidden
    assert len({line.replace("\\|", "").count("|") for line in shown}) == 1
    assert "**a, uniform**" in shown[2]
    assert "no motion found" in shown[3]
    to = table.to_accuracy([GRID, SHARP], (1e-3, 1e-9), "s", {"rockit": "not installed"}).splitlines()
    assert to[2].startswith("| grid | 31.6 | - | 1.0e-04 in 100 s")
    assert to[3].startswith("| sharp | 20 | 20 |")
    assert to[4] == "| rockit | - | - | not installed |"
    path = tmp_path / "table.csv"
    path.write_text("before")
    with pytest.raises(UnicodeEncodeError):  # found out while the file is being written
        table.write(path, "half \ud800")
    assert path.read_text() == "before"
    table.write(path, text)
    assert path.read_bytes().decode() == text
    assert [p.name for p in tmp_path.iterdir()] == ["table.csv"]


@pytest.mark.slow
def test_contenders_run_in_turn_and_medians_are_taken():
    order, seconds = [], iter([1.0, 9.0, 3.0, 9.0, 2.0, 9.0])

    def contender(name):
        def runs(scene):
            order.append(name)
            yield Run("once", 1.25, next(seconds), 0.5, 0.25)

        return Contender(name, runs)

    lines = []
    rows = measure([contender("a"), contender("b")], problem_scene("P3"), 3, 1e9, Progress(lines.append))
    assert order == list("ababab")
    assert (rows[0].setup, rows[0].total, rows[0].runs) == (2.0, 2.75, 3)
    assert len(lines) == 6
    row = against(rows, Reference(1.0, 1e-6, "by hand"))[0]
    assert row.error == 0.25
    assert curves([row], Reference(1.25, 0.5, "by hand"))[0].points[0].error == 0.5  # not below that of the reference
    seconds = iter([1.0] * 6)
    assert measure([contender("a")], problem_scene("P3"), 3, 0.0, Progress(lines.append))[0].runs == 1
    assert lines[-1].endswith("round 3 of 3 would exceed 0 s with a\n")


def test_extrapolated_reference_states_an_error_that_holds():
    result = extrapolated(problem_scene("P3"), (20, 40))
    assert abs(result.cost - LUUS) <= result.error <= 1e-2


@pytest.mark.slow
def test_bill_of_a_known_optimum(tmp_path, capsys):
    arguments = ["--problem", "P3", "--grids", "8", "16", "--schemes", "radau", "lobatto", "--controls", "constant"]
    assert (
        accuracy.main(
            [
                *arguments,
                "--repeats",
                "2",
                "--output",
                str(tmp_path),
                "--json",
                "--tolerance",
                "0.1",
                "--methods",
                "uniform",
            ]
        )
        == 0
    )
    printed = capsys.readouterr()
    account = json.loads(printed.out)
    assert "round 2 of 2" in printed.err
    with (tmp_path / "accuracy_P3.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(account["rows"]) == 4
    for row in rows:
        assert float(row["error [s]"]) == abs(float(row["cost [s]"]) - LUUS)
        assert 0.0 < float(row["error [s]"]) < 0.2
        parts = [float(row[f"{name} [s]"]) for name in ("setup", "derivatives", "solver")]
        assert all(part >= 0.0 for part in parts)
        assert row["runs"] == "2"
    assert account["recommendation"].startswith("For 1e-01 s in t_f take ")
    assert account["front"]
    assert "Seconds to an error in t_f" in (tmp_path / "accuracy_P3.md").read_text()
    assert (tmp_path / "accuracy_P3.png").stat().st_size > 10_000


@pytest.mark.slow
def test_polished_reference_and_contenders_reach_the_known_optimum(tmp_path, capsys):
    result = polished(problem_scene("P3"))
    assert result is not None
    assert abs(result.cost - LUUS) <= result.error <= 1e-10
    arguments = ["--problem", "P3", "--repeats", "1", "--refine-to", "1e-3", "--tolerance", "1e-9", "--quiet"]
    methods = ["--methods", "refine", "refine+polish"]
    assert accuracy.main([*arguments, *methods, "--output", str(tmp_path), "--json"]) == 0
    account = json.loads(capsys.readouterr().out)
    refined = [row for row in account["rows"] if row["contender"] == "refined to 1e-03"]
    assert len(refined) > 1
    assert refined[-1]["error"] <= 1e-3
    assert [row["total"] for row in refined] == sorted(row["total"] for row in refined)
    for row in account["rows"]:
        assert row["total"] == pytest.approx(row["setup"] + row["derivatives"] + row["solver"])
        assert row["error"] == abs(row["cost"] - LUUS)


def test_lists_make_every_combination_and_none_a_star():
    def names(*arguments):
        options = accuracy.command_line().parse_args(arguments)
        return [c.name for c in accuracy.contenders(machine_scene("torus"), options)]

    star = names()
    assert len(star) == len(set(star)) == 10
    assert star[0] == "canonical, radau(3) constant, uniform"
    product = names("--forms", "hamel", "lagrange", "--schemes", "radau", "lobatto", "--degrees", "1", "4")
    product = [name for name in product if name.endswith("uniform")]
    assert len(product) == 6  # Lobatto has no degree 1


def test_wrong_usage_is_told(capsys):
    assert accuracy.main(["--from", "1", "2"]) == 2
    assert "from: got 2 numbers, spherical has 4 coordinates" in capsys.readouterr().err
