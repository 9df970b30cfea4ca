"""Cohorts: patients within the sources' ranges, observables by hand, and a few patients examined."""

import json
import tomllib
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from haustra.assets import asset
from haustra.envs.control.endoscopist import EndoscopistSettings
from haustra.envs.control.laws import DRIVERS, driver_settings
from haustra.envs.study import patients
from haustra.envs.study.clinic_watch import pull_backs
from haustra.envs.study.cohort import OWN_DEVICE, PRESETS, SCORES, Examiner, cohort_study
from haustra.envs.study.cohort_table import observables, published, verdicts, wilson
from haustra.envs.study.patients import (
    Patient,
    adhesion_share,
    clinic_number,
    injury_variables,
    left_as_they_are,
    numbers,
    patient_variables,
    traits,
)
from haustra.envs.study.questions import find_backend
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.fields import declaration_of
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.scripts.bench.drivers import settings_files


def test_every_number_of_every_patient_lies_in_its_sourced_range():
    study = cohort_study("full")
    designs = designs_of(study)
    assert len(designs) == PRESETS["full"].patients == 400
    for variable in study.variables:
        values = np.array([design[variable.name] for design in designs])
        assert variable.low <= values.min() and values.max() <= variable.high
    friction = numbers()["contact.friction"]
    bounds = next(variable for variable in study.variables if variable.name == "friction")
    assert friction.low <= bounds.low < bounds.high <= friction.high
    assert all(not entry.get("number") or _within(entry, numbers()[entry["number"]]) for entry in _listed().values())


def _listed() -> dict:
    return tomllib.loads(asset("clinic/patients.toml").read_text(encoding="utf-8"))


def _within(entry: dict, number) -> bool:
    return number.low <= entry.get("low", number.low) < entry.get("high", number.high) <= number.high


def test_a_latin_hypercube_gives_traits_their_share():
    patients = [Patient.of(design) for design in designs_of(cohort_study("full"))]
    by_sex = {"adhesions"}
    for trait in traits().keys() - by_sex:
        assert np.mean([patient.has(trait) for patient in patients]) == pytest.approx(traits()[trait], abs=1 / 400)


def test_as_many_have_adhesions_as_published_and_women_more_by_what_hysterectomies_leave():
    men, women = (adhesion_share(sex) for sex in ("male", "female"))
    assert (men + women) / 2 == pytest.approx(clinic_number("sigmoid_adhesions"))
    after = clinic_number("hysterectomy") * clinic_number("adhesions_after_surgery")
    assert women == pytest.approx(men + (1 - men) * after)
    patients = [Patient.of(design) for design in designs_of(cohort_study("full", patients=4000))]
    for sex, share in (("male", men), ("female", women)):
        found = [patient.has("adhesions") for patient in patients if patient.sex == sex]
        assert np.mean(found) == pytest.approx(share, abs=0.02)  # two standard deviations at least


def test_each_driver_and_device_sees_the_same_patients():
    study = cohort_study("quick", drivers=("follower", "endoscopist"), devices=("adult", "paediatric"), patients=3)
    jobs = list(jobs_of(study, designs_of(study)))
    assert len(jobs) == 12
    seeds = {(*job.conditions.values(),): [] for job in jobs}
    for job in jobs:
        seeds[*job.conditions.values(),].append(job.variables["seed"])
    assert len(seeds) == 4 and len({tuple(each) for each in seeds.values()}) == 1
    as_they_are = {each.name: each.nominal for each in left_as_they_are()}
    assert Patient.of(jobs[0].variables).values == {**as_they_are, **jobs[0].variables}


@pytest.mark.parametrize("asked", [{"name": "slow"}, {"drivers": ("ghost",)}, {"devices": ("broom",)}])
def test_what_is_not_known_is_refused(asked):
    with pytest.raises(Exception, match=r"not known|broom") as caught:
        cohort_study(**{"name": "quick", **asked})
    assert "\n" not in str(caught.value)


