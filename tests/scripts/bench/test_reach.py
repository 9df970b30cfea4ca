"""What `haustra bench reach` measures: the robot at a string pulls as the rigs say; runs, reasons and the page."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.outcome import Outcome
from haustra.models.anatomy.store import save_colon
from haustra.models.devices.base import load_device
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.tracked.published import STRESSES_KPA
from haustra.scripts.bench.pages.reach_page import reach_page
from haustra.scripts.bench.reach import (
    AT_ONCE,
    FIRST_SEED,
    bench_reach,
    bench_within,
    held_run,
    reach_within,
    sizes,
    slip_work,
    stopped_by,
    summary,
)
from tests.ring_wall import bent_colon


def robot() -> TrackedRobot:
    found = load_device("tracked")
    assert isinstance(found, TrackedRobot)
    return found


def wide() -> TrackedRobot:
    found = load_device("tracked-wide")
    assert isinstance(found, TrackedRobot)
    return found


@pytest.mark.parametrize(("friction", "rpm"), [(0.4, 75.0), (0.4, 300.0), (0.2, 150.0)])
def test_the_robot_that_drives_in_colons_pulls_in_a_straight_tube_as_on_the_rigs(friction: float, rpm: float) -> None:
    """Within 2 % over the paper's speeds; struts on bellows let the string's ripple be small."""
    row = held_run(robot(), friction, rpm)
    assert abs(row["difference"]) < 0.02
    assert row["ripple"] < 0.1 and 0.0 < row["track_ripple"] < 0.25
    low, high = STRESSES_KPA["between"]["high"], STRESSES_KPA["front"]["low"]
    assert low < row["stress_mean_kPa"] < high < row["stress_peak_kPa"] * 1.2


def test_readings_tell_what_stopped_it_and_what_its_treads_rubbed() -> None:
    time = np.linspace(0.02, 20.0, 1000)
    still = {"time": time, "tip_arc": np.full(1000, 0.3), "traction": np.full(1000, 0.1), "worm_share": np.ones(1000)}
    still |= {"width": np.full(1000, 0.03), "normal": np.ones(1000), "core_force": np.zeros(1000)}
    told = {
        "treads that slip": {},
        "the core against the wall": {"core_force": np.full(1000, 0.5)},
        "a lumen too wide": {"width": np.full(1000, 0.0379)},
        "the worm's torque limit": {"worm_share": np.zeros(1000)},
    }
    for reason, changed in told.items():
        assert stopped_by(robot(), Outcome.STUCK, {**still, **changed}) == reason
    assert stopped_by(robot(), Outcome.COMPLETED, still) == "the caecum"
    assert slip_work(robot(), still) == pytest.approx(0.1 * robot().design.tread_speed(150) * 19.98)


def test_runs_are_kept_and_the_page_holds_them(tmp_path: Path) -> None:
    row = {"seed": FIRST_SEED, "came_m": 0.1, "reach": 0.2, "stopped_by": "time", "wall_force_peak_N": 0.3}
    row |= {"track_force_mean_N": 0.1, "slip_work_J": 0.002, "wall_pressure_peak_kPa": 90.0}
    row |= {"wall_pressure_mean_kPa": 40.0, "start_m": 0.13, "simulated_s": 30.0, "stopped_in": "sigmoid"}
    row |= {"lumen_there_m": 0.035, "width_there": 0.03, "worm_share_there": 0.2, "normal_there": 2.0}
    row |= {"core_force_there": 0.5}
    asked = {"device": json.loads(json.dumps(robot().describe())), "seconds": 2.0}
    (tmp_path / f"tracked-{FIRST_SEED}.json").write_text(json.dumps({"asked": asked, "row": row}))
    rows = bench_reach(robot(), tmp_path, colons=1, seconds=2.0)
    assert rows == [row]
    other = {**row, "came_m": 0.3}
    held = {"surface": "tissue", "rpm": 150, "force_N": 0.19, "difference": 0.01, "ripple": 0.02, "track_ripple": 0.1}
    held |= {"stress_mean_kPa": 80.0, "stress_peak_kPa": 110.0, "slip_power_W": 1e-3}
    none = {"seed": 2, "start_m": None, "came_m": 0.0, "reach": 0.0, "stopped_by": "it fits nowhere"}
    found = {
        "tracked": {"summary": summary(rows), "held": [held], "runs": [*rows, {**row, "seed": 1, "came_m": 9.0}, none]},
        "longer": {"summary": summary([other]), "held": [], "runs": [other]},
    }
    found["tracked"]["design"], found["longer"]["design"] = sizes(robot()), sizes(wide())
    assert "real people" not in reach_page({"seconds": 2.0, "robots": found})
    for each, way in (("tracked", 0.02), ("longer", 0.06)):
        found[each]["within"] = {"X": [{**row, "asked_m": 0.1, "came_m": way}, {**row, "asked_m": 0.3, "came_m": 0.0}]}
    page = reach_page({"seconds": 2.0, "robots": found})
    assert "| 0.13 m | 0.100 m | 30 s | time | sigmoid | 35 mm | 30 mm | 20 % | 0.25 |" in page
    assert "| 40 (90) kPa |" in page and "it fits nowhere" in page
    assert "| largest [mm] | 37.9 | 60 |" in page and "| bellows | closed | held |" in page
    assert "| X | longer | 0.030 m | 0.060, 0.000 | time (2) |" in page and "next to 0.1, 0.3 m" in page
    assert "| 3.00 x |" in page and "time (1)" in page and "| 190.0 mN | +1.0 % |" in page


def test_it_is_driven_from_several_starts_in_a_colon_of_a_folder(tmp_path: Path) -> None:
    colon = bent_colon(bend=0.06, leg=0.2, length=0.4)
    (tmp_path / "colon").mkdir()
    save_colon(colon, tmp_path / "colon")
    asked = {"starts": (0.1, 0.2), "seconds": 0.2}
    rows = bench_within(robot(), tmp_path, [tmp_path / "colon"], **asked)[colon.name]
    assert [row["start_m"] for row in rows] == pytest.approx([0.1, 0.2], abs=2e-3)
    assert all(0.0 < row["came_m"] < 0.25 * robot().design.tread_speed(150.0) for row in rows)
    assert bench_within(robot(), tmp_path, [tmp_path / "colon"], **asked)[colon.name] == rows
    narrow = replace(colon, radius=colon.radius / 10)
    row = reach_within(robot(), narrow, (0.1,), seconds=0.2)[0]
    assert row["start_m"] is None and row["stopped_by"] == "it fits nowhere"


@pytest.mark.thorough
def test_a_run_in_a_grown_colon_says_where_it_began_and_how_far_it_came(tmp_path: Path) -> None:
    fast = replace(robot(), rpm=300.0)
    row = bench_reach(fast, tmp_path, colons=1, seconds=0.2)[0]
    assert row["stopped_by"] == "time" and row["start_m"] > 0.1
    assert 0.0 < row["came_m"] <= 0.25 * fast.design.tread_speed(300.0)
    assert 0.0 < row["wall_pressure_mean_kPa"] < row["wall_pressure_peak_kPa"]
    (tmp_path / "two").mkdir()
    two = bench_reach(fast, tmp_path / "two", colons=AT_ONCE + 1, seconds=0.2, workers=2)
    assert [one["seed"] for one in two] == [FIRST_SEED + number for number in range(AT_ONCE + 1)]
    assert two[0]["came_m"] == pytest.approx(row["came_m"], rel=1e-4)
