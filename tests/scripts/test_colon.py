import json
from pathlib import Path

import pytest

from haustra.models.anatomy.store import load_colon
from haustra.scripts.main import BAD_INPUT, SUCCESS, main

KEYS = {
    "length_m",
    "volume_m3",
    "triangles",
    "watertight",
    "genus",
    "segments",
    "centreline_min_clearance_m",
    "seconds",
    "warnings",
}


def test_grow_prints_one_json_document_and_saves_the_colon(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["colon", "grow", "--seed", "3", "-o", str(tmp_path / "colon"), "--json"]) == SUCCESS
    measures = json.loads(capsys.readouterr().out)
    assert measures.keys() >= KEYS
    assert set(measures["segments"]["sigmoid"]) == {"start_m", "end_m", "mean_diameter_m"}
    assert load_colon(tmp_path / "colon").centreline.length == measures["length_m"]


@pytest.mark.parametrize(
    ("name", "content"),
    [("missing.stl", None), ("empty.stl", b""), ("noise.stl", b"\x07" * 999), ("notes.txt", b"hello")],
)
def test_bad_file_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str], name, content):
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)
    assert main(["colon", "import", str(file), "--units", "mm", "-o", str(tmp_path / "out")]) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    message = [line for line in captured.err.splitlines() if line.startswith("haustra:")]
    assert len(message) == 1 and name in message[0]
    assert not list((tmp_path / "out").glob("*")), "nothing may be left in the output folder"


def test_unwritable_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "file").write_text("")
    assert main(["colon", "grow", "-o", str(tmp_path / "file" / "colon")]) == BAD_INPUT
    assert "Cannot write" in capsys.readouterr().err