def test_policies_examine_with_the_scope_that_they_were_trained_with():
    policy = Examiner.of({"driver": "insertion", "device": OWN_DEVICE})
    assert policy.device == "paediatric-long" and policy.policy is not None
    assert Examiner.of({"driver": "insertion", "device": "adult"}).device == "adult"
    law = Examiner.of({"driver": "endoscopist", "device": OWN_DEVICE})
    assert law.device == "adult" and law.policy is None and law.batch != policy.batch


def test_unknown_drivers_are_refused_by_name():
    with pytest.raises(InvalidOptionError, match="Known: follower, endoscopist"):
        driver_settings("ghost", moves=True)
    assert set(DRIVERS) == {"follower", "endoscopist"}


def test_pull_backs_are_counted_once_each():
    shaft = np.array([0.1, 0.2, 0.3, 0.28, 0.26, 0.24, 0.2, 0.25, 0.3, 0.295, 0.3, 0.2])
    assert pull_backs(shaft, 0.03) == 2
    assert pull_backs(np.linspace(0, 1, 50), 0.03) == 0


def _patient(**changed) -> dict:
    usual = {column.name: 0.0 for column in SCORES} | {"sex": "male", "outcome": "time_up", "inserted_m": None}
    return usual | {f"axial_{name}_N": float(index) for index, name in enumerate(SEGMENTS)} | changed


def test_observables_are_what_the_rows_say():
    rows = [
        _patient(
            sex=sex,
            caecum=1.0,
            inserted_m=0.8,
            n_loop=float(i % 2),
            any_loop=1.0,
            push_peak_N=20.0 + i,
            time_s=float(i),
        )
        for i, sex in enumerate(["male", "female"] * 20)
    ]
    found = {one.name: one for one in observables(rows)}
    assert found["any_loop"].value == 1.0 and found["any_loop"].inside is False
    assert found["n_loop"].value == 0.5
    assert found["force_rises"].value == 5 and found["force_rises"].inside
    assert 55 < (found["push_peak"].value or 0.0) <= 59  # the largest of 21 of 40
    assert found["inserted_length"].inside is None
    assert found["half_metre_men"].value == 0
    assert [one.name for one in published()] == list(found)


def test_women_must_be_behind_men_at_half_a_metre():
    """Both sexes inside their bands, but in the wrong order: that is outside."""
    shares = {"male": 0.28, "female": 0.285}
    rows = [_patient(sex=sex, half_metre=float(i < share * 200)) for sex, share in shares.items() for i in range(200)]
    found = observables(rows)
    by_name = {one.name: one for one in found}
    assert by_name["half_metre_men"].inside and by_name["half_metre_women"].inside
    assert not verdicts(found)["half_metre"]
    assert len(verdicts(found)) == 12


def test_a_loop_that_all_have_is_correlated_with_nothing():
    """Nothing to compare is no evidence of no correlation."""
    rows = [_patient(caecum=1.0, at_flexure_N=1.0, time_s=float(i)) for i in range(20)]
    value = {one.name: one for one in observables(rows)}["loop_and_time"]
    assert value.value is None and value.inside is False
    for i, row in enumerate(rows):
        row["at_flexure_N"] = float(i < 10)
    assert {one.name: one for one in observables(rows)}["loop_and_time"].value == pytest.approx(-0.867, abs=0.01)


def test_too_few_patients_have_no_value():
    found = {one.name: one for one in observables([_patient()])}
    assert found["loop_and_time"].value is None and found["loop_and_time"].inside is False
    assert found["inserted_length"].value is None
    json.dumps([one.to_json() for one in found.values()], allow_nan=False)


def test_wilsons_interval():
    """Published: 34.5 % of 116 men gives 0.27 to 0.44."""
    low, high = wilson(40, 116)
    assert (low, high) == pytest.approx((0.2646, 0.4352), abs=2e-3)


def test_the_hand_may_do_far_more_than_the_bands():
    bands = {one.name: one.band or (0.0, 0.0) for one in published()}
    assert clinic_number("hand_push") >= 2 * bands["push_peak"][1]
    assert clinic_number("hand_torque") >= 2 * bands["torque_peak"][1]
    assert not {variable.name for variable in patient_variables()} & {"push_limit", "torque_limit"}


