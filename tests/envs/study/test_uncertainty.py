"""Splitting the uncertainty of a comparison: components that are put in come out."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.study.credibility import Comparison
from haustra.envs.study.uncertainty import comparison_study, split
from haustra.errors import InvalidStudyError

ASKED = Comparison(devices=("a", "b"), score="pull", unit="N", drivers=("one", "two"), patients=60, parameters=40)


def _rows(difference: np.ndarray, driver: str, *, reached=lambda device, patient: 1.0) -> list[dict]:
    return [
        {
            "patient": patient,
            "draw": draw,
            "driver": driver,
            "device": device,
            "scores": {"pull": value, "caecum": reached(device, patient)},
        }
        for (patient, draw), gap in np.ndenumerate(difference)
        for device, value in (("a", 5.0 + gap), ("b", 5.0))
    ]


def _crossed(*, patients: float, parameters: float, rest: float) -> np.ndarray:
    random = np.random.default_rng(1)
    own, drawn = random.normal(0, patients, (60, 1)), random.normal(0, parameters, (1, 40))
    return 3.0 + own + drawn + random.normal(0, rest, (60, 40))


def test_colons_are_crossed_with_draws_of_the_assumed_numbers() -> None:
    """Each of three colons is tried with both draws; with half the step, with the first draw only."""
    asked = replace(ASKED, devices=("adult", "paediatric"), drivers=("follower",), patients=3, parameters=2)
    asked = replace(asked, score="mesentery_peak_N_m", measured=("seed", "sex"))
    study = comparison_study(asked)
    designs = [dict(design) for design in study.sampler.designs]
    assert len({design["seed"] for design in designs}) == 3 and len({design["friction"] for design in designs}) == 2
    assert len({(design["seed"], design["friction"]) for design in designs}) == len(designs) == 6
    half = comparison_study(asked, half_step=True)
    assert [dict(design) for design in half.sampler.designs] == designs[::2]
    assert half.options["timestep"] == 0.5 * float(study.options["timestep"])
    with pytest.raises(InvalidStudyError, match="'hope' is not known"):
        comparison_study(replace(asked, measured=("hope",)))
    with pytest.raises(InvalidStudyError, match="'outcome' is no number"):
        comparison_study(replace(asked, score="outcome"))


def test_each_part_of_the_spread_is_found() -> None:
    """Analysis of variance: 1.0 between patients, 0.5 between parameters, 0.3 besides; a step moves all by 0.2."""
    given = _crossed(patients=1.0, parameters=0.5, rest=0.3)
    found = split(ASKED, _rows(given, "one") + _rows(given - 2.0, "two"), _rows(given[:, :1] + 0.2, "one"))
    assert found.effect == pytest.approx(3.0, abs=0.4) and found.low < found.effect < found.high
    assert found.patients == pytest.approx(1.0, rel=0.25)
    assert found.parameters == pytest.approx(0.5, rel=0.35)
    assert found.rest == pytest.approx(0.3, rel=0.1)
    assert found.numerical == pytest.approx(0.2)
    assert found.driver == pytest.approx(2.0 / 2**0.5, rel=1e-6)
    assert found.resolved and found.pairs == 2400 and found.left_out == 0 and found.reached == 1.0


def test_pairs_that_came_unequally_far_are_left_out() -> None:
    given = _crossed(patients=0.0, parameters=0.0, rest=0.1)
    rows = _rows(given, "one", reached=lambda device, patient: float(device == "a" or patient >= 15))
    found = split(ASKED, rows, [])
    assert found.first - found.second == pytest.approx(found.effect)
    assert found.left_out == 15 * 40 and found.pairs == 45 * 40
    assert found.numerical is None and found.drivers["two"] is None and found.driver is None
    nothing = _rows(given, "one", reached=lambda device, patient: float(device == "a"))
    with pytest.raises(InvalidStudyError, match="equal caecal intubation"):
        split(ASKED, nothing, [])


def test_a_sign_that_depends_on_the_driver_is_not_resolved() -> None:
    given = _crossed(patients=0.1, parameters=0.1, rest=0.1)
    assert not split(ASKED, _rows(given, "one") + _rows(-given, "two"), []).resolved
    assert not split(ASKED, _rows(given - given.mean(), "one"), []).resolved
