"""Contexts of use: evidence is what a file says, and nothing is adequate that no figure supports."""

import json
from pathlib import Path

import pytest

from haustra.envs.study.credibility import REQUIRED, applicability, load_context, look_up, missing_categories
from haustra.errors import HaustraError, InvalidStudyError
from haustra.scripts.main import BAD_INPUT, SUCCESS, main

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "credibility" / "insertion-tubes.toml"
HEAD = """
title = "t"
question = "q"
context = "c"
quantity = "x"
decision = "d"
influence = "low"
consequence = "low"
descriptions = []
[[ranges]]
name = "EI"
unit = "N m^2"
low = 0.02
high = 0.04
"""
EVIDENCE = """
[[evidence]]
category = {category}
claim = "error"
command = "haustra bench rods"
file = "page.md"
find = "error of {{figure}} %"
relation = "<="
bound = 2
unit = "%"
"""


def _written(folder: Path, text: str, page: str = "an error\nof 1.5 % here") -> Path:
    (folder / "page.md").write_text(page)
    path = folder / "cou.toml"
    path.write_text(HEAD + text)
    return path


def test_a_figure_is_read_where_it_stands_and_held_to_its_bound(tmp_path: Path) -> None:
    """Line breaks count as spaces; another figure in the file changes the verdict and the hash."""
    context = load_context(_written(tmp_path, EVIDENCE.format(category=1)))
    found = look_up(context.evidence[0], tmp_path)
    assert (found.figure, found.met) == (1.5, True) and len(found.hash) == 16 and found.date.startswith("20")
    (tmp_path / "page.md").write_text("an error of 2.5 % here")
    worse = look_up(context.evidence[0], tmp_path)
    assert (worse.figure, worse.met) == (2.5, False) and worse.hash != found.hash
    assert missing_categories(context, [found]) == [7, 8] and missing_categories(context, [worse]) == [1, 7, 8]
    for page in ("no error at all", "an error of 1 % and an error of 2 %"):
        (tmp_path / "page.md").write_text(page)
        with pytest.raises(InvalidStudyError, match="quote the text"):
            look_up(context.evidence[0], tmp_path)


def test_a_figure_of_a_table_is_told_by_its_values(tmp_path: Path) -> None:
    (tmp_path / "data.toml").write_text(
        "[[m]]\nkind = 'a'\nfine = true\nx = [1, 2]\n[[m]]\nkind = 'b'\nfine = true\nx = [3, 4]"
    )
    text = EVIDENCE.format(category=8).replace("page.md", "data.toml")
    for key, figure in (("m.[kind=b,fine=true].x.1", 4.0), ("m.0.x.0", 1.0)):
        changed = text.replace('find = "error of {figure} %"', f'key = "{key}"')
        assert look_up(load_context(_written(tmp_path, changed)).evidence[0], tmp_path).figure == figure
    for key in ("m.[fine=true].x.1", "m.2.x.0", "m.0.y", "m.0.kind"):
        changed = text.replace('find = "error of {figure} %"', f'key = "{key}"')
        with pytest.raises(InvalidStudyError, match="holds no"):
            look_up(load_context(_written(tmp_path, changed)).evidence[0], tmp_path)


def test_applicability_is_the_factor_to_the_next_validation_point(tmp_path: Path) -> None:
    """From 0.04 to 0.01 it is 4 times; points at both ends cover the range between them."""
    point = '[[points]]\nname = "p"\nfile = "page.md"\ncategory = 3\nvalues = [["EI", {}]{}]\n'
    (one,) = applicability(load_context(_written(tmp_path, point.format(0.01, ""))))
    assert one.factor == pytest.approx(4.0) and not one.covered and one.within == 0
    (both,) = applicability(load_context(_written(tmp_path, point.format(0.02, ', ["EI", 0.05]'))))
    assert both.factor == pytest.approx(1.25) and both.covered and both.within == 1
    (none,) = applicability(load_context(_written(tmp_path, "")))
    assert none.factor is None and not none.covered


def test_risk_is_the_mean_of_influence_and_consequence_rounded_up(tmp_path: Path) -> None:
    def risk(influence: str, consequence: str) -> str:
        path = _written(tmp_path, "")
        path.write_text(
            path.read_text()
            .replace('influence = "low"', f'influence = "{influence}"')
            .replace('consequence = "low"', f'consequence = "{consequence}"')
        )
        return load_context(path).risk

    assert [risk("low", "low"), risk("medium", "low"), risk("low", "high"), risk("high", "medium")] == [
        "low",
        "medium",
        "medium",
        "high",
    ]
    assert set(REQUIRED["low"]) < set(REQUIRED["medium"]) < set(REQUIRED["high"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (EVIDENCE.format(category=9), "category is 9"),
        (EVIDENCE.format(category=1).replace("{figure}", "1.5"), "give {figure} once"),
        (EVIDENCE.format(category=1) + 'key = "a.b"\n', "either find or key"),
        ('[[points]]\nname = "p"\nfile = "f"\ncategory = 3\nvalues = [["GJ", 1]]\n', "'GJ' is not known"),
        ("[[surprise]]\na = 1\n", "'surprise' is not known"),
    ],
)
def test_a_context_that_cannot_be_is_refused_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(HaustraError) as found:
        load_context(_written(tmp_path, text))
    assert said in str(found.value) and "\n" not in str(found.value)


def test_the_worked_example_is_written_and_claims_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every figure that it names stands in its file; not run, with no bench test, it is adequate for nothing."""
    assert main(["credibility", str(EXAMPLE), "-o", str(tmp_path), "--no-run", "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert not found["adequate"] and found["uncertainty"] is None and len(found["evidence"]) >= 6
    assert "validation on the bench" in found["missing"]
    page = (tmp_path / "credibility-assessment.html").read_text()
    assert page.count("<td>none</td>") > 12 and "Not adequate for" in page
    assert "No figure within its bound: validation on the bench." in page
    details = (tmp_path / "model-details.html").read_text()
    assert "mesentery.stiffness" in details and "engineering choice" in details


def test_a_command_that_is_not_known_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _written(tmp_path, EVIDENCE.format(category=1).replace("haustra bench rods", "haustra prove it"))
    assert main(["credibility", str(path), "-o", str(tmp_path / "out")]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "evidence[0].command" in said and said.count("\n") == 1
    assert not (tmp_path / "out").exists()