def test_drivers_of_ones_own_examine_the_same_patients_in_one_batch(tmp_path):
    """Two drivers who differ in their pace alone; the colons are laid out once. Faster goes deeper in two seconds."""
    for name, rate in (("slow", 0.02), ("quick", 0.04)):
        (tmp_path / f"{name}.toml").write_text(f'law = "follower"\nadvance_rate = {rate}\n', encoding="utf-8")
    drivers = tuple(str(tmp_path / f"{name}.toml") for name in ("slow", "quick"))
    study = cohort_study("quick", drivers=drivers, patients=2, seconds=2.0)
    jobs = list(jobs_of(study, designs_of(study)))
    found = {result.job: result for result in find_backend("cohort", "linear").start(study, tmp_path)(jobs)}
    depth = {(job.conditions["driver"], job.design): found[job.id].curves["insertion_m"][-1] for job in jobs}
    for design in {job.design for job in jobs}:
        assert depth[drivers[1], design] > depth[drivers[0], design] + 0.02


def test_suction_that_an_endoscopist_asks_for_is_done(tmp_path):
    """Two who differ in that alone, and whose batches are alike: in six seconds the same tips come elsewhere."""
    (tmp_path / "sucks.toml").write_text('law = "endoscopist"\nsuck_after = 0\n', encoding="utf-8")
    drivers = "endoscopist", str(tmp_path / "sucks.toml")
    study = cohort_study("quick", drivers=drivers, patients=2, seconds=6.0)
    jobs = list(jobs_of(study, designs_of(study)))
    found = {result.job: result for result in find_backend("cohort", "linear").start(study, tmp_path)(jobs)}
    reach = {(job.conditions["driver"], job.design): found[job.id].scores["reach"] for job in jobs}
    for design in {job.design for job in jobs}:
        assert reach[drivers[1], design] != reach[drivers[0], design]


def test_settings_out_of_range_are_refused_by_name(tmp_path):
    path = tmp_path / "driver.toml"
    path.write_text('law = "endoscopist"\nadvance_rate = 3.0\n', encoding="utf-8")
    with pytest.raises(InvalidOptionError, match=r"driver\.toml: advance_rate"):
        driver_settings(str(path), moves=True)
    path.write_text('law = "ghost"\n', encoding="utf-8")
    with pytest.raises(InvalidOptionError, match="law 'ghost' is not known"):
        driver_settings(str(path), moves=True)


def test_endoscopists_who_are_tried_lie_within_their_bounds(tmp_path):
    bounds = tomllib.loads(asset("clinic/endoscopists.toml").read_text(encoding="utf-8"))
    for name, each in bounds.items():
        assert declaration_of(EndoscopistSettings, name).unit == each["unit"]
        assert each["low"] < getattr(EndoscopistSettings(), name) < each["high"], name
    usual, *others = settings_files(tmp_path, 5, seed=3)
    assert driver_settings(str(usual), moves=True) == driver_settings("endoscopist", moves=True)
    for path in others:
        settings = driver_settings(str(path), moves=True)
        assert all(each["low"] <= getattr(settings, name) <= each["high"] for name, each in bounds.items())
    assert len({path.read_text(encoding="utf-8") for path in others}) == 4


def test_patients_are_examined_side_by_side_and_kept(tmp_path):
    """Two patients for two seconds: advanced at the follower's pace, no loop yet, nothing torn; colons are kept."""
    study = cohort_study("quick", drivers=("follower",), patients=2, seconds=2.0)
    jobs = list(jobs_of(study, designs_of(study)))
    found = {result.job: result for result in find_backend("cohort", "linear").start(study, tmp_path)(jobs)}
    assert [found[job.id].state for job in jobs] == ["finished", "finished"]
    for job in jobs:
        patient, scores = Patient.of(job.variables), found[job.id].scores
        assert set(scores) == {column.name for column in SCORES}
        assert scores["sex"] == patient.sex and (patient.folder() / "colon.json").is_file()
        assert scores["time_s"] == pytest.approx(2.0, abs=0.05)
        assert 0.05 < found[job.id].curves["insertion_m"][-1] < 0.13
        assert scores["caecum"] == scores["any_loop"] == scores["half_metre"] == 0
        assert float(scores["p_perforation"] or 0.0) < 0.01
        assert scores["axial_rectum_N"] != 0 and scores["axial_caecum_N"] is None


