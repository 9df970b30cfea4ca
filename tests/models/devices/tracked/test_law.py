"""The pad law repeats the reference's table, and superposes to what two tips together show."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from haustra.assets import asset
from haustra.errors import InvalidDesignError
from haustra.models.devices.tracked.law import PadLaw, device_ripple, load_table, track_ripple
from haustra.models.devices.tracked.tread import TreadGeometry


@pytest.fixture(scope="module")
def law() -> PadLaw:
    return PadLaw.fit(load_table(TreadGeometry()))


def two_tips(spacing: float) -> np.ndarray:
    """Normal force of a track over a pitch, from the shipped reference [N]."""
    with asset("tracked/two_tips.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["spacing_pitches"]) == spacing]
    return np.array([float(row["contact_N"]) for row in rows])


def fundamental(force: np.ndarray) -> float:
    return float(2 * np.abs(np.fft.rfft(force)[1]) / len(force) / force.mean())


def test_law_repeats_its_table(law: PadLaw) -> None:
    """Force and phase taken apart: 3 % of the force over the whole table; the mean over phases to 0.5 %."""
    assert law.mean_error < 0.005
    assert law.error < 0.03
    assert min(law.stiffness) >= 0


def test_phase_factor_averages_to_one(law: PadLaw) -> None:
    assert law.phase_factor(np.arange(64) / 64).mean() == pytest.approx(1.0, abs=1e-12)


def test_indentation_inverts_the_mean_force(law: PadLaw) -> None:
    assert law.mean_force(law.indentation(0.9375)) == pytest.approx(0.9375, rel=1e-9)


def test_series_spring_gives_the_law_behind_a_contact(law: PadLaw) -> None:
    """Spring and contact in series: q + F / K = delta, to 1 % of the force."""
    k1, k2, k3 = law.behind(1e4)
    pressed = np.linspace(0.1, 1.0, 10) * law.largest
    force = np.asarray(law.mean_force(pressed))
    left = pressed - force / 1e4
    assert left * (k1 + left * (k2 + left * k3)) == pytest.approx(force, rel=0.01)


def test_published_ripple_at_whole_spacing(law: PadLaw) -> None:
    """The paper: about 25 % of the mean where the tips' spacing is a multiple of the teeth's."""
    assert track_ripple(law, 3.0)[0] == pytest.approx(0.25, abs=0.03)
    assert fundamental(two_tips(3.0)) == pytest.approx(0.25, abs=0.03)


def test_ripple_cancels_at_half_spacing(law: PadLaw) -> None:
    assert track_ripple(law, 3.5)[0] < 1e-9
    assert fundamental(two_tips(3.5)) < 0.05


def test_one_tip_superposes_to_two(law: PadLaw) -> None:
    """The reference with both tips differs from one tip's table by the belt between them: a tenth of the ripple."""
    assert track_ripple(law, 3.0)[0] == pytest.approx(fundamental(two_tips(3.0)), rel=0.1)


def test_four_starts_ripple_together_and_one_start_cancels(law: PadLaw) -> None:
    """Offsets of starts x 90 degrees: four starts add all harmonics, one leaves only every fourth."""
    assert device_ripple(law, 3.0, 4) == pytest.approx(track_ripple(law, 3.0))
    assert device_ripple(law, 3.0, 1) == pytest.approx(0.0)
    assert device_ripple(law, 3.0, 2)[0] == 0.0


def test_tables_scale_with_the_tread() -> None:
    """A tread of a quarter of the length: a sixteenth of the force at a quarter of the indentation, equal stress."""
    lengths = {name: value / 4 for name, value in TreadGeometry().to_json().items()}
    small, full = load_table(TreadGeometry(**lengths)), load_table(TreadGeometry())
    assert small.forces == pytest.approx(full.forces / 16)
    assert small.indentations == pytest.approx(full.indentations / 4)
    assert small.stresses == pytest.approx(full.stresses)


def test_unsolved_tread_names_those_solved() -> None:
    with pytest.raises(InvalidDesignError, match=r"Solved so far: pitch 6.5 mm"):
        load_table(replace(TreadGeometry(), belt_thickness=5e-3))


def test_impossible_force_is_refused(law: PadLaw) -> None:
    with pytest.raises(InvalidDesignError, match="positive force"):
        law.indentation(-1.0)
    with pytest.raises(InvalidDesignError, match="softer than the tread"):
        law.behind(100.0)
