"""`haustra bench gas`, with few people: the page says what was measured, and what a few can tell is met."""

import json

import pytest

from haustra.scripts.main import SUCCESS, main


@pytest.mark.thorough
def test_page_picture_and_table_of_few_people(tmp_path, capsys):
    folder = tmp_path / "gas"
    assert (
        main(["bench", "gas", "-o", str(folder), "--people", "60", "--grown", "2", "--seconds", "1", "--json"])
        == SUCCESS
    )
    found = json.loads(capsys.readouterr().out)
    page = (folder / "gas.md").read_text(encoding="utf-8")
    assert all(row["grown"] in page for row in found["rows"])
    assert (folder / "gas.png").read_bytes().startswith(b"\x89PNG")
    verdict = {row["figure"].partition(" ")[0]: row[""] for row in found["rows"]}
    assert verdict["gas"] == "met" and verdict["pressure"] == "met" and verdict["segment"] == "met"
