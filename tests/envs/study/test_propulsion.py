"""A job of a sweep is the same physics as the published study."""

import math
from typing import Any

import pytest

from haustra.envs.runs.measure.propulsion import pull
from haustra.envs.study.propulsion import SCORES, answer
from haustra.envs.study.study import Job
from haustra.errors import InvalidDesignError
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_table, track_ripple
from haustra.models.devices.tracked.rig import flat_rig
from tests.envs.study.studies import study


def _job(**values) -> Job:
    conditions = {"friction": values.pop("friction", 0.4), "speed": values.pop("speed", 0.0325)}
    return Job(0, 0, {"spacing": 3.0, "pressure": 0.0} | values, conditions)


def _scores(job: Job, **changes) -> dict[str, Any]:
    return dict(answer(study(**changes), job).scores)


def test_the_published_design_pulls_what_the_paper_says() -> None:
    scores = _scores(_job())
    assert list(scores) == [column.name for column in SCORES]
    design = TrackedDesign()
    law = PadLaw.fit(load_table(design.tread))
    run = pull(flat_rig(design, friction=0.4, indentation=law.indentation(design.bellows.preload / 2)), 0.0325)
    assert scores["force_N"] == pytest.approx(4 * run.mean, rel=1e-6)
    assert scores["force_N"] == pytest.approx(3.0, abs=0.15)
    assert scores["ripple_N"] == pytest.approx(run.ripple()[0], rel=1e-6)


def test_force_is_friction_times_what_the_bellows_leave() -> None:
    """Coulomb, and the bellows' balance: preload less area times pressure."""
    bellows = TrackedDesign().bellows
    base, pressed = (_scores(_job(pressure=p)) for p in (0.0, 4000.0))
    assert pressed["normal_N"] < base["normal_N"]
    # Tracks move out as the tread gives way less, which the bellows' stiffness takes from the balance.
    assert pressed["normal_N"] == pytest.approx(4 * (bellows.preload - bellows.area * 4000), rel=0.06)
    assert pressed["force_N"] == pytest.approx(0.4 * pressed["normal_N"], rel=0.01)


def test_ripples_of_two_tips_cancel_half_a_pitch_apart_and_add_a_pitch_apart() -> None:
    law = PadLaw.fit(load_table(TrackedDesign().tread))
    for spacing in (3.0, 3.25, 3.5):
        expected = math.hypot(*track_ripple(law, spacing))
        assert _scores(_job(spacing=spacing))["ripple_fraction"] == pytest.approx(expected, abs=0.02)


def test_speed_matters_only_with_losses() -> None:
    def force(losses: bool, speed: float) -> float:
        return _scores(_job(speed=speed), options={"losses": losses})["force_N"]

    assert force(False, 0.065) == pytest.approx(force(False, 0.0325), rel=0.01)
    assert force(True, 0.065) < 0.9 * force(True, 0.0325)
    assert force(True, 0.01625) < 0.9 * force(True, 0.0325)


def test_the_curve_over_a_passage_has_the_mean_and_the_ripple() -> None:
    result = answer(study(), _job())
    scores: dict[str, Any] = dict(result.scores)
    curve = result.curves["force_per_track_N"]
    assert 4 * sum(curve) / len(curve) == pytest.approx(scores["force_N"], rel=1e-6)
    assert (max(curve) - min(curve)) / 2 == pytest.approx(scores["ripple_N"], rel=0.15)


def test_stress_is_that_of_the_reference_at_the_calibrated_load() -> None:
    """The mean of the belt's stress lies between the published states of high and low force (57.6 and 109 kPa)."""
    scores = _scores(_job())
    assert 57.6 < scores["stress_mean_kPa"] < scores["stress_peak_kPa"] < 115


def test_what_cannot_be_built_says_why() -> None:
    for job, reason in (
        (_job(pressure=12000.0), "lift the tracks off"),
        (_job(friction=2.0), "worm would need"),
    ):
        with pytest.raises(InvalidDesignError, match=reason):
            answer(study(), job)


@pytest.mark.slow
def test_the_whole_device_in_a_tube_pulls_as_four_tracks_do() -> None:
    """But for the part of its friction that holds the worm's torque: 1 / hypot(1, lever / radius)."""
    flat = _scores(_job())
    tube = _scores(_job(), options={"rig": "tube"})
    design = TrackedDesign()
    lever = design.worm.lead / (math.tau * design.worm.efficiency) / (design.nominal_diameter / 2)
    assert tube["force_N"] == pytest.approx(flat["force_N"] / math.hypot(1, lever), rel=0.01)
    assert tube["roll_rad_s"] != 0
