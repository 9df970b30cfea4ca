"""`haustra sweep`, `optimise`, `sensitivity` and `report` as a user calls them."""

import json
from pathlib import Path

import pytest

from haustra.scripts.main import BAD_INPUT, SUCCESS, main

STUDY = """
question = "propulsion"
[[variables]]
name = "spacing"
path = "drive.spacing_pitches"
unit = "1"
nominal = 3
low = 2
high = 4
levels = 3
[conditions]
friction = [0.2, 0.4]
speed = [0.0325]
[sampler]
count = 4
[budget]
trials = 4
[[objectives]]
score = "ripple_fraction"
goal = "minimise"
"""


@pytest.fixture
def study(tmp_path: Path) -> str:
    (tmp_path / "pads.toml").write_text(STUDY, encoding="utf-8")
    return str(tmp_path / "pads.toml")


@pytest.mark.parametrize(
    ("verb", "jobs"),
    [("sweep", 3 * 2), ("optimise", 4 * 2), ("sensitivity", 4 * 3 * 2)],
)
def test_a_study_ends_in_one_document_tables_and_a_report(study, tmp_path, capsys, verb, jobs) -> None:
    folder = tmp_path / "out"
    assert main([verb, study, "-o", str(folder), "--workers", "2", "--json"]) == SUCCESS
    result = json.loads(capsys.readouterr().out)
    assert (result["finished"], result["failed"], result["diverged"]) == (jobs, 0, 0)
    for name in ("results.csv", "results.parquet", "results.json", "results.md", "report.html", "sweep.sqlite"):
        assert (folder / name).is_file()
    assert main([verb, study, "-o", str(folder), "--json"]) == BAD_INPUT
    assert "--resume" in capsys.readouterr().err
    assert main(["report", str(folder), "--compare", "0", "1", "--json"]) == SUCCESS
    rows = json.loads(capsys.readouterr().out)["comparison"]
    assert {row["design"] for row in rows} == {"design 0", "design 1"}


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["sweep", "nothing.toml", "-o", "x"], "Cannot read the study"),
        (["sweep", "bare", "-o", "x"], "is no study"),
        (
            ["sweep", "propulsion", "-o", "x", "--backend", "abacus"],
            "Backend 'abacus' does not answer",
        ),
        (["sweep", "propulsion", "-o", "x", "--workers", "0"], "--workers is 0; give"),
        (["report", ".", "--compare", "0", "1"], "holds no sweep"),
    ],
)
def test_bad_input_ends_in_one_line(arguments, complaint, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*arguments, "--json"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert complaint in said.splitlines()[-1]


def test_a_call_that_was_refused_does_not_stand_in_the_way(study, tmp_path, monkeypatch, capsys) -> None:
    from haustra.envs.study import run
    from haustra.errors import MissingDependencyError

    def refused(*_args, **_options):
        raise MissingDependencyError("Nothing is there.")

    folder = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(run, "job_map", refused)
        assert main(["sweep", study, "-o", str(folder), "--json"]) == BAD_INPUT
    assert main(["sweep", study, "-o", str(folder), "--workers", "0"]) == BAD_INPUT
    capsys.readouterr()
    assert main(["sweep", study, "-o", str(folder), "--workers", "1", "--json"]) == SUCCESS
    assert json.loads(capsys.readouterr().out)["finished"] == 6


def test_a_title_is_no_markup(tmp_path, capsys) -> None:
    path = tmp_path / "pads.toml"
    rest = STUDY.replace("levels = 3", "levels = 1")
    path.write_text('title = "[/N] <b>\\u001b"\n' + rest, encoding="utf-8")
    assert main(["sweep", str(path), "-o", str(tmp_path / "out")]) == BAD_INPUT
    assert "\x1b" not in capsys.readouterr().err
    path.write_text('title = "[/N] <b>"\n' + rest, encoding="utf-8")
    assert main(["sweep", str(path), "-o", str(tmp_path / "out")]) == SUCCESS
    assert "[/N] <b>" in capsys.readouterr().out
    assert "&lt;b&gt;" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
