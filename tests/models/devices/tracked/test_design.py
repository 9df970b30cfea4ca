"""A tracked design refuses what cannot be built, and scales with its stresses kept."""

from dataclasses import replace

import pytest

from haustra.errors import InvalidDesignError
from haustra.models.devices.tracked.design import Bellows, FlexibleShaft, SpeedFriction, TrackedDesign, Worm
from haustra.models.devices.tracked.tread import TreadGeometry


def test_published_speeds_follow_from_the_lead() -> None:
    """13 mm of track a turn: 75 to 300 rpm are 16.25 to 65 mm/s."""
    design = TrackedDesign()
    assert [design.tread_speed(rpm) for rpm in (75, 120, 150, 200, 300)] == pytest.approx(
        [0.01625, 0.026, 0.0325, 0.04333, 0.065], rel=1e-3
    )


def test_published_diameter_range_is_the_stroke() -> None:
    low, high = TrackedDesign().stroke
    assert (low, high) == pytest.approx((-0.0202, 0.0058))


@pytest.mark.parametrize(("starts", "offsets"), [(1, (0, 0.25, 0.5, 0.75)), (2, (0, 0.5, 0, 0.5)), (4, (0, 0, 0, 0))])
def test_worm_starts_set_the_teeth_of_the_tracks_apart(starts: int, offsets: tuple[float, ...]) -> None:
    """A thread passes a track at azimuth a after a/360 of a turn; each turn passes one tooth per start."""
    tread = replace(TreadGeometry(), pitch=13e-3 / starts, tooth_width=6.5e-3 / starts)
    design = replace(TrackedDesign(), tread=tread, worm=Worm(starts=starts))
    assert design.phase_offsets() == pytest.approx(offsets)


def test_scaling_keeps_stress() -> None:
    """Same materials: forces go with the square of length, so 1:1 pulls a sixteenth."""
    small = TrackedDesign().at_scale(1.0)
    assert small.bellows.preload == pytest.approx(1.875 / 16)
    assert small.nominal_diameter == pytest.approx(0.035)
    assert small.tread.pitch == pytest.approx(6.5e-3 / 4)
    assert small.bellows.force(1e-3) == pytest.approx(TrackedDesign().bellows.force(4e-3) / 16)


def test_pressure_folds_the_device() -> None:
    """The paper: more pressure widens the struts and moves the tracks inwards."""
    assert Bellows(pressure=5e3).force(0.0) < Bellows().force(0.0)


def test_losses_peak_at_the_published_optimum() -> None:
    design = TrackedDesign()
    share = [
        design.speed_friction.factor(design.tread_speed(rpm)) * design.shaft.transmission(rpm * 2 * 3.14159265 / 60)
        for rpm in (75, 120, 150, 200, 300)
    ]
    assert max(share) == share[2]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: TreadGeometry(tooth_width=7e-3), "no gap between teeth"),
        (lambda: TreadGeometry(pitch=-1.0), "pitch is -1.0; give 1e-05 to 0.2 m"),
        (lambda: TreadGeometry(pitch=6.5), r"is it in mm\?"),
        (lambda: TrackedDesign(nominal_diameter=0.2), "outside"),
        (lambda: TrackedDesign(core_diameter=0.11), "does not fit inside"),
        (lambda: TrackedDesign(bellows=Bellows(pressure=-1.0)), "pressure is -1.0"),
        (lambda: TrackedDesign(worm=Worm(starts=3)), "does not mesh"),
        (lambda: TrackedDesign(worm=Worm(efficiency=1.5)), "give 0.01 to 1"),
        (lambda: TrackedDesign(shaft=FlexibleShaft(efficiency=2.0)), "give 0.01 to 1"),
        (lambda: TrackedDesign(mass=float("nan")), "mass is nan"),
        (lambda: TrackedDesign(speed_friction=SpeedFriction(exponent=-0.1)), "exponent"),
        (lambda: TrackedDesign().at_scale(0.0), "at_scale is 0.0"),
        (lambda: TrackedDesign().extension_in(0.09), "smaller than the folded device"),
        (lambda: TrackedDesign().extension_in(float("nan")), "smaller than the folded device"),
        (lambda: TrackedDesign().extension_in(0.2), "out of the tracks' reach"),
    ],
)
def test_impossible_designs_are_refused_in_one_line(build, message: str) -> None:
    with pytest.raises(InvalidDesignError, match=message) as caught:
        build()
    assert "\n" not in str(caught.value)
