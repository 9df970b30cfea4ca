"""`haustra bench injury`, with few short runs: the page says what was measured."""

import json

import pytest

from haustra.scripts.main import SUCCESS, main


@pytest.mark.thorough
def test_page_pictures_and_table_of_few_runs(tmp_path, capsys):
    folder = tmp_path / "injury"
    arguments = ["bench", "injury", "-o", str(folder), "--colons", "2", "--seconds", "2", "--json"]
    assert main(arguments) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    page = (folder / "injury.md").read_text(encoding="utf-8")
    assert all(row["on the mesentery"] in page for row in found["rows"])
    for name in ("injury.png", "injury-map.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    assert len(found["runs"]) == 4
    assert {"splenic_flexure", "hepatic_flexure"} < found["runs"][0]["pain_by_site"].keys()
    for run in found["runs"]:
        assert 0 <= run["p_perforation"] <= 1 and run["pain_peak"] == max(run["pain_by_site"].values())
