"""`haustra tread fem`: tables, figures, and going on where it was cut short."""

import json
from pathlib import Path

import pytest

pytest.importorskip("skfem")
from haustra.scripts.main import main

QUICK = ["tread", "fem", "--parts", "table", "--table-mm", "0.05", "--phases", "1", "--json"]


def test_a_part_that_is_done_is_not_solved_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*QUICK, "-o", str(tmp_path)]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["reused"] == {"table": False}
    assert first["table"][0]["contact_N"] > 0.05
    assert {path.name for path in tmp_path.iterdir()} >= {"table.csv", "force_indentation_phase.png", "provenance.json"}

    assert main([*QUICK, "-o", str(tmp_path), "--no-figures"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["reused"] == {"table": True}
    assert again["table"] == first["table"]


def test_other_settings_are_solved_afresh(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    solved = [{"phase": 0.0, "contact_N": 1.0}]
    monkeypatch.setattr("haustra.models.devices.tracked.fem.study.force_table", lambda *_, **__: solved)
    (tmp_path / "table.json").write_text('{"settings": {"friction": 0.1}, "rows": []}')
    assert main([*QUICK, "-o", str(tmp_path), "--no-figures"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["reused"], found["table"]) == ({"table": False}, solved)
