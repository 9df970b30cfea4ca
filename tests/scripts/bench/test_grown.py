"""Grown colons against published anatomy, on a few seeds; `haustra bench grown` does it on 200."""

from pathlib import Path

import numpy as np
import pytest

from haustra.errors import UnreadableFileError
from haustra.scripts.bench.grown import Published, compare, measure_cases, published_figures

SEEDS = range(2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cases")


@pytest.fixture(scope="module")
def rows(folder: Path) -> list[dict]:
    return measure_cases(folder, SEEDS)


@pytest.mark.thorough
def test_no_grown_colon_crosses_itself(rows: list[dict]):
    assert len(rows) == len(SEEDS)
    assert not [row for row in rows if "failed" in row or row["crossings"]]


def test_lengths_and_diameters_lie_in_their_sources_intervals(rows: list[dict]):
    verdicts = compare(rows)
    asked = [v for v in verdicts if v.published.measure.endswith((".length_m", ".diameter_m"))]
    assert len(asked) > 12
    # Two cases can fail but not pass.
    assert not [v for v in asked if v.shown and not v.passed]
    assert not [v for v in asked if v.passed]


def test_finished_cases_are_kept(rows: list[dict], folder: Path):
    before = {file: file.stat().st_mtime_ns for file in (folder / "japan-ctc").iterdir()}
    assert measure_cases(folder, SEEDS) == rows
    assert {file: file.stat().st_mtime_ns for file in before} == before


def test_a_damaged_case_is_named(tmp_path: Path):
    (tmp_path / "japan-ctc").mkdir()
    (tmp_path / "japan-ctc" / "000000.json").write_text("{")
    with pytest.raises(UnreadableFileError, match=r"000000\.json"):
        measure_cases(tmp_path, [0])


def test_a_mean_that_is_off_and_a_spread_that_is_off_do_not_pass():
    figure = Published("x", "", "mean and sd", mean=1.0, sd=0.1, n=300, low=None, high=None, source="a test")
    rng = np.random.default_rng(0)

    def passed(mean: float, sd: float) -> bool:
        values = mean + sd * rng.standard_normal(200)
        return compare([{"x": x, "cohort": "", "sex": ""} for x in values], [figure])[0].passed

    assert passed(1.0, 0.1)
    assert not passed(1.15, 0.1)
    assert not passed(1.0, 0.2)


def test_fewer_colons_do_not_turn_a_figure_that_is_missed_into_one_that_is_met():
    """An interval over few colons is wide: they show nothing, where a difference had to exceed its interval to fail."""
    figure = Published("x", "", "mean and sd", mean=1.0, sd=0.1, n=300, low=None, high=None, source="a test")
    values = 1.15 + 0.1 * np.random.default_rng(0).standard_normal(200)
    many, few = (
        compare([{"x": x, "cohort": "", "sex": ""} for x in chosen], [figure])[0] for chosen in (values, values[:3])
    )
    assert many.shown and not many.passed
    assert not few.shown and not few.passed


def test_every_published_figure_names_its_source_and_a_rule():
    for figure in published_figures():
        assert figure.source
        if figure.rule.startswith("mean") and figure.rule in ("mean", "mean and sd"):
            assert figure.mean is not None and figure.n is not None
        else:
            assert figure.low is not None or figure.high is not None
