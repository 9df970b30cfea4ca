"""The benchmark of colons that move: its runs hold together, and it compares like with like."""

import json

import pytest

from haustra.scripts.bench.motion import COMPARED, GAS, PATIENTS, PLAIN, WATER, effects, soundness, with_base
from haustra.scripts.bench.pages.motion_page import motion_page
from haustra.scripts.main import SUCCESS, main


def _row(colon: str, patient: str, **changed) -> dict:
    usual = dict.fromkeys(COMPARED, 1.0) | {
        "outcome": "time_up",
        "p_perforation": 0.0,
        "driver": "follower",
        "seconds": 60.0,
        "judged_every": 1.0,
    }
    usual |= {"turned_over_max_share": 0.0, "outside_surface_max_mm": 0.0, "colon_moved_peak_mm": 10.0}
    usual["surface_records"] = 60
    return {"colon": colon, "patient": patient, **usual, **changed}


def test_changes_are_those_of_the_same_colon_and_escapes_must_be_said() -> None:
    plain = [_row(f"grown-{n}", PLAIN, tip_arc_max_m=1.0 + n) for n in range(4)]
    left = [_row(f"grown-{n}", "on the left side", tip_arc_max_m=1.1 + n + 0.01 * n) for n in range(4)]
    rest = [_row(f"grown-{n}", name) for n in range(4) for name in PATIENTS if name not in (PLAIN, "on the left side")]
    longer = [_row(f"grown-{n}", PLAIN, seconds=120.0, tip_arc_max_m=9.0) for n in range(4)]  # compared with none
    rows = [*plain, *left, *rest, *longer]
    found = {entry["patient"]: entry["tip_arc_max_m"] for entry in effects(rows)}
    assert found["on the left side"]["change"] == pytest.approx(0.115)
    assert found["on the left side"]["half_interval"] == pytest.approx(3.182 * 0.0129 / 2, rel=1e-2)
    assert "**+0.115 ± 0.021**" in motion_page({"runs": rows})
    assert "300 mL of that as water, against gas let in up to 25 mmHg" in motion_page({"runs": rows})
    torn = _row("grown-9", PLAIN, outcome="escaped", p_perforation=0.5, turned_over_max_share=0.02)
    sound = soundness([*rows, torn])
    assert (sound["escaped"], sound["escaped_unsaid"], sound["turned_over_max_share"]) == (1, 1, 0.02)
    assert sound["pictures"] == 0 and "not looked at" in motion_page({"runs": rows})


def test_who_is_compared_with_another_is_not_run_without_it() -> None:
    """Water was left out of the table without a word where nobody had asked for gas alone."""
    assert with_base([WATER]) == (PLAIN, GAS, WATER) and with_base(["breathing"]) == (PLAIN, "breathing")
    assert with_base(tuple(PATIENTS)) == tuple(PATIENTS)


def test_a_row_that_has_nothing_to_be_compared_with_says_so() -> None:
    """Rows of an earlier file may hold water without the gas that it differs from."""
    rows = [_row(f"grown-{n}", name) for n in range(3) for name in (PLAIN, WATER)]
    assert WATER not in {entry["patient"] for entry in effects(rows)}
    assert f"| {WATER} | not compared: nobody was run with {GAS}" in motion_page({"runs": rows})


def test_a_surface_is_told_up_to_the_record_at_which_a_scope_is_found_outside() -> None:
    shares = {"turned_over_before_end_share": 0.0, "outside_before_end_mm": 0.1}
    torn = _row("EdinGCA", PLAIN, outcome="escaped", p_perforation=1.0, turned_over_max_share=0.02, **shares)
    assert soundness([torn])["outside_before_end_mm"] == 0.1
    page = motion_page({"runs": [torn]})
    assert "| largest share of triangles | 2.000% | 0 |" in page and "| 0.000%; 0.10 mm | 0; 0.5 mm |" in page
    assert soundness([torn, _row("EdinGCA", PLAIN)])["outside_before_end_mm"] is None


def test_a_last_picture_from_outside_is_counted() -> None:
    shares = {"last_picture_mucosa_share": 0.9, "last_picture_outside": True, "pictures_outside": 3}
    shares |= {"last_picture_across_share": 0.1, "picture_across_max_share": 0.2}
    rows = [_row("EdinGCA", PLAIN, **shares), _row("EdinGCA", PLAIN, driver="insertion", **shares)]
    sound = soundness(rows)
    assert (sound["last_pictures_from_outside"], sound["last_picture_mucosa_min_share"]) == (2, 0.9)
    page = motion_page({"runs": rows})
    rows[0]["outside_surface_records"] = 3000
    assert "| records of a run at which that was seen | 60 to 3000 |" in motion_page(
        {"runs": [*rows, rows[1] | {"driver": "follower"}]}
    )
    assert "| EdinGCA, follower, 60 s, judged every 1 s | EdinGCA, insertion, 60 s" in page
    assert "of all that were judged | 1; 3 | 1; 3 | 0 |" in page


@pytest.mark.thorough
def test_it_runs_and_leaves_a_page(tmp_path, capsys) -> None:
    words = ["bench", "motion", "-o", str(tmp_path), "--colons", "2", "--seconds", "2", "--json"]
    assert main(words) == SUCCESS
    said = json.loads(capsys.readouterr().out)["soundness"]
    assert said["runs"] == 2 * len(PATIENTS) and said["diverged"] == 0
    assert said["turned_over_max_share"] == 0.0 and said["outside_surface_max_mm"] == 0.0
    assert "The patient around it" in (tmp_path / "motion.md").read_text(encoding="utf-8")
