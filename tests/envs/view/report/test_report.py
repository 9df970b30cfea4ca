"""The report is one file, says what was measured, and needs no network."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.plots import time_figure
from haustra.envs.view.report.chart import thin
from haustra.envs.view.report.page import report_html
from haustra.envs.view.report.run_report import report_run
from haustra.envs.view.report.sections import Table, Text
from haustra.envs.view.report.values import name_and_unit, score_table
from haustra.errors import OutputError, UnreadableFileError
from haustra.provenance import file_hash

SCORES = {
    "outcome": "stuck",
    "tip_segment": "sigmoid",
    "tip_arc_m": 0.4321,
    "push_force_peak_N": 17.25,
    "torque_peak_Nm": 0.31,
    "warnings": ["genus 4 <script>"],
    "provenance": {
        "inputs": {"colon": "abc123", "colon_name": "grown 0"},
        "configuration": {"design": {"name": "adult", "shaft": [{"length": 1.5}]}},
    },
}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "scores.json").write_text(json.dumps(SCORES), encoding="utf-8")
    time = np.linspace(0, 60, 200)
    np.savez(tmp_path / "trajectory.npz", time=time, insertion=0.01 * time, push_force=np.sin(time), torque=0 * time)
    write_png(tmp_path / "outside.png", np.full((8, 9, 3), 200, np.uint8))
    return tmp_path


def test_a_run_gets_one_file_that_works_offline(run: Path) -> None:
    page = report_run(run).read_text(encoding="utf-8")
    loaded = re.findall(r'<(?:script|link|img|iframe)[^>]*?(?:src|href)="([^"]*)"', page)
    assert loaded, "the picture is in it"
    assert all(source.startswith("data:") for source in loaded), "nothing is fetched"
    assert "17.25 N" in page
    assert "abc123" in page
    assert "hand, push" in page
    assert "grown 0 · adult" in page
    assert "configuration · design · shaft 1 · length" in page


def test_text_from_files_cannot_run(run: Path) -> None:
    page = report_run(run).read_text(encoding="utf-8")
    assert "genus 4 &lt;script&gt;" in page
    assert "genus 4 <script>" not in page


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match=r"scores\.json"):
        report_run(tmp_path)
    (tmp_path / "scores.json").write_text('{"outcome": "stu', encoding="utf-8")
    with pytest.raises(UnreadableFileError, match="not JSON"):
        report_run(tmp_path)


def test_a_truncated_trajectory_is_refused(run: Path) -> None:
    whole = (run / "trajectory.npz").read_bytes()
    (run / "trajectory.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(UnreadableFileError, match="trajectory"):
        report_run(run)


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("push_force_peak_N", ("push force peak", "N")),
        ("torque_peak_Nm", ("torque peak", "N m")),
        ("intrusion_p95_mm", ("intrusion p95", "mm")),
        ("volume_m3", ("volume", "m³")),
        ("tip_segment", ("tip segment", "")),
        ("dofs", ("dofs", "")),
    ],
)
def test_units_are_read_from_names(key: str, expected: tuple[str, str]) -> None:
    assert name_and_unit(key) == expected


def test_nested_scores_keep_their_place() -> None:
    rows = score_table({"sigmoid": {"end_m": 0.5}, "watertight": True}).rows
    assert [tuple(row) for row in rows] == [("sigmoid · end", "0.5", "m"), ("watertight", "yes", "")]


def test_a_long_curve_is_thinned_without_losing_its_peak() -> None:
    values = np.zeros(100_000)
    values[54_321] = 40.0
    kept = thin(values)
    assert len(kept) <= 3000
    assert values[kept].max() == 40.0
    assert kept[0] == 0
    assert kept[-1] == len(values) - 1


def test_a_page_without_curves_carries_no_plotting_library() -> None:
    assert len(report_html(title="t", sections=[Text("a", ["b"])])) < 20_000


def test_a_ragged_table_is_refused() -> None:
    with pytest.raises(ValueError, match="not as long"):
        Table("t", ("a", "b"), [("1",)])


def test_figure_over_time_is_a_png(tmp_path: Path) -> None:
    time = np.linspace(0, 1, 50)
    path = time_figure(
        tmp_path / "forces.png", time, {"force [N]": {"a": time, "b": 2 * time}, "torque [N m]": {"c": time}}
    )
    assert path.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(OutputError, match="missing"):
        time_figure(tmp_path / "missing" / "forces.png", time, {"force [N]": {"a": time}})


def test_parts_of_two_runs_are_refused(run: Path) -> None:
    scores = SCORES | {"trajectory": file_hash(run / "trajectory.npz")}
    (run / "scores.json").write_text(json.dumps(scores), encoding="utf-8")
    report_run(run)
    np.savez(run / "trajectory.npz", time=np.linspace(0, 1, 9))
    with pytest.raises(UnreadableFileError, match="are of two runs"):
        report_run(run)
