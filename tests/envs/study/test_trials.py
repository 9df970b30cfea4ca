"""Trials with known answers: shipped files are sound, effects are paired, verdicts follow the stated rule."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.study.patients import numbers
from haustra.envs.study.trials import Trial, answered, arm_study, load_trial, run_trials, trial_names
from haustra.errors import InvalidOptionError, InvalidStudyError, UnsupportedSceneError
from haustra.models.devices.scope.files import load_design

EXAMPLES = Path(__file__).parents[3] / "docs/examples"
NAMES = trial_names()


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_trial_asks_the_same_patients_in_both_arms(name: str) -> None:
    """Arms differ in device, ring or pressure only: the hypercube draws the same variables."""
    trial, path = load_trial(name)
    first, second = (arm_study(trial, path, arm, patients=4, driver="follower", seconds=10.0) for arm in trial.arms)
    assert first.variables == second.variables and first.sampler == second.sampler
    assert first.hash != second.hash
    assert trial.source and trial.published and trial.assumed


def test_six_trials_found_a_difference_and_three_none() -> None:
    expected = [load_trial(name)[0].expected for name in NAMES]
    assert expected.count("different") == 6 and expected.count("equal") == 3


def _arm(values: np.ndarray, **scores) -> dict[int, dict]:
    return {
        patient: {"caecum": float(value < 100), "time_s": value, "descending_s": 20.0, "pain_left": 0.0} | scores
        for patient, value in enumerate(values)
    }


def test_effects_are_paired() -> None:
    """Patients differ by far more than arms: only pairs resolve two seconds."""
    trial, _ = load_trial("variable-stiffness")
    own = np.linspace(20.0, 90.0, 30)
    found = answered("t", trial, [_arm(own - 2.0), _arm(own)], seconds=100.0)
    assert found.effect == pytest.approx(-2.0) and found.low == found.high == pytest.approx(-2.0)
    assert found.reproduced and found.resolved
    assert not answered("t", trial, [_arm(own + 2.0), _arm(own)], seconds=100.0).reproduced
    noisy = own + np.random.default_rng(0).normal(-0.5, 20, 30)
    unsure = answered("t", trial, [_arm(noisy), _arm(own)], seconds=100.0)
    assert unsure.effect is not None and unsure.low is not None and unsure.high is not None
    assert unsure.low < unsure.effect < 0 < unsure.high
    assert unsure.reproduced and not unsure.resolved
    assert not answered("t", trial, [_arm(own), _arm(own)], seconds=100.0).reproduced


def test_who_does_not_reach_the_caecum_counts_with_the_longest_time() -> None:
    trial, _ = load_trial("variable-stiffness")
    found = answered("t", trial, [_arm(np.full(4, 150.0)), _arm(np.full(4, 60.0))], seconds=120.0)
    assert (found.first, found.second, found.reached) == (120.0, 60.0, (0.0, 1.0))
    proximal, _ = load_trial("stiffening")
    later = answered("t", proximal, [_arm(np.full(4, 60.0)), _arm(np.full(4, 150.0))], seconds=120.0)
    assert (later.first, later.second) == (40.0, 100.0)


@pytest.mark.parametrize(
    ("name", "scores"), [("stiffening", {"descending_s": None}), ("water", {"at_flexure_N": None})]
)
def test_who_does_not_come_to_the_flexure_tells_nothing_about_it(name: str, scores: dict) -> None:
    """Neither a loop nor none, and no time from there on: the pair does not count."""
    trial, _ = load_trial(name)
    loops = {f"at_flexure_{kind}": 0.0 for kind in ("N", "alpha", "reversed_alpha")}
    first, second = _arm(np.full(8, 60.0), **loops), _arm(np.full(8, 60.0), **loops)
    second[0] |= scores
    found = answered("t", trial, [first, second], seconds=120.0)
    assert (found.patients, found.effect) == (7, 0.0)
    second = {patient: each | scores for patient, each in second.items()}
    assert answered("t", trial, [first, second], seconds=120.0).effect is None


def test_an_arm_that_reaches_more_tells_its_effect_among_those_whom_both_reach() -> None:
    """Faster by who arrives, and slower where both do: the two are told apart."""
    trial, _ = load_trial("length")
    slower_but_all = _arm(np.full(8, 60.0))
    quicker_but_seven = _arm(np.where(np.arange(8) < 7, 50.0, 150.0))
    found = answered("t", trial, [slower_but_all, quicker_but_seven], seconds=200.0)
    assert found.effect is not None and found.effect < 0
    assert found.arrived == pytest.approx(10.0)
    nobody = _arm(np.full(8, 150.0))
    assert answered("t", trial, [nobody, nobody], seconds=200.0).arrived is None


def test_equality_is_held_to_the_trials_own_interval() -> None:
    trial, _ = load_trial("cf100l-pcf100")
    assert trial.interval is not None
    high = [_arm(np.full(100, 50.0)), _arm(np.where(np.arange(100) < 95, 50.0, 150.0))]
    assert answered("t", trial, high, seconds=200.0).effect == pytest.approx(0.05)
    assert answered("t", trial, high, seconds=200.0).reproduced
    assert not answered("t", trial, high, seconds=200.0).resolved  # 5 of 100 patients: 1 to 10 %
    assert answered("t", replace(trial, interval=(-0.2, 0.2)), high, seconds=200.0).resolved
    assert not answered("t", replace(trial, interval=(-0.01, 0.01)), high, seconds=200.0).reproduced
    nobody = _arm(np.full(100, 150.0))
    assert answered("t", trial, [nobody, nobody], seconds=200.0).effect == 0.0
    assert not answered("t", trial, [nobody, nobody], seconds=200.0).reproduced


def test_too_few_patients_tell_nothing() -> None:
    trial, _ = load_trial("flaccid")
    arm = _arm(np.full(2, 50.0), pain_dose_s=1.0)
    found = answered("t", trial, [arm, arm], seconds=100.0)
    assert found.effect is None and not found.reproduced and found.patients == 2


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('direction = "less"', "", "direction"),
        ('expected = "different"', 'expected = "maybe"', "'maybe' is not known"),
        ('name = "standard"', 'name = "standard"\nwings = 2', "wings"),
        ('scores = ["pain_dose_s"', 'scores = ["bliss"', "'bliss' is not known"),
    ],
)
def test_a_trial_that_cannot_be_is_refused_in_one_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    _, path = load_trial("flaccid")
    (tmp_path / "designs").symlink_to(path.parent / "designs")
    text = path.read_text(encoding="utf-8")
    assert old in text
    changed = tmp_path / "t.toml"
    changed.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InvalidStudyError, match=said) as found:
        trial, place = load_trial(str(changed))
        arm_study(trial, place, trial.arms[0], patients=4, driver="follower", seconds=10.0)
    assert "\n" not in str(found.value)


def test_a_trial_that_is_not_known_is_refused() -> None:
    with pytest.raises(InvalidOptionError, match="Known: cf100l-pcf100"):
        load_trial("placebo")
    assert isinstance(load_trial("water")[0], Trial)


def test_the_arms_of_water_against_air_differ_by_water_and_gas_in_the_same_colons() -> None:
    trial, path = load_trial("water")
    wet, dry = (arm_study(trial, path, arm, patients=4, driver="follower", seconds=10.0) for arm in trial.arms)
    assert (wet.options["water"], dry.options["water"]) == (2e-4, 0.0)
    assert (wet.options["gas"], dry.options["gas"]) == (1333.0, 3333.0)
    assert wet.changes == dry.changes == {"patient.gas_pressure": 3333.0} and wet.variables == dry.variables
    others = {name: load_trial(name) for name in NAMES if name != "water"}
    for one, place in others.values():
        study = arm_study(one, place, one.arms[0], patients=4, driver="follower", seconds=10.0)
        assert not {"gas", "water"} & set(study.options)
    with pytest.raises(InvalidStudyError, match=r"options\.gas"):
        arm_study(trial, path, replace(trial.arms[0], gas_pressure=None), patients=4, driver="follower", seconds=10.0)


def test_a_gpu_refuses_the_trial_of_water_before_any_is_run(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedSceneError, match="trial 'water'"):
        run_trials(["flaccid", "water"], tmp_path, patients=3, driver="follower", seconds=1.0, backend="linear-gpu")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["paediatric-adult", "stiffening", "tapered", "variable-stiffness"])
def test_rings_that_leave_the_front_soft_differ_from_those_that_ship_in_that_alone(name: str) -> None:
    """The leading 30 cm are the last section, the bending section and the tip."""
    (usual, place), (soft, beside) = (load_trial(where) for where in (name, str(EXAMPLES / f"soft-front/{name}.toml")))
    assert replace(soft, assumed=(), arms=()) == replace(usual, assumed=(), arms=())
    rings = 0
    for one, other in zip(usual.arms, soft.arms, strict=True):
        assert replace(other, device=one.device) == one
        if not one.device.endswith("variable.toml"):
            assert (place.parent / one.device).resolve() == (beside.parent / other.device).resolve() or one == other
            continue
        known, found = load_design(place.parent / one.device), load_design(beside.parent / other.device)
        (shaft,), (behind, front) = known.shaft, found.shaft
        assert behind == replace(shaft, length=behind.length)
        assert front == replace(shaft, length=front.length, stiffening=1.0)
        assert front.length + found.bending.length + found.tip.length == pytest.approx(0.3)
        assert found.length == pytest.approx(known.length)
        assert replace(found, shaft=known.shaft) == known
        rings += 1
    assert rings


def test_the_stiffer_ring_differs_from_the_one_that_ships_in_its_factor_alone() -> None:
    """It stiffens by the end of what is assumed."""
    (usual, place), (stiff, beside) = map(
        load_trial, ("paediatric-adult", str(EXAMPLES / "stiffer-ring/paediatric-adult.toml"))
    )
    assert replace(stiff, assumed=()) == replace(usual, assumed=())
    known, found = (load_design(path.parent / usual.arms[0].device) for path in (place, beside))
    (shaft,) = found.shaft
    assert shaft.stiffening == numbers()["scope.variable.stiffening"].high > known.shaft[0].stiffening
    assert replace(found, shaft=known.shaft) == known
    assert replace(shaft, stiffening=known.shaft[0].stiffening) == known.shaft[0]