def test_what_a_wall_bears_is_each_patients_own_while_it_is_examined(tmp_path):
    """One examination, three times: of walls that bear twice as much under any shape, and under longer contacts."""
    known = {each.name: each for each in injury_variables()}
    shapes = tuple(known[f"strength_{shape}"] for shape in ("straight", "bent", "sideways"))
    asked = cohort_study("quick", drivers=("follower",), patients=1, seconds=4.0, seed=1)
    study = replace(asked, variables=(*asked.variables, *shapes, known["contact_length"]))
    (usual,) = designs_of(asked)
    stronger = usual | {each.name: 2 * each.nominal for each in shapes}
    jobs = list(jobs_of(study, [usual, stronger, usual | {"contact_length": 0.06}]))
    found = {result.job: result.scores for result in find_backend("cohort", "linear").start(study, tmp_path)(jobs)}
    usual_load, half, more = (float(found[job.id]["load_peak"] or 0.0) for job in jobs)
    assert usual_load > 0.01 and half == pytest.approx(usual_load / 2, rel=1e-5) and more > 1.01 * usual_load
    assert len({found[job.id]["reach"] for job in jobs}) == 1


def test_a_colon_that_another_process_has_grown_stays(tmp_path):
    """Who comes second reads what is there, which others may be reading."""
    grown = {"seed": 1, "sex": "female", "pressure": 2000.0, "sigmoid": "omega"}
    patients.grow_patient(tmp_path / "colon", grown)
    before = (tmp_path / "colon" / "colon.json").stat().st_ino
    patients.grow_patient(tmp_path / "colon", grown)
    assert (tmp_path / "colon" / "colon.json").stat().st_ino == before
    assert [each.name for each in tmp_path.iterdir()] == ["colon"]


def test_patients_are_examined_under_water_and_too_much_of_it_is_refused_by_name(tmp_path):
    """Two litres go into nobody's rectum and sigmoid: who cannot be examined says so, in one line."""
    asked = cohort_study("quick", drivers=("follower",), patients=1, seconds=1.0)
    states = []
    for water in (1e-4, 2e-3):
        study = replace(asked, options={**asked.options, "gas": 2000.0, "water": water})
        jobs = list(jobs_of(study, designs_of(study)))
        (found,) = find_backend("cohort", "linear").start(study, tmp_path)(jobs)
        states.append(found.state)
    assert states == ["finished", "failed"] and "rectum and sigmoid take" in found.reason
    with pytest.raises(UnsupportedSceneError, match=r"options\.gas"):
        find_backend("cohort", "linear-gpu").prepare(study, tmp_path, lambda note: None)


def test_patients_who_are_ready_need_no_process(tmp_path, monkeypatch):
    """Grown and tabulated once, for each scope's radius; after that nothing is started."""
    monkeypatch.setattr(patients, "cache_folder", lambda: tmp_path)
    own, started = [Patient.of({"seed": float(seed)}) for seed in (1, 2)], []

    def counted(count):
        started.append(count)
        return nullcontext(_Here())

    monkeypatch.setattr(patients, "children", counted)
    for radii in ([0.0064], [0.0064], [0.0064, 0.005]):
        patients.grow_patients(own, radii, processes=8)
    assert started == [2, 2]
    assert all((patient.folder() / "colon.json").is_file() for patient in own)


class _Here:
    """What computes at once, in this process."""

    def submit(self, work, *given) -> Future:
        future = Future()
        future.set_result(work(*given))
        return future
