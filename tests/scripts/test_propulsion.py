"""The published study reproduced: every bar of it, and what lies beyond the paper."""

import json
import math

import pytest

from haustra.scripts.main import main
from haustra.scripts.propulsion import Propulsion


@pytest.fixture(scope="module")
def study() -> dict:
    return Propulsion()()


def test_rows_are_five_speeds_on_two_surfaces(study: dict) -> None:
    assert [(row["surface"], row["speed_mm_s"]) for row in study["rows"]] == [
        (surface, speed) for surface in ("tissue", "plastic") for speed in (16.25, 26.0, 32.5, 43.3, 65.0)
    ]
    assert {row["outcome"] for row in study["rows"]} == {"completed"}
    json.dumps(study, allow_nan=False)


def test_forces_are_the_papers(study: dict) -> None:
    checks = study["checks"]
    assert checks["force_tissue_N"] == pytest.approx(3.0, abs=0.15)
    assert checks["force_plastic_N"] == pytest.approx(1.5, abs=0.08)
    assert checks["surface_ratio"] == pytest.approx(2.0, rel=0.02)
    assert checks["spread_over_speeds_N"] <= 0.15
    assert checks["force_over_mu_normal_worst"] <= 0.005


def test_ripple_is_a_quarter_of_the_force_at_the_tooth_passing_frequency(study: dict) -> None:
    for row in study["rows"]:
        assert row["ripple_fraction_per_track"] == pytest.approx(0.25, abs=0.03)
        assert row["ripple_Hz"] == pytest.approx(row["speed_mm_s"] / 6.5)


def test_half_pitch_spacing_ripples_below_a_twentieth() -> None:
    rows = Propulsion(spacing=3.5, full_range=False, redesign=False)()["rows"]
    assert max(row["ripple_fraction_per_track"] for row in rows) < 0.05
    assert rows[0]["force_N"] == pytest.approx(3.0, abs=0.15)


@pytest.mark.parametrize("where", ["front", "rear", "between"])
def test_stress_is_higher_in_the_low_force_state_by_the_papers_ratio(study: dict, where: str) -> None:
    ratio = study["checks"]["stress_low_over_high"][where]
    assert ratio["ours"] == pytest.approx(ratio["paper"], rel=0.15)


def test_whole_device_peaks_where_the_paper_says_and_beats_its_error(study: dict) -> None:
    for surface, bar in (("tissue", 12.0), ("plastic", 12.0)):
        block = study["full_range"]["surfaces"][surface]
        assert block["peak_rpm"] == 150.0
        assert block["rmse"]["median_percent"] <= bar < block["paper_rmse_percent"]
        for point in block["curve"]:
            assert point["force_N"] == pytest.approx(point["closed_form_N"], rel=0.005)
        assert block["roll_worst_percent"] < 10


def test_redesign_removes_the_ripple_at_the_same_force(study: dict) -> None:
    for choice in (study["redesign"]["best"], study["redesign"]["same_pitch"]):
        assert choice["force_N"] == pytest.approx(3.0, abs=0.15)
        assert choice["ripple_fraction_per_track"] < 0.05
        assert choice["spacing_pitches"] % 1 == pytest.approx(0.5, abs=0.26)


def test_torque_is_force_times_lead_over_efficiency(study: dict) -> None:
    row = study["rows"][0]
    assert row["worm_torque_Nm"] == pytest.approx(row["force_N"] * 13e-3 / (2 * math.pi * 0.3))


def test_command_prints_one_json_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["propulsion", "--json", "--no-full-range", "--no-redesign"]) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == 10


def test_a_worm_that_does_not_mesh_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["propulsion", "--starts", "7", "--json"]) == 2
    assert "No force table" in capsys.readouterr().err
