"""The page of benchmarks says what was measured, and what was not reached first of all."""

from pathlib import Path

from haustra.scripts.bench.report import report_bench, said
from tests.scripts.bench.test_result import BENCH


def test_the_page_holds_bars_fronts_and_tables(tmp_path: Path) -> None:
    page = report_bench(tmp_path, [BENCH]).read_text(encoding="utf-8")
    assert "Not met: error: nothing finite %, at most 0.1 %" in page
    assert "2 of 4" in page
    assert "How far does it bend?" in page
    assert "Not drawn: timestep=0.02 (diverged)" in page
    assert "cost s" in page


def test_a_bar_in_one_line() -> None:
    assert said(BENCH.criteria[0]) == "order: 1.99, at least 1.8"
