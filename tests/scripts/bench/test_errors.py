"""Errors are ranges over ten colons or more, each against a converged run; finished tracks are kept."""

from pathlib import Path

import pytest

from haustra.models.accuracy import load_measured
from haustra.models.anatomy.store import save_colon
from haustra.scripts.bench.accuracy.errors import (
    Asked,
    Ranges,
    accuracy_toml,
    measure_errors,
    ranges_of,
    refusals,
)
from haustra.scripts.main import BAD_INPUT, main
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


def test_a_finer_model_is_nearer_and_finished_tracks_are_kept(tmp_path: Path):
    save_colon(swept_colon(winding([(0.05, 0.0), (0.06, 1.4), (0.1, 0.0)]), name="bent tube"), tmp_path / "bend")
    asked = Asked(
        grown=0,
        folders=(tmp_path / "bend",),
        designs=("adult",),
        laws=("planes",),
        presets=("fast",),
        mesentery=(False,),
        seconds=0.8,
    )
    rows = measure_errors(asked, tmp_path / "kept")
    coarser, fast = rows
    assert coarser["preset"] == "coarser reference" and fast["preset"] == "fast" and fast["kind"] == "real"
    assert coarser["tip_mm"] < fast["tip_mm"]
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "kept").rglob("*.npz")}
    assert len(before) == 4, "script, reference, coarser reference, fast"
    assert measure_errors(asked, tmp_path / "kept") == rows
    assert {file: file.stat().st_mtime_ns for file in before} == before


def _row(colon: int, wall_force: float | None, **changes) -> dict:
    return {
        "colon": f"grown-{colon}", "kind": "grown", "design": "adult", "mesentery": False, "wall_law": "planes",
        "wall": "", "preset": "balanced", "cost": 0.1, "wall_force": wall_force,
        "push": wall_force and wall_force / 2, "tip_mm": wall_force and 10 * wall_force, **changes,
    }  # fmt: skip


WHERE = {"date": "2026-11-22"}


def test_ten_colons_make_a_range_that_runs_state(tmp_path: Path):
    ranges = ranges_of([_row(colon, 0.1 + 0.01 * colon) for colon in range(10)])
    (tmp_path / "a.toml").write_text(accuracy_toml(ranges, Asked(), WHERE), encoding="utf-8")
    (entry,) = load_measured(tmp_path / "a.toml")
    assert entry.error.wall_force == (0.1, 0.19)
    assert entry.colons == 10 and entry.preset == "balanced"
    assert "haustra bench errors" in entry.error.measured_on


def test_what_is_not_measured_now_stays(tmp_path: Path):
    ranges = ranges_of([_row(colon, 0.1 + 0.01 * colon) for colon in range(10)])
    file = tmp_path / "a.toml"
    file.write_text(accuracy_toml(ranges, Asked(), WHERE), encoding="utf-8")
    other = ranges_of([_row(colon, 0.3, wall_law="table") for colon in range(10)])
    file.write_text(accuracy_toml(other, Asked(), WHERE, before=load_measured(file)), encoding="utf-8")
    assert [(each.wall_law, each.error.wall_force) for each in load_measured(file)] == [
        ("planes", (0.1, 0.19)),
        ("table", (0.3, 0.3)),
    ]
    fallen = ranges_of([_row(colon, None if colon == 3 else 0.1) for colon in range(11)])
    file.write_text(accuracy_toml(fallen, Asked(), WHERE, before=load_measured(file)), encoding="utf-8")
    assert [each.wall_law for each in load_measured(file)] == ["table"]


def test_few_real_colons_widen_the_range_of_the_grown_ones():
    grown = [_row(colon, 0.1 + 0.01 * colon) for colon in range(10)]
    text = accuracy_toml(ranges_of([*grown, {**_row(10, 0.4, kind="real"), "colon": "edin"}]), Asked(), WHERE)
    assert text.count("[[measured]]") == 2
    assert "11 real and grown colons" in text and "wall_force = [0.1, 0.4]" in text


@pytest.mark.parametrize(
    "rows",
    [
        [_row(colon, 0.1) for colon in range(9)],
        [_row(colon, None if colon == 3 else 0.1) for colon in range(11)],
        [_row(colon, 0.1, preset="coarser reference") for colon in range(10)],
    ],
)
def test_nine_colons_a_model_that_fell_over_and_references_are_not_stated(rows: list[dict]):
    assert "[[measured]]" not in accuracy_toml(ranges_of(rows), Asked(), WHERE)


def test_what_fell_over_and_what_was_refused_is_said():
    rows = [_row(0, None), _row(1, 0.1), {**_row(2, None, preset="fast"), "refused": "no such wall"}]
    (found,) = ranges_of(rows)
    assert isinstance(found, Ranges) and found.fallen == 1 and found.colons == 1
    assert refusals(rows) == {"planes fixed fast": "no such wall"}


def test_an_unknown_law_is_refused_by_name(tmp_path: Path, capsys):
    assert main(["bench", "errors", "-o", str(tmp_path), "--laws", "meshes"]) == BAD_INPUT
    assert "Known: pieces, planes, table" in capsys.readouterr().err
