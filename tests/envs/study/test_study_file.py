"""A study's file is checked before anything runs, and what is wrong is named by its path."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.study.patients import (
    Patient,
    left_as_they_are,
    mesentery_variables,
    numbers,
    patient_variables,
)
from haustra.envs.study.sampling import conditions_of, designs_of, jobs_of
from haustra.envs.study.study import Study, Variable
from haustra.envs.study.study_file import SHIPPED, load_study, read_study
from haustra.errors import HaustraError, InvalidStudyError, UnreadableFileError
from haustra.models.injury.perforation import perforation_probability
from tests.envs.study.studies import SPACING, study, table


def _set(path: str, value):
    """A change of the table at a path like 'variables.0.low'."""

    def change(file: dict) -> None:
        *heads, last = path.split(".")
        place = file
        for head in heads:
            place = place[int(head)] if isinstance(place, list) else place.setdefault(head, {})
        place[last] = value

    return change


@pytest.mark.parametrize(
    ("path", "value", "complaint"),
    [
        ("question", "propulsoin", "question: 'propulsoin' is not known. Known: propulsion, scope"),
        ("variables.0.low", "two", r"variables\[0\].low: expected a finite number"),
        ("variables.0.low", float("nan"), r"variables\[0\].low: expected a finite number"),
        ("variables.0.nominal", 9, r"variables\[0\].nominal: 9 is not from low 2 to high 4"),
        ("variables.1.path", "design.belows.pressure", r"variables\[1\].path: 'belows' is not known. Known: name,"),
        ("variables.1.path", "design.bellows", r"variables\[1\].path: 'bellows' is not a number: lengthen"),
        ("variables.1.path", "design.worm.lead.x", r"variables\[1\].path: 'x' leads beyond a number"),
        ("variables.1.path", "os.system", r"variables\[1\].path: 'os.system' is not known"),
        ("variables.0.bounds", [1, 2], r"variables\[0\].bounds: is not known. Known: distribution"),
        ("variables.1.name", "spacing", "variables: two have the same name"),
        ("variables.0.distribution", "cauchy", r"variables\[0\].distribution: 'cauchy' is not known"),
        ("variables.0.distribution", "choice", r"variables\[0\].values: is missing"),
        ("conditions.speed", [], "conditions.speed: is empty"),
        ("conditions.friction", [0.2, 0.2], "conditions.friction: is empty or holds a value twice"),
        ("conditions.friction", ["wet"], "conditions.friction: expected numbers"),
        ("conditions.colon", ["grown-0"], "conditions.colon: is not known. Known: friction, speed"),
        ("objectives.0.score", "speed", r"objectives\[0\].score: 'speed' is not known"),
        ("options.rigg", "flat", "options: 'rigg' is not known. Known: rig, losses, timestep"),
        ("options.losses", "yes", "options: losses is 'yes'; give true or false"),
        ("options.rig", "round", "options: rig 'round' is not known. Known: flat, tube"),
        ("base.design", "adult", "base: Design 'adult' is not known"),
        ("base.values", {"design.core_diameter": 1.0}, "base: .*core of 1000.0 mm does not fit"),
        ("sampler.kind", "random", "sampler.kind: 'random' is not known"),
        ("sampler.kind", "list", "sampler.designs: are what a sampler of kind 'list'"),
        ("sampler.count", 0, "sampler.count: is 0; give a whole number, 1 to 10000000"),
        ("scores", ["ripple_N", "speed"], r"scores\[1\]: 'speed' is not known"),
        ("budget.jobs", 1.5, "budget: jobs is 1.5; give a whole number"),
        ("extra", 1, "extra: is not known. Known: question, base"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_in_one_line(path: str, value, complaint: str) -> None:
    file = copy.deepcopy(table())
    _set(path, value)(file)
    with pytest.raises(InvalidStudyError, match=f"small.toml: {complaint}") as caught:
        read_study(file, Path("small.toml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("file", [None, [], "text", {"question": 3}, {"question": "propulsion", "variables": {"a": 1}}])
def test_another_kind_of_file_is_refused(file) -> None:
    with pytest.raises(InvalidStudyError):
        read_study(file, Path("small.toml"))


def test_a_file_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    for name, content in (("a.toml", b"question = "), ("b.toml", b"\xff\xfe"), ("c.txt", b""), ("d.yaml", b"a: [")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UnreadableFileError):
            load_study(tmp_path / name)
    with pytest.raises(UnreadableFileError):
        load_study(tmp_path / "missing.toml")


def test_yaml_reads_as_toml_does_and_runs_no_code(tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(table()), encoding="utf-8")
    assert load_study(tmp_path / "small.yaml").hash == study().hash
    (tmp_path / "evil.yaml").write_text("!!python/object/apply:os.system [exit]", encoding="utf-8")
    with pytest.raises(UnreadableFileError, match="not YAML"):
        load_study(tmp_path / "evil.yaml")


def test_a_study_survives_json() -> None:
    asked = study(sampler={"kind": "list", "designs": [{"name": "paper"}, {"name": "half", "spacing": 3.5}]})
    assert Study.from_json(json.loads(json.dumps(asked.to_json()))) == asked


def test_only_what_shapes_rows_counts_for_the_hash() -> None:
    assert study(title="another").hash == study().hash
    assert study(budget={"job_seconds": 5}).hash == study().hash
    assert study(sampler={"seed": 1}).hash != study().hash


def test_a_grid_is_every_combination_of_levels_bounds_included() -> None:
    designs = designs_of(study())
    assert len(designs) == 12
    assert sorted({design["spacing"] for design in designs}) == pytest.approx([2, 8 / 3, 10 / 3, 4])
    assert {design["pressure"] for design in designs} == {0, 6000, 12000}


@pytest.mark.parametrize("kind", ["sobol", "latin-hypercube"])
def test_space_filling_designs_fill_every_quarter_and_repeat_with_their_seed(kind: str) -> None:
    asked = study(sampler={"kind": kind, "count": 32, "seed": 4})
    designs = designs_of(asked)
    spacings = np.array([design["spacing"] for design in designs])
    assert np.histogram(spacings, bins=4, range=(2, 4))[0].tolist() == [8, 8, 8, 8]
    assert designs == designs_of(asked)
    assert designs != designs_of(study(sampler={"kind": kind, "count": 32, "seed": 5}))


def test_a_list_keeps_names_and_fills_in_what_is_nominal() -> None:
    asked = study(sampler={"kind": "list", "designs": [{"name": "paper"}, {"name": "half", "spacing": 3.5}]})
    assert designs_of(asked) == [{"spacing": 3, "pressure": 0}, {"spacing": 3.5, "pressure": 0}]


def test_distributions_have_their_quantiles() -> None:
    def made(**changes) -> Variable:
        return Variable(**{**SPACING, **changes})

    assert made().at(0.5) == 3
    assert made(distribution="log-uniform", low=1, high=100).at(0.5) == pytest.approx(10)
    normal = made(distribution="normal", deviation=0.5)
    assert (normal.at(0.0), normal.at(1.0)) == pytest.approx((2, 4))
    assert normal.at(0.5) == pytest.approx(3)
    # The upper quartile of a normal distribution lies at 0.674 of one, cut off at two at 0.639.
    assert normal.at(0.75) == pytest.approx(3 + 0.5 * 0.6391, abs=1e-3)
    choice = made(distribution="choice", values=(1.0, 2.0, 4.0))
    assert [choice.at(share) for share in (0.0, 0.34, 0.67, 1.0)] == [1, 2, 4, 4]


def test_more_jobs_than_the_budget_allows_are_refused() -> None:
    with pytest.raises(InvalidStudyError, match="12 designs under 2 sets of conditions are 24 jobs, more than"):
        designs_of(study(budget={"jobs": 23}))
    huge = [{**SPACING, "name": f"v{n}", "path": "drive.spacing_pitches", "levels": 1000} for n in range(9)]
    with pytest.raises(HaustraError, match="more than"):
        designs_of(study(variables=huge))


def test_jobs_are_numbered_by_design_then_condition() -> None:
    asked = study()
    jobs = list(jobs_of(asked, designs_of(asked)))
    assert [job.id for job in jobs] == list(range(24))
    assert [job.conditions for job in jobs[:2]] == conditions_of(asked)
    assert [job.design for job in jobs[:3]] == [0, 0, 1]


@pytest.mark.parametrize("name", SHIPPED)
def test_studies_that_ship_are_sound(name: str) -> None:
    asked = load_study(name)
    assert len(designs_of(asked)) * len(conditions_of(asked)) <= asked.budget.jobs
    assert len(asked.objectives) >= 2 or len(asked.scores) >= 2  # what is searched for, or what is explained


def test_a_study_of_patients_asks_a_driver_by_name_and_their_numbers_within_their_own_ranges(tmp_path: Path) -> None:
    """Drivers and devices are names or files, not colons; what the shipped study varies is as patients have it."""
    asked = load_study("cohort-causes")
    known = {variable.path: variable for variable in patient_variables()}
    assert all(variable == known[variable.path] for variable in asked.variables)
    assert asked.conditions == {"driver": ("endoscopist",), "device": ("paediatric-long",)}
    grown = {"patient.sex", "patient.age", "patient.seed", "patient.coiled", "patient.gas_pressure"}
    assert {variable.path for variable in asked.variables} == set(known) - grown
    (tmp_path / "mine.toml").write_text('law = "endoscopist"\n', encoding="utf-8")
    table = {"question": "cohort", "conditions": {"driver": ["mine.toml"], "device": ["adult"]}}
    varied = [{"name": "friction", "path": "patient.friction", "unit": "1", "nominal": 0.05, "low": 0.03, "high": 0.1}]
    own = read_study(table | {"variables": varied}, tmp_path / "study.toml")
    assert own.conditions["driver"] == (str(tmp_path / "mine.toml"),) and str(tmp_path / "mine.toml") in own.inputs


def test_a_study_of_injury_varies_patients_and_what_tears_them_within_their_own_ranges() -> None:
    asked = load_study("injury-causes")
    known = {variable.path: variable for variable in (*patient_variables(), *left_as_they_are())}
    assert all(variable == known[variable.path] for variable in asked.variables)
    fixed = {"patient.sex", "patient.age", "patient.seed"}
    assert {variable.path for variable in asked.variables} == set(known) - fixed


def test_a_study_may_vary_how_a_colon_moves_beside_its_patients() -> None:
    """Patients of a cohort have the numbers of the file; a study gives others, which the colon is hung by."""
    usual = {name: each.value for name, each in numbers().items() if name.startswith("mesentery.")}
    assert (
        Patient.of({}).mesentery.items() > {f"mesentery.{n}": usual[f"mesentery.{n}"] for n in ("drag", "grip")}.items()
    )
    changed = Patient.of({"torsion": 0.1, "thickness_sigmoid": 0.0013}).mesentery
    assert changed["mesentery.torsion"] == 0.1 and changed["mesentery.thickness.sigmoid"] == 0.0013
    assert {each.path for each in mesentery_variables()} & {each.path for each in patient_variables()} == set()


def test_weaker_and_more_different_people_are_torn_by_less() -> None:
    usual, weak, varied = (Patient.of(given) for given in ({}, {"human_over_porcine": 1.0}, {"between_persons": 0.28}))
    assert usual.torn(0.6) == pytest.approx(float(perforation_probability(0.6)))
    assert weak.torn(0.4) == pytest.approx(usual.torn(0.6))
    assert varied.torn(0.6) > usual.torn(0.6)


def test_options_that_are_left_out_are_no_part_of_a_study() -> None:
    assert set(load_study("cohort-causes").options) == {"seconds", "timestep", "precision", "rooted", "stiffen_in"}
